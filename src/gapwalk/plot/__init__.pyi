"""Public names of `gapwalk.plot`; see `gapwalk.lazy_names`."""

from .branches import overlay as overlay
from .models import draw_machine as draw_machine
from .models import machine_svg as machine_svg
from .picture import draw as draw
from .picture import draws as draws
from .picture import figure as figure
from .picture import save as save
from .style import in_style as in_style
from .style import sized as sized
from .style import styled as styled

"""Public names of `gapwalk.goals`; see `gapwalk.lazy_names`."""

from .answers.design_goals import Need as Need
from .answers.design_goals import NoPoint as NoPoint
from .answers.design_goals import PeakBelow as PeakBelow
from .answers.design_goals import Quiet as Quiet
from .answers.design_goals import Resonance as Resonance
from .answers.least_change import Change as Change
from .answers.least_change import LeastChangeOptions as LeastChangeOptions
from .studies.design_study import DesignOptions as DesignOptions

"""Public names of `gapwalk.free`; see `gapwalk.lazy_names`."""

from .backbone_record import Backbone as Backbone
from .backbone_record import BackboneEnd as BackboneEnd
from .backbone_record import BackboneEvent as BackboneEvent
from .backbone_record import BackboneEventKind as BackboneEventKind
from .backbone_record import BackbonePoint as BackbonePoint
from .backbone_walk import BackboneOptions as BackboneOptions
from .backbone_walk import backbone as backbone
from .backbones import Backbones as Backbones
from .conservative import without_losses as without_losses

"""How it moves: the compiled flow with sensitivities and contact events, and sampled motions."""

from gapwalk.flow.contact_events import ContactEvent
from gapwalk.flow.flow import PERIOD, Arc, Flow, flow_of
from gapwalk.flow.motion import ContactRecord, Motion, integrate, sample

__all__ = ["PERIOD", "Arc", "ContactEvent", "ContactRecord", "Flow", "Motion", "flow_of", "integrate", "sample"]

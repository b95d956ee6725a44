"""What vibrates: contacts, excitation, and the system that they make up."""

from gapwalk.model.contact import Contact, DampingLaw, Side, Stage, backlash, stop
from gapwalk.model.damping import ModalDamping, ProportionalDamping
from gapwalk.model.excitation import Harmonic
from gapwalk.model.problems import ModelFileError, Problem
from gapwalk.model.structure import Structure
from gapwalk.model.system import System

# `gapwalk.model.model_file` is not imported here: it needs pydantic, which takes longer to load than all the rest.
__all__ = [
    "Contact",
    "DampingLaw",
    "Harmonic",
    "ModalDamping",
    "ModelFileError",
    "Problem",
    "ProportionalDamping",
    "Side",
    "Stage",
    "Structure",
    "System",
    "backlash",
    "stop",
]

"""The model: contacts, excitation, and the system that they form."""

from gapwalk.model.contact import Contact, Side, Stage, backlash, stop
from gapwalk.model.loads import Harmonic
from gapwalk.model.problems import ModelFileError, Problem
from gapwalk.model.structure import Structure
from gapwalk.model.system import ModalDamping, ProportionalDamping, System

# `gapwalk.model.model_file` is not imported here: it needs pydantic, which loads more slowly than all other modules.
__all__ = [
    "Contact",
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

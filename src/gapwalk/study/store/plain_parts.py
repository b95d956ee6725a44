"""Contacts and harmonics without their numbers as plain JSON values, and back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gapwalk.model.contact import DampingLaw, Side
from gapwalk.model.structure import ContactForm, HarmonicForm, StageForm


def plain_contact(contact: ContactForm) -> dict[str, Any]:
    """A contact."""
    return {
        "name": contact.name,
        "stages": [{"name": stage.name, "side": stage.side.value} for stage in contact.stages],
        "damping": contact.damping.value,
        "reciprocal": contact.reciprocal,
    }


def contact_of(plain: Mapping[str, Any]) -> ContactForm:
    """The contact; any of KeyError, TypeError, ValueError if there is none of this kind."""
    stages = tuple(StageForm(word(stage["name"], empty=True), Side(stage["side"])) for stage in plain["stages"])
    return ContactForm(word(plain["name"]), stages, DampingLaw(plain["damping"]), bool(plain["reciprocal"]))


def plain_harmonic(harmonic: HarmonicForm) -> dict[str, Any]:
    """A harmonic."""
    return {"name": harmonic.name, "order": harmonic.order}


def harmonic_of(plain: Mapping[str, Any]) -> HarmonicForm:
    """The harmonic; errors as `contact_of`."""
    return HarmonicForm(word(plain["name"]), int(plain["order"]))


def word(name: str, *, empty: bool = False) -> str:
    """A name of a part; a ValueError if it cannot be one."""
    if not name.isidentifier() and not (empty and name == ""):
        raise ValueError(f"{name!r} is no name")
    return name

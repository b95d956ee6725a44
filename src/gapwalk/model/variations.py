"""Variations over the angle by loads: numbers of contacts and forces, and their deflections."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

from gapwalk.errors import ModelError
from gapwalk.model.loads import LoadForm
from gapwalk.model.problems import near_names

if TYPE_CHECKING:
    from gapwalk.model.structure import ContactForm

_SHOWN = 5  # names that are listed if none is similar to the unknown one


class Variation(NamedTuple):
    """A number of a contact that varies over the angle."""

    contact: int  #: Number of the contact.
    #: Number of its stage, of those of its form; -1 for a number of the contact as a whole, or a deflection.
    stage: int
    name: str  #: Name of the parameter in its law, or that of the deflection in its formula.
    is_deflection: bool  #: True for a deflection, which varies by the loads themselves: by a displacement.
    loads: tuple[tuple[int, float], ...]  #: The numbers of the loads, each with a factor.


def varied(contacts: Sequence[ContactForm], load: LoadForm, name: str) -> Iterator[tuple[Variation, float]]:
    """Find the numbers that a load varies, by a name such as ``mesh.stiffness``: each with a sign."""

    def refuse(reason: str) -> ModelError:
        return ModelError(f"{load.name} varies {name!r}, {reason}")

    first, _, rest = name.partition(".")
    index = next((index for index, each in enumerate(contacts) if each.name == first), None)
    if index is None or not rest:
        known = [f"{each.name}.{number}" for each in contacts for number in _varying_numbers(each)]
        near = near_names(name, known) or known[:_SHOWN]
        if first in ("stiffness", "damping", "mass"):
            raise refuse(
                "an entry of a matrix, which does not vary: leave it out of the matrix, and write it as a force with a "
                'law such as "k*x" and k = 1.0, named spring say, and varies = "spring.k"'
            )
        raise refuse(
            "which is not a number of a contact or a force; "
            + (f"write {' or '.join(map(repr, near))}" if near else "there are none")
        )
    contact = contacts[index]
    stage_name, _, last = rest.rpartition(".")
    stages = [place for place, stage in enumerate(contact.stages) if stage_name in ("", stage.name)]
    displaced = contact.deflections
    jumps = load.kind.has_levels
    if not stage_name and last in displaced:
        if jumps:
            raise refuse("which cannot jump; vary it by harmonics")
        yield Variation(index, -1, contact.law.arguments[displaced.index(last)], True, ()), 1.0
    elif last == "clearance" and contact.stages and stages:
        signs = {sign for stage in contact.stages for sign in stage.side.signs}
        if jumps:
            raise refuse("which cannot jump; vary it by harmonics")
        if len(signs) > 1 or stage_name:
            raise refuse(
                "but the clearance can only vary with all stages of a contact on one side. Write two contacts, "
                'side = "positive" and side = "negative", and vary the clearance of both'
            )
        # the force depends on the depth alone: a wider gap on one side is a smaller deflection
        yield Variation(index, -1, contact.law.arguments[0], True, ()), -float(signs.pop())
    elif stages and last in {each.name for each in contact.law.stage_parameters[1:]}:
        own = [last, *(["cubic"] if last == "stiffness" and contact.law.has_stage_parameter("cubic") else [])]
        yield from ((Variation(index, place, each, False, ()), 1.0) for place in stages for each in own)
    elif not stage_name and last in {each.name for each in contact.law.parameters}:
        yield Variation(index, -1, last, False, ()), 1.0
    else:
        known = [f"{first}.{number}" for number in _varying_numbers(contact)]
        raise refuse(f"which is not one of its numbers; write one of {', '.join(map(repr, known))}")


def _varying_numbers(contact: ContactForm) -> list[str]:
    """List the names of what can vary in a contact, without that of the contact."""
    of_stages = [each.name for each in contact.law.stage_parameters if contact.stages]
    return [*contact.deflections, *of_stages, *(each.name for each in contact.law.parameters)]

"""Contacts: piecewise springs with clearances, and the damping that acts while they touch."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from gapwalk.errors import ModelError


class DampingLaw(StrEnum):
    """How a contact dissipates: its force ``f`` from its spring's ``g`` and the rate ``v`` of its deflection."""

    NONE = "none"
    """``f = g``."""
    VISCOUS = "viscous"
    """``f = g + c v`` while any stage touches (Dubowsky and Freudenstein 1971); it jumps at contact."""
    HUNT_CROSSLEY = "hunt-crossley"
    """``f = g + beta |g| v`` (Hunt and Crossley 1975): dissipates on both sides."""
    HUNT_CROSSLEY_AS_PRINTED = "hunt-crossley-as-printed"
    """``f = g (1 + beta v)`` (paper, equation 15): feeds energy in on the negative side."""


class Side(StrEnum):
    """The side of the gap on which a stage acts, by the sign of the deflection."""

    BOTH = "both"
    POSITIVE = "positive"
    NEGATIVE = "negative"

    @property
    def signs(self) -> tuple[int, ...]:
        """The signs of the deflection on which the stage acts: +1, -1, or both."""
        return {"both": (1, -1), "positive": (1,), "negative": (-1,)}[self.value]


@dataclass(frozen=True, slots=True)
class Stage:
    """One spring of a contact: it acts beyond its clearance, in addition to the stages inside it.

    Its force is ``stiffness * xi + cubic * xi**3`` with ``xi = x - clearance`` for a deflection
    ``x > clearance``, ``xi = x + clearance`` for ``x < -clearance``, and zero between.

    Parameters
    ----------
    clearance
        Half-width of the gap, >= 0, in units of the deflection.
    stiffness
        What this spring adds to the slope of the force.
    cubic
        Coefficient of its cubic term.
    side
        The side on which it acts.
    name
        The parameters of a stage with a name are called ``contact.name.clearance`` instead of
        ``contact.clearance``. Only one that is alone may have none.
    """

    clearance: float
    stiffness: float = 1.0
    cubic: float = 0.0
    side: Side = Side.BOTH
    name: str = ""


@dataclass(frozen=True)
class Contact:
    """A force ``f(x, x')`` that depends on one deflection ``x = e @ q`` and acts along one direction ``d``.

    Parameters
    ----------
    name
        Prefix of its parameters' names.
    deflection
        The vector ``e`` by coordinate name, for example ``{"q1": 1, "q2": -1}``.
    stages
        Springs in parallel, in the order of growing clearance on each side.
    force
        The vector ``d`` by coordinate name, on the left-hand side of the equations of motion. By default it
        equals ``deflection``, as for any contact that obeys action and reaction.
    damping, impact_damping, viscous_damping
        The damping law, and the coefficient of that law.
    """

    name: str
    deflection: Mapping[str, float] = field(hash=False)
    stages: tuple[Stage, ...]
    force: Mapping[str, float] | None = field(default=None, hash=False)
    damping: DampingLaw = DampingLaw.NONE
    impact_damping: float = 0.0
    viscous_damping: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "stages", tuple(self.stages))
        problems = list(_stage_problems(self)) + list(_damping_problems(self))
        if problems:
            raise ModelError(f"contact {self.name!r}: " + "; ".join(problems))


def backlash(
    name: str,
    deflection: Mapping[str, float],
    clearance: float,
    stiffness: float = 1.0,
    *,
    force: Mapping[str, float] | None = None,
    impact_damping: float = 0.0,
) -> Contact:
    """A symmetric gap of half-width `clearance` with one spring on either side (gear or clutch backlash)."""
    return _hunt_crossley(name, deflection, Stage(clearance, stiffness), force, impact_damping)


def stop(
    name: str,
    deflection: Mapping[str, float],
    clearance: float,
    stiffness: float,
    *,
    side: Side | str = Side.POSITIVE,
    force: Mapping[str, float] | None = None,
    impact_damping: float = 0.0,
) -> Contact:
    """A stop on one side, with one spring: it is touched beyond `clearance`, by the sign of the deflection."""
    return _hunt_crossley(name, deflection, Stage(clearance, stiffness, side=Side(side)), force, impact_damping)


def _hunt_crossley(name, deflection, stage: Stage, force, impact_damping: float) -> Contact:
    damping = DampingLaw.HUNT_CROSSLEY if impact_damping else DampingLaw.NONE
    return Contact(name, deflection, (stage,), force, damping, impact_damping)


def _stage_problems(contact: Contact):
    if not contact.stages:
        yield "it has no stage; give it at least one, with a clearance and a stiffness"
    if len(contact.stages) > 1:
        names = [stage.name for stage in contact.stages]
        if "" in names or len(set(names)) != len(names):
            yield f"its {len(names)} stages need names that differ, but they are {names}"
        for name in names:
            if name and (not name.isidentifier() or name in ("deflection", "force")):
                yield f"stage name {name!r}: write another word of letters, digits and underscores"
    for sign in (1, -1):
        inner, slope = -math.inf, 0.0
        for stage in contact.stages:
            if sign not in stage.side.signs:
                continue
            if not stage.clearance >= 0:
                yield f"clearance is {stage.clearance}; it must be a number >= 0"
            elif stage.clearance <= inner:
                yield (
                    f"stages out of order on the {'positive' if sign > 0 else 'negative'} side: clearance "
                    f"{stage.clearance} follows {inner}; list them from the inside out"
                )
            inner, slope = stage.clearance, slope + stage.stiffness
            if slope < 0 and contact.damping is not DampingLaw.NONE:
                yield f"the slope of the force falls to {slope}; a damped contact needs slopes >= 0"


def _damping_problems(contact: Contact):
    viscous = contact.damping is DampingLaw.VISCOUS
    hunt = contact.damping in (DampingLaw.HUNT_CROSSLEY, DampingLaw.HUNT_CROSSLEY_AS_PRINTED)
    if contact.impact_damping and not hunt:
        yield (
            f"impact_damping is {contact.impact_damping}, but the damping law is {contact.damping.value!r}; "
            'write damping = "hunt-crossley"'
        )
    if contact.viscous_damping and not viscous:
        yield (
            f"viscous_damping is {contact.viscous_damping}, but the damping law is "
            f'{contact.damping.value!r}; write damping = "viscous"'
        )

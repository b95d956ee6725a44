"""Lines of a kernel for a Jenkins element, a spring in series with a slider: its extension, and its force.

The extension follows the slip displacement and is clipped to the limit over the stiffness: a play operator. Between two
steps it is also clipped where the displacement turns round, and it starts where a stage of its host closes, both by
interpolation. The kinks and jumps of the force that this leaves between samples get the corrections of
`gapwalk.ensemble.force_source.ForceSource`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from gapwalk.ensemble.source_text import Sheet, Switch, Term, bump, clipped, either, greatest, least, size
from gapwalk.errors import UnfitError
from gapwalk.model.coefficients import ContactSlots
from gapwalk.model.laws import Friction, Host, Stages, StageTerms, closed_form_of
from gapwalk.model.structure import Structure

_TINY = 1e-300  # keeps the inverse of a vanishing change finite


def past_of(structure: Structure, contact: int) -> list[str]:
    """Return the names of the numbers at the last step that the lines of a contact need, its modes among them."""
    law = structure.contacts[contact].law
    if law.has_memory:
        return ["deflection", "slip rate", "limit", *(["host"] if law.host else [])]
    return ["held"] if law.rebounds else [f"mode {mode}" for mode in range(law.mode_count)]


class HostTerms(NamedTuple):
    """The contact that hosts friction: its slots and numbers, deflection and rate now, last deflection, force."""

    slots: ContactSlots
    number: Callable[[int], Any]
    move: tuple[Term, Term]
    last: Term
    force: Term


class JenkinsSource:
    """Writer of the lines for the extension and the force of one Jenkins element."""

    def __init__(
        self,
        slots: ContactSlots,
        number: Callable[[int], Any],
        active: Callable[[int], bool],
        sheet: Sheet,
        span: Term,
    ) -> None:
        law = slots.form.law
        assert isinstance(law, Friction)
        self._law, self._sheet, self._span = law, sheet, span
        self._own = {name: number(slot) if active(slot) else 0.0 for name, slot in slots.numbers.items()}

    def terms(self, move: tuple[Term, Term], extension: Term, past: Sequence[Term], host: HostTerms | None) -> Jenkins:
        """Write the lines for a step."""
        sheet, spring = self._sheet, self._own["stiffness"]
        x, rate = move[0], move[1] - self._own["speed"]
        before, last_rate, last_width, *_ = past
        travel = (x - before) - self._span * self._own["speed"] if self._own["speed"] else x - before
        stages = [] if host is None else self._stages(host)
        width = self._width([stage.terms for stage in stages], host)
        first, held, turned = self._first_part(travel, (last_rate, rate), (last_width, width))
        if host is not None:
            share = stages[0].share
            for stage in stages[1:]:
                share = greatest(share, stage.share)
            closing = sheet.write("{} > 0.0", share)
            first = either(closing, (1.0 - share) * travel, first)
            held = either(closing, last_width, held)
        between = _within(extension + first, held)
        found = _within(between + (travel - first), width)
        free = extension + travel
        sign = sheet.write("np.copysign(1.0, {})", travel)
        force = found - either(turned, 0.0, sign * self._slip_bump(sign, free, extension, width, last_width))
        if self._law.by == "stages":
            assert host is not None
            for place, stage in enumerate(stages):
                within = [
                    self._width(
                        [
                            replace(each.terms, closed=mode) if at == place else each.terms
                            for at, each in enumerate(stages)
                        ],
                        host,
                    )
                    for mode in (1.0, 0.0)
                ]
                force = force + self._switched(stage, travel, sign * free, free, within)
        return Jenkins(
            found,
            spring * force,
            spring * greatest(size(between), size(found)),
            [x, rate, width, *([] if host is None else [host.move[0]])],
        )

    def _width(self, stages: Sequence[StageTerms], host: HostTerms | None) -> Any:
        """Write the largest extension, the limit over the stiffness."""
        terms = Stages([])
        terms.host = None if host is None else Host(Stages(stages), host.force)
        return greatest(self._sheet.write("{}", self._law.limit(terms, self._own)), 0.0) / self._own["stiffness"]

    def _first_part(self, travel: Term, rates: tuple[Term, Term], widths: tuple[Term, Any]) -> tuple[Term, Any, Term]:
        """Write the displacement until it turns round in the step, the width there, and the condition that it does.

        It is that of the cubic through the displacements and rates at both ends.
        """
        (last, rate), sheet = rates, self._sheet
        turned = sheet.write("{} < 0.0", last * rate)
        at = last / (last - rate)
        excess = travel - self._span * 0.5 * (last + rate)
        tip = self._span * 0.5 * (last * at) + excess * (at * at) * (3.0 - 2.0 * at)
        there = widths[1] if self._law.by == "limit" else widths[0] + at * (widths[1] - widths[0])
        return either(turned, tip, travel), either(turned, there, widths[1]), turned

    def _slip_bump(self, sign: Term, free: Term, extension: Term, width: Any, last_width: Term) -> Any:
        """Write the correction of the kink where slip begins; it vanishes during slip."""
        guard = sign * free - width
        change = guard - (sign * extension - (width if self._law.by == "stages" else last_width))
        return bump(guard, greatest(change, 0.0) + _TINY)

    def _switched(self, stage: _HostStage, travel: Term, pushed: Term, free: Term, widths: Sequence[Any]) -> Any:
        """Write the corrections where a stage of the host closes, a kink, and where it opens, a jump."""
        sheet, (wide, narrow) = self._sheet, widths
        kink = either(
            sheet.write("{} >= {}", pushed, narrow), travel * (bump(stage.depth, stage.reach) / stage.reach), 0.0
        )
        mean = clipped(stage.depth / stage.reach + 0.5)
        jump = (mean - stage.terms.closed) * (_within(free, wide) - _within(free, narrow))
        return either(sheet.write("{} > 0.0", stage.approach), kink, jump)

    def _stages(self, host: HostTerms) -> list[_HostStage]:
        """Return the stages of the host; one that presses is closed from a step before its breakpoint on."""
        x, rate = host.move
        reach, found = size(rate) * self._span + _TINY, []
        for slots in host.slots.stages:
            values = {name: host.number(slot) for name, slot in slots.numbers.items()}
            outward, before = (each if slots.sign > 0 else -each for each in (x, host.last))
            depth = outward - values["clearance"]
            closed = Switch.of(depth + reach if self._law.by == "normal" else depth)
            began = before - values["clearance"]
            # the part of the step after the breakpoint, if it closed within the step
            share = either(
                self._sheet.write("({} > 0.0) & ({} <= 0.0)", depth, began), depth / (depth - began + _TINY), 0.0
            )
            terms = StageTerms(slots.sign, depth, closed, slots.innermost, values)
            found.append(_HostStage(terms, depth, reach, rate if slots.sign > 0 else -rate, share))
        return found


class Jenkins(NamedTuple):
    """Extension and force of a Jenkins element at the end of a step, and the numbers that the next step needs.

    The force is corrected for kinks and jumps nearby; `most` is the largest size of the true one at a turn or the end.
    """

    extension: Any
    force: Any
    most: Any
    past: list[Any]


class _HostStage(NamedTuple):
    """A stage of a host: its terms, its depth, what that changes by in a step, its rate, its closed share of a step."""

    terms: StageTerms
    depth: Term
    reach: Term
    approach: Term
    share: Term


def _within(value: Term, width: Any) -> Term:
    return least(greatest(value, -width), width)


def refuse(structure: Structure) -> None:
    """Refuse what a kernel cannot carry."""
    by_name: Mapping[str, Any] = {contact.name: contact.law for contact in structure.contacts}
    for contact in structure.contacts:
        law, cannot = contact.law, f"the batch integrator cannot include {contact.name!r}: "
        if law.is_dry and not law.has_memory:
            raise UnfitError(
                f"{cannot}it sticks rigidly, and the steps are too long for that; give it a stiffness "
                '(stiffness = "..."), which makes it a Jenkins element, or use the exact flow (gapwalk.integrate)'
            )
        if law.is_dry and law.host and by_name[law.host].rebounds:
            raise UnfitError(
                f"{cannot}the rigid stop {law.host!r} presses, and the batch integrator has no force for it; give the "
                "stop a stiffness, or use the exact flow (gapwalk.integrate)"
            )
        if law.rebounds and closed_form_of(law, contact.shapes) != ():
            raise UnfitError(f"{cannot}its force law {law.name!r} has a force between impacts, beside its stages")
    for variation in structure.variations:
        contact = structure.contacts[variation.contact]
        if not variation.is_deflection and (contact.law.rebounds or (contact.law.is_dry and variation.name == "speed")):
            raise UnfitError(
                f"the batch integrator cannot include {contact.name!r}: its {variation.name} varies over the angle; "
                f'let it move instead (varies = "{contact.name}.deflection"), or use the exact flow (gapwalk.integrate)'
            )

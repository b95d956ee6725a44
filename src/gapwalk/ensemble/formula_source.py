"""Lines of a kernel for a force that is no polynomial of its depth: a formula, or any other law.

They are written by the law itself, evaluated with terms of source text.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from gapwalk.ensemble.source_text import FUNCTIONS, Sheet, Switch, Term, bump, clipped, greatest, size
from gapwalk.errors import UnfitError
from gapwalk.model.coefficients import ContactSlots
from gapwalk.model.laws import KINKS, Stages, StageTerms

_TINY = 1e-300  # keeps the inverse of a vanishing change finite


class FormulaSource:
    """Writer of the lines for the force of one contact by evaluation of its law.

    Where a guard changes its sign between two steps, ``abs``, ``min`` and ``max`` have a kink. They are corrected by
    the bump of `gapwalk.ensemble.force_source.ForceSource`, with the change of the guard since the last step as the
    distance. So is the depth of a stage; what the force jumps by at its breakpoint is averaged over the step.
    """

    def __init__(self, slots: ContactSlots, number: Callable[[int], Term]) -> None:
        self._slots, self._number = slots, number

    def lines(
        self, sheet: Sheet, moves: Sequence[tuple[str, str]], span: str, past: Sequence[str], result: str
    ) -> tuple[list[str], dict[str, str]]:
        """Write the lines for the force; return them, and the names of those guards whose last values it needs."""
        form, law = self._slots.form, self._slots.form.law
        if law.rebounds:
            form.closed_form("the batch integrator")  # refuses it
        given = [(sheet.name(x), sheet.name(rate)) for x, rate in moves]
        modes: list[Any] = [0.0] * law.mode_count
        kinks: list[Any] = [None] * law.mode_count
        stages = self._stages(sheet, given[0], sheet.name(span))
        deflections = dict(zip(law.arguments, given, strict=True))

        def among(stages: Sequence[StageTerms]) -> Stages:
            return Stages(stages, deflections=deflections, modes=modes, functions=FUNCTIONS)

        terms = among([stage for stage, _ in stages])
        numbers: dict[str, Any] = {name: self._number(slot) for name, slot in self._slots.numbers.items()}
        numbers[KINKS] = kinks
        guards: list[Any] = []
        try:
            for mode in range(law.mode_count):  # a guard may depend on earlier modes
                guards.append(law.guards(given[0][1], terms, numbers)[mode])
                modes[mode] = Switch.of(guards[mode])
                if isinstance(guards[mode], Term):
                    kinks[mode] = bump(guards[mode], size(guards[mode] - sheet.name(past[mode])) + _TINY)
            force = law.force(given[0][1], terms, numbers)
            for place, (_, early) in enumerate(stages):
                just = [
                    among(
                        [
                            replace(stage, closed=mode, depth=0.0) if at == place else stage
                            for at, (stage, _) in enumerate(stages)
                        ]
                    )
                    for mode in (1.0, 0.0)
                ]
                jump, none = (law.force(given[0][1], each, numbers) for each in just)
                force = force - early * (jump - none)
        except TypeError as error:
            raise UnfitError(
                f"the batch integrator cannot include {form.name!r}: the formula of its force law {law.name!r} uses "
                f"more than + - * / and the functions that it is given ({error})"
            ) from error
        lines = sheet.lines(force)
        text = "\n".join(lines)
        kept = {name: guard.text for name, guard in zip(past, guards, strict=True) if re.search(rf"\b{name}\b", text)}
        return [*lines, f"{result} = {force.text if isinstance(force, Term) else repr(float(force))}"], kept

    def _stages(self, sheet: Sheet, move: tuple[Term, Term], span: Term) -> list[tuple[StageTerms, Term]]:
        """Return the stages, each closed from a step before its breakpoint on, with the excess of its mode."""
        found, (x, rate) = [], move
        width = size(rate) * span + _TINY
        for stage in self._slots.stages:
            values = {name: self._number(slot) for name, slot in stage.numbers.items()}
            past = (x if stage.sign > 0 else -x) - values["clearance"]
            depth = greatest(past, 0.0) + bump(past, width)
            closed = Switch.of(past + width)
            mean = clipped(past / width + 0.5)
            terms = StageTerms(stage.sign, depth if stage.sign > 0 else -depth, closed, stage.innermost, values)
            found.append((terms, closed - mean))
        return found

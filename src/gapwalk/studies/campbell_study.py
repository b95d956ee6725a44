"""The study of a Campbell diagram: natural frequencies over the speed in each state, and the orders that meet them."""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from annotated_types import Ge, Gt, Le

from gapwalk.answers.campbell import Campbell, campbell_of
from gapwalk.answers.order_map import orders_of
from gapwalk.errors import ModelError
from gapwalk.model.modes import ModeState
from gapwalk.model.problems import given
from gapwalk.model.system import System
from gapwalk.results.codec import plain
from gapwalk.results.result_file import Part
from gapwalk.studies.options import RangeStudy
from gapwalk.studies.study_kind import Found, Job


@dataclass(frozen=True)
class CampbellStudy(RangeStudy):
    """A Campbell diagram: natural frequencies over the speed in each state, and where orders meet them.

    States are: all teeth closed; friction that sticks; the teeth of loose gears open; each stage of a clutch. A gear is
    loose if nothing but drags loads it.

    Raises
    ------
    ModelError
        If the parameter is not the frequency or the speed.

    Examples
    --------
    >>> found = gw.ask.campbell(driveline, "speed", (400, 2000), points=5)
    >>> found.crossings[0].order, round(found.crossings[0].value)
    (2.0, 1618)
    """

    kind: ClassVar[str] = "campbell"
    answer: ClassVar[Part | None] = Part("campbell", Campbell)

    #: Orders of the rays, per turn of the reference shaft; without a speed, multiples of the excitation. By default
    #: those of the loads.
    orders: tuple[Annotated[float, Gt(0.0), Le(1000.0)], ...] = ()
    #: Number of speeds at which modes are computed, where the equations depend on the speed.
    points: Annotated[int, Ge(2), Le(10_000)] = 101

    @property
    def most_workers(self) -> int:
        """One: it takes a moment."""
        return 1

    @property
    def plan(self) -> str:
        """Describe the work to be done, in one line."""
        return f"Campbell diagram over {self.range_words}"

    def refuse_invalid(self, system: System) -> None:
        """Refuse another parameter than the speed, and a machine that has neither loads nor orders."""
        pace = system.structure.pace
        if self.parameter != pace:
            raise ModelError(
                f"parameter is {given(self.parameter)}; a Campbell diagram goes over the {pace}: write parameter = "
                f'"{pace}"'
            )
        super().refuse_invalid(system)
        if not (self.orders or orders_of(system)):
            raise ModelError("no load has an order; write the orders of the rays, as in orders = [2, 4, 6]")

    def do(self, job: Job) -> Generator[Found]:
        """Compute the modes in all states."""
        orders = self.orders or orders_of(job.system)
        yield job.end(campbell_of(job.system, (self.begin, self.end), orders, self.points))

    def document(self, found: Campbell, points: bool) -> dict[str, Any]:
        """Return states and crossings as JSON values; with the frequencies at all speeds if points are wanted."""

        def state(each: ModeState, number: int) -> dict[str, Any]:
            first = [value for value in found.frequencies[number, :, 0].tolist() if not math.isnan(value)]
            own = {"state": each.text, "sticks": each.stuck, "frequencies": first}
            return own | ({"over_speed": plain(found.frequencies[number])} if points else {})

        return {
            "parameter": found.parameter,
            "orders": list(found.orders),
            "states": [state(each, number) for number, each in enumerate(found.states)],
            "crossings": [each._asdict() for each in found.crossings],
            **({"values": plain(found.values)} if points else {}),
        }

"""Time and number of calls of each part of the walk of figure 13: ``python -m benchmarks.ledger``.

With ``python -m benchmarks.ledger friction`` it is the walk with friction .02 in the clutch. Each part is wrapped by a
clock. It counts the CPU time of the part itself, without that of the parts that it calls. The clocks take about a
microsecond per call, so the shares are accurate to a few per cent.
"""

from __future__ import annotations

import sys
import time
from collections import Counter, defaultdict
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any
from unittest.mock import patch

from rich.console import Console
from rich.table import Table

from benchmarks.branch import start_with_friction
from gapwalk import Orbit, find_orbit, follow, paper
from gapwalk.bifurcation import follow as branch_tracer
from gapwalk.bifurcation import friction_along_branch as friction_changes
from gapwalk.bifurcation import special_point as special_point_kind
from gapwalk.bifurcation.detector import Detector
from gapwalk.bifurcation.kinds import grazing, sliding
from gapwalk.bifurcation.kinds.critical_multipliers import Flip
from gapwalk.bifurcation.special_point import Search
from gapwalk.continuation.corrector import Corrector
from gapwalk.continuation.walk import Walk
from gapwalk.flow.contact_events import Switchboard, TurningPoints
from gapwalk.flow.flow import Flow, _Integrator
from gapwalk.orbit import orbit as measures
from gapwalk.orbit import orbit as orbits
from gapwalk.orbit.shooting import ShootingEquation

_REPEATS = 5

# (part, where it is, its name); a function that is not listed counts for the part that calls it.
PARTS = (
    ("flow", _Integrator, "_run"),
    ("flow", _Integrator, "_sampled"),
    ("start of each flow call", _Integrator, "_prepare"),
    ("around each flow call", Flow, "_lend"),
    ("callbacks of contacts", Switchboard, "at_event"),
    ("callbacks of friction", Switchboard, "at_slip"),
    ("callbacks of turning points", TurningPoints, "at_event"),
    ("residual and Jacobian", ShootingEquation, "evaluate"),
    ("Newton's method and tangent", Corrector, "correct"),
    ("records of points", Corrector, "point"),
    ("records of points", ShootingEquation, "orbit"),
    ("the walk", Walk, "__next__"),
    ("explaining each step", branch_tracer.BranchTracer, "__next__"),
    ("detection", Detector, "inspect"),
    ("detection", Search, "zeros"),
    ("changes of friction", sliding, "find_changes"),
    ("changes of friction", friction_changes, "margin"),
    ("grazing", grazing, "find_grazing"),
    ("stated errors", special_point_kind, "location_error"),
    ("stated errors", grazing, "location_error"),
    ("stated errors", sliding, "location_error"),
    ("surveys", orbits, "survey"),
    ("margins of friction", measures, "margins_of"),
    ("criticality of flips", Flip, "judged"),
)

# parts whose flow calls are counted, without those that are inside another of these parts
STAGES = (
    "the walk",
    "detection",
    "changes of friction",
    "grazing",
    "stated errors",
    "surveys",
    "criticality of flips",
)


class Ledger:
    """Own time in seconds, calls, and flow calls by stage."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self.calls: Counter[str] = Counter()
        self.flow_calls: Counter[str] = Counter()
        self._inner = [0.0]
        self._stages = ["the rest"]

    def clock(self, part: str, function: Callable) -> Callable:
        """Wrap a function with a clock."""

        def clocked(*args: Any, **options: Any) -> Any:
            if part == "around each flow call":
                self.flow_calls[self._stages[-1]] += 1
            self._stages.append(part if part in STAGES else self._stages[-1])
            self._inner.append(0.0)
            start = time.process_time()
            try:
                return function(*args, **options)
            finally:
                spent = time.process_time() - start
                self.seconds[part] += spent - self._inner.pop()
                self.calls[part] += 1
                self._inner[-1] += spent
                self._stages.pop()

        return clocked


def measure(start: Orbit) -> Ledger:
    """Return the ledger of the fastest of several walks from an orbit."""
    follow(start, "frequency", to=0.15)  # compiles the flows
    ledgers = []
    for _ in range(_REPEATS):
        ledger = Ledger()
        with ExitStack() as stack:
            for part, owner, name in PARTS:
                stack.enter_context(patch.object(owner, name, ledger.clock(part, getattr(owner, name))))
            begun = time.process_time()
            follow(start, "frequency", to=0.15)
            ledger.seconds["the rest"] += time.process_time() - begun - sum(ledger.seconds.values())
        ledgers.append(ledger)
    return min(ledgers, key=lambda each: sum(each.seconds.values()))


def as_table(ledger: Ledger) -> Table:
    """Return the ledger as a table of text."""
    table = Table("part", "share", "ms", "calls", "us a call", "flow calls of this stage")
    whole = sum(ledger.seconds.values())
    for part, seconds in sorted(ledger.seconds.items(), key=lambda each: -each[1]):
        calls, flow_calls = ledger.calls[part], ledger.flow_calls[part]
        each = f"{seconds / calls * 1e6:.1f}" if calls else ""
        count, flow_count = (str(number or "") for number in (calls, flow_calls))
        table.add_row(part, f"{seconds / whole:.0%}", f"{seconds * 1e3:.1f}", count, each, flow_count)
    table.add_row("all", "", f"{whole * 1e3:.1f}", "", "", str(sum(ledger.flow_calls.values())))
    return table


if __name__ == "__main__":
    begin = start_with_friction(None) if "friction" in sys.argv[1:] else find_orbit(paper.case("13"), frequency=1.9)
    Console(width=100).print(as_table(measure(begin)))

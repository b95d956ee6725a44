"""Time and number of calls of each part of the walk of figure 13: ``python -m benchmarks.ledger``.

Each part is wrapped by a clock. It counts the CPU time of the part itself, without that of the parts that it calls. The
clocks take about a microsecond per call, so the shares are accurate to a few per cent.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any
from unittest.mock import patch

from rich.console import Console
from rich.table import Table

from gapwalk import find_orbit, follow, paper
from gapwalk.bifurcation import branch_tracer as tracer
from gapwalk.bifurcation import detector as detect
from gapwalk.bifurcation import grazing
from gapwalk.bifurcation.detector import Detector
from gapwalk.continuation.corrector import Corrector
from gapwalk.continuation.walk import Walk
from gapwalk.flow import flow as flows
from gapwalk.flow.contact_events import Switchboard
from gapwalk.flow.flow import Flow
from gapwalk.orbit import orbit as orbits
from gapwalk.orbit import shooting
from gapwalk.orbit.shooting import ShootingEquation

_REPEATS = 7

# (part, where it is, its name); a function that is not listed counts for the part that calls it.
PARTS = (
    ("heyoka", Flow, "_run"),
    ("around each flow call", Flow, "integrate"),
    ("residual and Jacobian", ShootingEquation, "evaluate"),
    ("Newton's method and tangent", Corrector, "correct"),
    ("Newton's method and tangent", Corrector, "tangent"),
    ("records of points", Corrector, "point"),
    ("records of points", ShootingEquation, "orbit"),
    ("multipliers", shooting, "multipliers"),
    ("the walk", Walk, "__next__"),
    ("detection", Detector, "inspect"),
    ("detection", Detector, "_scan"),
    ("locating zeros", Detector, "_locate"),
    ("doubt of grazing", detect, "find_grazing"),
    ("locating grazing", grazing, "_locate"),
    ("surveys", orbits, "survey"),
    ("nature of flips", tracer, "with_nature"),
)

# parts whose flow calls are counted, without those that are inside another of these parts
STAGES = ("the walk", "detection", "locating zeros", "locating grazing", "surveys", "nature of flips")


class Ledger:
    """Own time in seconds, calls, and flow calls by stage."""

    def __init__(self) -> None:
        self.seconds: Counter[str] = Counter()
        self.calls: Counter[str] = Counter()
        self.flow_calls: Counter[str] = Counter()
        self._inner = [0.0]
        self._stages = ["the rest"]

    def clock(self, part: str, function: Callable) -> Callable:
        """Wrap a function with a clock."""

        def clocked(*args: Any, **options: Any) -> Any:
            if part == "heyoka":
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


def measure() -> Ledger:
    """Return the ledger of the fastest of several walks."""
    orbit = find_orbit(paper.case("13"), frequency=1.9)
    ledgers = []
    for _ in range(_REPEATS):
        ledger = Ledger()
        with ExitStack() as stack:
            for owner, name in ((Switchboard, "callback"), (Flow, "_note")):
                stack.enter_context(patch.object(owner, name, _clocked_callback(ledger, getattr(owner, name))))
            flows._compile.cache_clear()  # so that flows are made with these callbacks
            for part, owner, name in PARTS:
                stack.enter_context(patch.object(owner, name, ledger.clock(part, getattr(owner, name))))
            follow(orbit, "frequency", to=1.7)  # makes the flows
            for counts in (ledger.seconds, ledger.calls, ledger.flow_calls):
                counts.clear()
            start = time.process_time()
            follow(orbit, "frequency", to=0.15)
            ledger.seconds["the rest"] += time.process_time() - start - sum(ledger.seconds.values())
        ledgers.append(ledger)
    flows._compile.cache_clear()
    return min(ledgers, key=lambda each: sum(each.seconds.values()))


def as_table(ledger: Ledger) -> Table:
    """Return the ledger as a table of text."""
    table = Table("part", "share", "ms", "calls", "us a call", "flow calls of this stage")
    whole = sum(ledger.seconds.values())
    for part, seconds in ledger.seconds.most_common():
        calls, flow_calls = ledger.calls[part], ledger.flow_calls[part]
        each = f"{seconds / calls * 1e6:.1f}" if calls else ""
        count, flow_count = (str(number or "") for number in (calls, flow_calls))
        table.add_row(part, f"{seconds / whole:.0%}", f"{seconds * 1e3:.1f}", count, each, flow_count)
    table.add_row("all", "", f"{whole * 1e3:.1f}", "", "", str(sum(ledger.flow_calls.values())))
    return table


def _clocked_callback(ledger: Ledger, make: Callable) -> Callable:
    def made(*args: Any) -> Callable:
        return ledger.clock("callbacks", make(*args))

    return made


if __name__ == "__main__":
    Console(width=100).print(as_table(measure()))

"""Results next to closed forms and numbers that others have published: a table of the page on validation.

    python -m tests.trust.compared

computes every line and writes the table into the page; ``test_compared.py`` computes the lines again.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import gapwalk as gw
from tests.dry import closed_forms as dry
from tests.machines import closed_forms as machines
from tests.models import read_system

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "explanation" / "validation.md"
BEGIN, END = "<!-- compared -->\n", "<!-- end -->"


@dataclass(frozen=True)
class Line:
    """A line of the table."""

    what: str  #: The quantity.
    source: str  #: Where its value is from.
    reference: float  #: That value.
    bound: float  #: Largest difference relative to it; for a printed value, what its digits and its method allow.
    compute: Callable[[], float]

    @property
    def difference(self) -> float:
        """Relative difference of what is computed now."""
        return abs(self.compute() / self.reference - 1.0)


def _figure_13(kind: str) -> float:
    orbit = gw.find_orbit(gw.paper.case("13"), frequency=1.4)
    return gw.follow(orbit, "frequency", to=1.2).special(kind)[0].value


def _meissner() -> float:
    changes = {"wave.amplitude": 0.5, "damping.x.x": 0.1, "frequency": 1.6}
    system = read_system(ROOT / "tests" / "machines" / "meissner.toml").at(changes)
    return gw.follow(gw.find_orbit(system), "frequency", 2.4).special("flip")[0].value


def _den_hartog() -> float:
    brake = gw.friction("brake", {"x": 1.0}, limit=0.3)
    load = gw.Harmonic(1.0, {"x": 1.0})
    system = gw.System(["x"], [[1.0]], contacts=[brake], harmonics=[load], frequency=0.8)
    return gw.find_orbit(system).measure("max.x")


def _one_impact() -> float:
    wall = gw.rigid_stop("wall", {"x": 1.0}, clearance=1.0, restitution=0.8)
    load = gw.Harmonic(0.05, {"x": 1.0}, name="load")
    system = gw.System(["x"], [[1.0]], [[0.1]], contacts=[wall], harmonics=[load], frequency=1.0)
    return gw.follow(gw.find_orbit(system), "load.amplitude", 0.11).special("fold")[0].value


def _nlvib() -> float:
    system = read_system(ROOT / "tests" / "machines" / "geometric.toml").at(
        {"harmonic1.amplitude": 3e-3, "frequency": 1.2}
    )
    return gw.follow(gw.find_orbit(system), "frequency", 1.05).measure("h1.q1").max()


LINES = (
    Line(
        "Oscillator with dry friction, limit 0.3, at 0.8 of its natural frequency: amplitude",
        "Den Hartog 1931, closed form",
        dry.den_hartog(0.8, 0.3),
        1e-11,
        _den_hartog,
    ),
    Line(
        "Impact oscillator at resonance, restitution 0.8: excitation at the fold of motions with one impact",
        "closed form",
        dry.one_impact_fold(),
        1e-10,
        _one_impact,
    ),
    Line(
        "Meissner's equation, e = 0.5, damping ratio 0.05: lower edge of the tongue of period 2",
        "trace of two matrix exponentials",
        min(machines.meissner_edges(0.5, 0.05)),
        1e-11,
        _meissner,
    ),
    Line(
        "Clutch of figure 13 of the paper: first flip from high frequencies",
        "AUTO-07p, corrected by a second code with events",
        1.3318380288880727,
        1e-12,
        lambda: _figure_13("flip"),
    ),
    Line(
        "Geometric nonlinearity of NLvib's example 6, F = 0.003: peak of the first harmonic",
        "printed by NLvib with 1 to 3 harmonics",
        0.327993,
        3e-3,
        _nlvib,
    ),
)


def table() -> str:
    """Compute and write the table."""
    rows = []
    for line in LINES:
        found = f"{line.reference:.12g} | {line.compute():.12g} | {line.difference:.0e} | {line.bound:.0e}"
        rows.append(f"| {line.what} | {line.source} | {found} |")
    head = "| quantity | reference | its value | gapwalk | relative difference | allowed |\n|---|---|---|---|---|---|\n"
    return head + "\n".join(rows) + "\n"


def main() -> None:
    """Write the table into the page."""
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    PAGE.write_text(before + BEGIN + "\n" + table() + "\n" + END + rest.partition(END)[2], encoding="utf-8")


if __name__ == "__main__":
    main()

"""Results compared with closed forms and numbers that others have published: a table of the page on validation.

    python -m tests.trust.compared

computes every line and writes the table into the page; ``test_compared.py`` and ``test_published_cases.py`` compute the
lines again.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import gapwalk as gw
from tests.dry import closed_forms as dry
from tests.machines import closed_forms as machines
from tests.models import read_system
from tests.trust.test_published_cases import CASES

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "explanation" / "validation.md"
BEGIN, END = "<!-- compared -->\n", "<!-- end -->"


@dataclass(frozen=True)
class Line:
    """A line of the table: one number or several, of which the first is shown."""

    what: str  #: The quantity.
    source: str  #: Where its value is from.
    right: Sequence[float]  #: That value.
    bound: float  #: Largest difference; for a printed value, what its digits and its method allow.
    compute: Callable[[], Sequence[float]]

    @property
    def shown(self) -> str:
        """The reference as the table has it."""
        return f"{self.right[0]:.12g}" + (f" and {len(self.right) - 1} more" if len(self.right) > 1 else "")

    def row(self, now: Sequence[float]) -> str:
        """The row with what is computed now."""
        found = f"{now[0]:.12g} | {self.difference(now):.0e} | {self.bound:.0e}"
        return f"| {self.what} | {self.source} | {self.shown} | {found} |"

    def difference(self, now: Sequence[float]) -> float:
        """Largest difference of the numbers that are computed now."""
        return max(abs(one - other) for one, other in zip(now, self.right, strict=True))


def _case(name: str, what: str, source: str) -> Line:
    compute, right, bound = CASES[name]
    return Line(what, source, right, bound, compute)


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


def _nlvib() -> float:
    system = read_system(ROOT / "tests" / "machines" / "geometric.toml").at(
        {"harmonic1.amplitude": 3e-3, "frequency": 1.2}
    )
    return gw.follow(gw.find_orbit(system), "frequency", 1.05).measure("h1.q1").max()


OWN = (
    Line(
        "Oscillator with dry friction, limit 0.3, at 0.8 of its natural frequency: amplitude",
        "Den Hartog 1931, closed form",
        [dry.den_hartog(0.8, 0.3)],
        1e-11,
        lambda: [_den_hartog()],
    ),
    Line(
        "Meissner's equation, e = 0.5, damping ratio 0.05: lower edge of the tongue of period 2",
        "trace of two matrix exponentials",
        [min(machines.meissner_edges(0.5, 0.05))],
        1e-11,
        lambda: [_meissner()],
    ),
    Line(
        "Clutch of figure 13 of the paper: first flip from high frequencies",
        "AUTO-07p, corrected by a second code with events",
        [1.3318380288880727],
        1e-12,
        lambda: [_figure_13("flip")],
    ),
    Line(
        "Geometric nonlinearity of NLvib's example 6, F = 0.003: peak of the first harmonic",
        "printed by NLvib with 1 to 3 harmonics",
        [0.327993],
        1e-3,
        lambda: [_nlvib()],
    ),
)
PUBLISHED = tuple(
    _case(*words)
    for words in (
        (
            "impact pair",
            "Impact pair, restitution r = 0.8: least amplitude of the base for one impact on each side",
            "closed form: k/√(1 + k²), k = 2(1 - r)/(π(1 + r))",
        ),
        ("bouncing ball", "Ball that bounces with restitution 0.8: times of impacts, and of rest", "geometric series"),
        (
            "one impact a period",
            "Impact oscillator at resonance, restitution 0.8: velocity after the impact, and the fold",
            "root of the closed equations of one impact",
        ),
        ("elastic impacts", "Elastic impacts at a stop: velocity, product of the multipliers", "closed form"),
        ("friction on a moving base", "Dry friction on a base that moves harmonically: amplitude", "0.3 π²/8"),
        ("Liouville", "Oscillator with a cubic spring: product of the multipliers", "Liouville: exp(-2π/1.3)"),
        ("exponents of one impact a period", "Sum of the Lyapunov exponents, one impact a period", "closed form"),
        ("modes of a locked clutch", "Natural frequencies of a train with a locked clutch", "SciPy, smaller matrices"),
        ("stiffness of a mesh", "Gear mesh with varying stiffness: both flips", "monodromy matrix, SciPy's DOP853"),
        ("softening Duffing", "Softening Duffing oscillator: both folds", "SciPy's DOP853 and a root finder"),
        ("friction that falls with |v|", "Friction that falls with the speed: two amplitudes", "DOP853 with events"),
        ("peak of NLvib's Duffing", "Duffing oscillator of NLvib's example 1: peak of the rms", "printed by NLvib"),
        ("Siconos's ball", "Ball on an elastic floor: height after 0.84 s", "printed by Siconos"),
    )
)
LINES = (PUBLISHED[0], OWN[0], OWN[1], *PUBLISHED[1:], *OWN[2:])


def table() -> str:
    """Compute and write the table."""
    head = "| quantity | independent number | its value | gapwalk | largest difference | allowed |\n"
    return head + "|---|---|---|---|---|---|\n" + "\n".join(line.row(line.compute()) for line in LINES) + "\n"


def main() -> None:
    """Write the table into the page."""
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    PAGE.write_text(before + BEGIN + "\n" + table() + "\n" + END + rest.partition(END)[2], encoding="utf-8")


if __name__ == "__main__":
    main()

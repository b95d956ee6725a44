"""Tori of figure 15 along the frequency, and the long simulations that give their rotation numbers to 1e-8."""

from __future__ import annotations

from benchmarks.effort import Effort
from benchmarks.row import Row, Target
from benchmarks.stopwatch import side_by_side
from gapwalk import analysis, paper, settle, tori
from gapwalk.attractors.rotation import rotation

GROUP = "Tori of figure 15"
_STROBES = 8192  # on each curve, from a state on the torus: the shortest simulation that is as accurate everywhere
_AGREE = 1e-8
_RANGES = {"near W = 1.165": (1.165, (1.162, 1.168)), "near W = 1.12": (1.12, (1.117, 1.1215))}


def rows(effort: Effort) -> list[Row]:
    """Measure all lines."""
    return [measure_family(what, *where, effort) for what, where in _RANGES.items()]


def measure_family(what: str, begin: float, to: tuple[float, float], effort: Effort) -> Row:
    """Measure a torus within a family, events included, against a simulation at one value."""
    case = paper.case("15")
    torus = tori.find_torus(settle(case, frequency=begin))
    found = tori.follow_tori(torus, "frequency", to)

    def ours():
        return tori.follow_tori(torus, "frequency", to)

    def theirs():
        strobes = analysis.strobe(torus.system, torus.state(), _STROBES * torus.curves)
        return rotation(strobes.states, torus.curves)

    simulated = theirs()
    assert simulated is not None
    assert min(abs(torus.rotation - each) for each in (simulated.number, 1.0 - simulated.number)) < _AGREE
    family, simulation = side_by_side([ours, theirs], effort)
    count = len(found.points)
    return Row(
        GROUP,
        f"a torus of {torus.curves} curves {what}, one of {count} in a family",
        family / count,
        simulation,
        f"{_STROBES} strobes on each curve",
        (Target(0.2),),
        {"tori": count},
    )

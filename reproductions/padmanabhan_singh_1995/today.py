"""What can be seen today that could not be seen in 1995, and what the numbers were checked against."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.figures import Figure
from reproductions.padmanabhan_singh_1995.jobs import CHANGES, JOBS
from reproductions.padmanabhan_singh_1995.panels import Fact, Loops, Through
from reproductions.padmanabhan_singh_1995.quantities import attractor_of

TODAY = (
    Figure(
        "through",
        "A system with losses has a motion of period 1 at every amplitude, stable or not. This branch goes through "
        "the range where the paper found nothing, and is stable over most of it: motions settle on it. Newton's "
        "method alone seldom comes to it from a random start; a walk along the amplitude passes through.",
        (
            Through(
                title="the branch that begins at small amplitudes",
                jobs=("27",),
                within=(0.1, 0.65),
                facts=(Fact("paper: nothing found", 0.3, 0.45),),
            ),
        ),
        kind="The branch through figure 27",
    ),
    Figure(
        "slivers",
        "Period 4 is stable in ranges narrower than a thousandth of the frequency. Each point where stability changes "
        "is located to ten digits, far more finely than these ranges.",
        (
            Loops(title="figure 16", jobs=("16-doubled",), within=(0.4128, 0.4158)),
            Loops(title="figure 13, beside the jump", jobs=("13-doubled",), within=(0.6842, 0.686)),
        ),
        kind="Slivers of period 4",
    ),
)
"""What is drawn: it stands on the page behind the figures of the paper."""

_MOTIONS = (("17", ""), ("17-start", "k11-0"), ("18", ""), ("18-start", "k11-0"), ("19", ""), ("19-start", "k11-0"))
_ELSEWHERE = ("17-near", "18-near", "19-near")


class Exponent(NamedTuple):
    """The largest Lyapunov exponent of a settled motion, per forcing period."""

    place: str  #: Where, in words.
    label: str  #: The kind of motion.
    value: float
    error: float

    def __str__(self) -> str:
        """The number with its error; that of a periodic motion follows from its multipliers to all digits shown."""
        averaged = f"{self.value:+.3f} ± {self.error:.3f}"
        return (averaged if self.error > 5e-6 else f"{self.value:+.5f} (of the multipliers)").replace("-", "−")


def exponents(results: Mapping[str, gw.Result]) -> list[Exponent]:
    """Return the exponents of the motions of figures 17 to 19: as printed, without the first stage, and elsewhere."""
    jobs = [JOBS[key].at(CHANGES[change]) if change else JOBS[key] for key, change in _MOTIONS]
    jobs += [JOBS[key] for key in _ELSEWHERE if key in JOBS]
    found = []
    for job in jobs:
        if job.key in results:
            attractor = attractor_of(results[job.key])
            exponents = attractor.lyapunov
            assert exponents is not None
            words = job.reading.differs or ("printed numbers" if not job.changes else "printed row, another frequency")
            place = f"Ω = {attractor.system.frequency:g}, {words}"
            found.append(
                Exponent(place, attractor.label, float(exponents.per_period[0]), float(exponents.errors_per_period[0]))
            )
    return found


EXPONENTS = (
    "Figures 17 to 19 tell period 3, a torus and chaos apart by their sections. The largest Lyapunov exponent with its "
    "error decides it: below zero the motion is periodic, at zero it is a torus, above zero chaos."
)

FIFTY = (
    "The paper names its limit: n + n² equations are integrated for the Jacobian, so large systems cost too much. "
    "Transition matrices are exact here, and cost one product of matrices per step. The machine of figure 13 with its "
    "shaft and driveline divided into 48 inertias has 49 coordinates; its response from Ω = 2 to 0.3, 228 points with "
    "all multipliers and 8 special points to ten digits, takes half a minute of one core."
)

CHECKED = (
    (
        "AUTO-07p and a second code with events",
        "first flip of figure 13, at Ω = 1.33183802889",
        "2e-15 (allowed 1e-12)",
    ),
    (
        "harmonic balance with 12 and 20 harmonics",
        "the responses of figure 9 a and b",
        "2e-4 and 5e-4 of the ranges; special points 3e-5",
    ),
    ("DOP853 of SciPy, stopped at each contact", "periods of motion", "2e-7, which is the error of DOP853"),
    ("steps 20 times smaller", "21 responses of the paper, 484 special points", "none missing, none spurious; 5e-14"),
    (
        "an independent program in C: Runge-Kutta steps, contacts by bisection, arclength walks",
        "60 walks, 20 branches over Te1, 12 loops, 200 settled motions",
        "the 3 to 4 digits of its walks",
    ),
    (
        "the machine of equations 1 to 3 with its three inertias, in units",
        "11 folds, flips and Neimark-Sacker points of figure 13",
        "4 digits",
    ),
)
"""What the numbers were checked against: by what, what, and how far they agree."""

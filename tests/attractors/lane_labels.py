"""Labels of settled motions by equal steps, against runs of four times the length with a quarter of the step.

``python -m tests.attractors.lane_labels`` compares some 2,000 labels of six trains of 6 to 25 inertias (ten minutes of
CPU time), and lists each that is wrong, with the figures on both sides: within what is stated of it (how often a gap
parts or may part, and for how long chaos was watched), or outside.
"""

from __future__ import annotations

import io
import sys
import time
from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.stats import binomtest

import gapwalk as gw
from gapwalk.answers.gap_states import usual_gaps
from gapwalk.answers.lane_sweep import random_states
from gapwalk.attractors.lane_settling import LaneMotion, Start, settle_lanes
from gapwalk.ensemble.batch_flow import state_at_rest
from gapwalk.ensemble.lanes import Lanes
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.system import System


class Text:
    """A model file of a train, part by part."""

    def __init__(self, speed: str, reaction: str, mean: str, friction: bool = True) -> None:
        self.lines = [f'speed = "{speed}"\nreaction = "{reaction}"\nmean = {{ {mean} }}']
        self.friction = friction

    def inertias(self, **values: float) -> None:
        """Add inertias, in kg m^2."""
        self.lines += [f'[[inertia]]\nname = "{name}"\ninertia = "{value:g} kg m^2"' for name, value in values.items()]

    def shaft(self, name: str, one: str, other: str, stiffness: float, damping: float, dry: float = 0.0) -> None:
        """Add a shaft, with friction in series with a spring of three times its stiffness."""
        self.lines.append(
            f'[[shaft]]\nname = "{name}"\nbetween = ["{one}", "{other}"]\nstiffness = "{stiffness:g} N m/rad"\n'
            f'damping = "{damping:g} N m s/rad"'
        )
        if dry and self.friction:
            self.lines.append(f'hysteresis = "{dry:g} N m"\nhysteresis_stiffness = "{3 * stiffness:g} N m/rad"')

    def stages(self, positive: str, negative: str, stiffness: float) -> None:
        """Add a stage on both sides of the last shaft."""
        for side, clearance in (("positive", positive), ("negative", negative)):
            self.lines.append(
                f'[[shaft.stage]]\nside = "{side}"\nclearance = "{clearance}"\nstiffness = "{stiffness:g} N m/rad"'
            )

    def gear(self, name: str, one: str, other: str, ratio: float, gap: str, stiffness: float, own: str = "") -> None:
        """Add a mesh with backlash; without a line of its own it has impact damping."""
        own = own or 'impact_damping = "0.4 s/rad"'
        self.lines.append(
            f'[[gear]]\nname = "{name}"\nbetween = ["{one}", "{other}"]\nratio = {ratio:g}\nclearance = "{gap}"\n'
            f'stiffness = "{stiffness:g} N m/rad"\n{own}'
        )

    def drag(self, name: str, one: str, other: str, linear: float) -> None:
        """Add a drag."""
        self.lines.append(f'[[drag]]\nname = "{name}"\nbetween = ["{one}", "{other}"]\nlinear = "{linear:g} N m s/rad"')

    def harmonics(self, on: str, **amplitudes: float) -> None:
        """Add harmonic torques of orders 2, 4 and 6, or of others by ``o3``."""
        for k, (order, size) in enumerate(amplitudes.items()):
            self.lines.append(
                f'[[harmonic]]\nname = "{order}"\norder = {order[1:]}\namplitude = "{size:g} N m"\n'
                f'phase = "{0.7 * k:g} rad"\nacts_on = {{ {on} = 1.0 }}'
            )

    @property
    def text(self) -> str:
        """The model file."""
        return "\n".join(self.lines) + "\n"

    @property
    def system(self) -> System:
        """The train."""
        return gw.read_model(io.StringIO(self.text))


def gearbox(loose: int, friction: bool = True, impact: str = "", angle: str = "rad", stiff: float = 1.0) -> System:
    """A dual-mass flywheel, a clutch of two stages, an engaged gear and loose ones with drags, and a vehicle."""
    text = Text("900 rpm", "vehicle", 'flywheel = "18 N m"', friction)
    text.inertias(flywheel=0.15, secondary=0.05, input=0.004, output=0.008)
    text.inertias(**{f"loose{k}": 0.0036 / (1 + 0.6 * k) for k in range(loose)}, vehicle=3.0)
    text.shaft("dmf", "flywheel", "secondary", 700, 1.0, 5.0)
    text.shaft("clutch", "secondary", "input", 10, 0.08, 1.0)
    far = {"rad": ("0.085 rad", "0.06 rad"), "deg": ("4.87 deg", "3.44 deg")}[angle]
    text.stages(*far, 1400)
    scale = 1.0 if angle == "rad" else 180.0 / np.pi
    text.gear("engaged", "input", "output", 1.1, f"{0.0006 * scale:.6g} {angle}", 8e4 * stiff, impact)
    for k in range(loose):
        ratio = (3.4, 2.0, 1.35, 0.78, 0.66, 2.7)[k]
        text.gear(
            f"mesh{k}", "input", f"loose{k}", ratio, f"{(0.0009 - 5e-5 * k) * scale:.6g} {angle}", 8e4 * stiff, impact
        )
        text.drag(f"bearing{k}", f"loose{k}", "output", 0.007)
        text.drag(f"churn{k}", f"loose{k}", "ground", 0.03)
    text.shaft("half", "output", "vehicle", 430, 1.2)
    text.drag("final", "output", "ground", 0.005)
    text.harmonics("flywheel", o2=115, o4=35, o6=12)
    return text.system


def driveline(loose: int, cylinders: int) -> System:
    """A crankshaft with cylinders, a clutch, a gearbox, a final drive and two wheels."""
    text = Text("1500 rpm", "vehicle", ", ".join(f'cyl{k} = "9 N m"' for k in range(cylinders)))
    text.inertias(pulley=0.008, **{f"cyl{k}": 0.012 for k in range(cylinders)}, flywheel=0.09, secondary=0.05)
    text.inertias(hub=0.003, input=0.002, output=0.004, pinion=0.002, crown=0.03, left=0.9, right=0.9)
    text.inertias(**{f"loose{k}": 0.0012 * (1 + 0.3 * k) for k in range(loose)}, vehicle=80.0)
    text.shaft("snout", "pulley", "cyl0", 4e4, 2.0)
    for k in range(cylinders - 1):
        text.shaft(f"crank{k}", f"cyl{k}", f"cyl{k + 1}", 4e5, 4.0)
    text.shaft("web", f"cyl{cylinders - 1}", "flywheel", 5e5, 4.0)
    text.shaft("dmf", "flywheel", "secondary", 500, 1.0, 2.0)
    text.shaft("clutch", "secondary", "hub", 900, 0.4, 1.0)
    text.stages("0.08 rad", "0.05 rad", 2500)
    text.shaft("inshaft", "hub", "input", 2e4, 0.3, 0.2)
    for k in range(loose):
        ratio = (3.6, 2.0, 0.95, 0.75, 0.62, 3.3, 1.7)[k]
        text.gear(
            f"mesh{k}", "input", f"loose{k}", ratio, f"{0.08 + 0.01 * k:g} deg", 3e4, 'impact_damping = "0.2 s/rad"'
        )
        text.drag(f"bearing{k}", f"loose{k}", "output", 0.004)
        text.drag(f"churn{k}", f"loose{k}", "ground", 0.008)
    text.gear("third", "input", "output", 1.3, "0.06 deg", 6e4)
    text.shaft("outshaft", "output", "pinion", 3e4, 0.6)
    text.gear("final", "pinion", "crown", 3.9, "0.05 deg", 9e4)
    text.shaft("lshaft", "crown", "left", 7000, 4.0)
    text.shaft("rshaft", "crown", "right", 6000, 4.0)
    text.shaft("ltyre", "left", "vehicle", 2.5e4, 80.0)
    text.shaft("rtyre", "right", "vehicle", 2.5e4, 80.0)
    text.harmonics(f"cyl{cylinders // 2}", o2=150, o4=60, o6=25)
    return text.system


def geared_far() -> System:
    """A motor behind a gear of ratio 100, and two equal loose gears on equal drags."""
    text = Text("1200 rpm", "load", 'motor = "2 N m"')
    text.inertias(motor=0.002, input=0.0015, one=0.002, two=0.002, wheel=8.0, load=400.0)
    text.shaft("coupling", "motor", "input", 60, 0.02, 0.2)
    for name in ("one", "two"):
        text.gear(f"mesh_{name}", "input", name, 1.5, "0.002 rad", 2e4, 'impact_damping = "0.3 s/rad"')
        text.drag(f"churn_{name}", name, "ground", 0.004)
    text.gear("worm", "input", "wheel", 100.0, "0.0015 rad", 3e4)
    text.shaft("arm", "wheel", "load", 2e6, 800.0)
    text.harmonics("motor", o1=1.6, o2=2.0)
    return text.system


@cache
def trains() -> dict[str, tuple[System, tuple[float, float]]]:
    """The six trains, each with its range of speeds in rpm."""
    return {
        "six inertias, no friction": (gearbox(1, friction=False), (650.0, 1500.0)),
        "deg, stiff meshes": (gearbox(4, angle="deg", stiff=4.0), (650.0, 1400.0)),
        "linear damping in meshes": (gearbox(3, impact='damping = "0.05 N m s/rad"'), (650.0, 1400.0)),
        "ratio 100, two alike": (geared_far(), (500.0, 3000.0)),
        "twenty inertias": (driveline(5, 4), (900.0, 2500.0)),
        "twenty-five inertias": (driveline(7, 7), (900.0, 2500.0)),
    }


_NONE = 3.0  # expected closings of which there may be none by chance, with 95 % confidence
_FAR = 1.0  # margin from which a gap that did not part in chaos is said to be quiet
SELDOM, DIED = (
    "as stated: within the interval of how often it parts",
    "wrong, but stated: chaos that outlasts its watch",
)


class Different(NamedTuple):
    """A label that is not that of the longer run."""

    train: str
    value: float
    gap: str
    period: int
    told: float  #: Closings per period of the label, in so many periods.
    periods: int
    parted: float  #: Periods, of these, in which the gap parted.
    margin: float
    found: float  #: Closings per period in the longer run, in its last half.
    watched: int
    again: float  #: The same in a run of this length that begins at the end of the label's motion.
    last: int  #: Last period of that run in which the gap parted; -1 if none.
    later: float  #: From the same start, after four times as many periods again: a slow mode is over.

    @property
    def verdict(self) -> str:
        """What the difference is."""
        if (self.told > 0.0) == (self.later > 0.0):
            return "the longer run had not settled"
        if (self.told > 0.0) == (self.again > 0.0):
            return "another motion"
        if self.period:
            return "WRONG"
        low, high = proportion_interval(round(self.parted), self.periods)
        if self.told == 0.0:
            return SELDOM if self.margin <= _FAR and self.again <= high else "WRONG"
        if low <= _NONE / self.watched:
            return SELDOM
        # chaos may outlast the watch and then die out; by the end of the label's motion it has not
        return DIED if (self.last + 1) * low >= _NONE else "WRONG"


def proportion_interval(count: int, of: int) -> tuple[float, float]:
    """Return the interval of a share at 95 % (Clopper and Pearson 1934)."""
    found = binomtest(count, of).proportion_ci(method="exact")
    return float(found.low), float(found.high)


def closings_of(starts: list[tuple[System, np.ndarray]], periods: int) -> np.ndarray:
    """Return the closings of each contact with stages, by period and motion, by a quarter of the step."""
    coefficients = np.array([coefficients_of(system) for system, _ in starts])
    states = np.array([state for _, state in starts])
    kinds = ("up", "down", "drift", "side")
    lanes, found = Lanes(starts[0][0].structure, coefficients, states, kinds=kinds, finer=4.0), []
    for _ in range(periods):
        lanes.advance()
        found.append(lanes.note("up") + lanes.note("down"))
    return np.where(lanes.diverged[:, None], np.nan, np.array(found))


def longer(starts: list[tuple[System, np.ndarray]], periods: int, skip: int) -> np.ndarray:
    """Closings per period of each contact with stages after some periods, by a quarter of the step."""
    return closings_of(starts, periods)[skip:].mean(axis=0)


def compare(name: str, count: int, seed: int = 0, group: int = 8) -> tuple[int, list[Different]]:
    """Compare labels at some speeds, from rest and from random starts; return how many, and which differ."""
    system, (low, high) = trains()[name]
    random = np.random.default_rng(seed)
    unit = system.structure.pace
    starts = []
    for k, value in enumerate(np.sort(random.uniform(low, high, count)).tolist()):
        here = system.at({unit: value})
        state = state_at_rest(here)
        if k % 2:
            state = random_states(here, state, 1, seed, value)[0]
        starts.append(Start(k, value, here, state))
    found: dict[int, LaneMotion] = {start.key: motion for start, motion in settle_lanes(starts, width=2 * group)}
    gaps = usual_gaps(system)
    contacts = [form.name for form in system.structure.equations.contacts]
    staged = [form.name for form in system.structure.equations.contacts if form.stages]
    labels, different = 0, []
    order = sorted(found, key=lambda key: found[key].waited + found[key].watched)
    for first in range(0, len(order), group):
        own = [key for key in order[first : first + group] if not found[key].diverged]
        length = max(4 * max(found[key].waited + found[key].watched for key in own), 256)
        rates = longer([(starts[key].system, starts[key].state) for key in own], length, length // 2)
        wrong = []
        for key, row in zip(own, rates, strict=True):
            motion = found[key]
            for gap in gaps:
                labels += 1
                told, rate = motion.sides[contacts.index(gap)].sum(), row[staged.index(gap)]
                if (told > 0.0) != (rate > 0.0):
                    wrong.append((key, gap, float(told), float(rate)))
        if wrong:
            keys = sorted({key for key, *_ in wrong})
            again = closings_of([(starts[key].system, found[key].state) for key in keys], length)
            later = longer([(starts[key].system, starts[key].state) for key in keys], 5 * length, 4 * length)
            for key, gap, told, rate in wrong:
                motion, place, column = found[key], keys.index(key), staged.index(gap)
                own, contact = again[:, place, column], contacts.index(gap)
                told_in = motion.period, told, motion.watched, motion.parted[contact], motion.margin[contact]
                after = float(own[length // 4 :].mean()), int(np.flatnonzero([1.0, *own])[-1]) - 1
                found_in = rate, length - length // 2, *after, float(later[place, column])
                different.append(Different(name, starts[key].value, gap, *told_in, *found_in))
    return labels, different


def main(counts: dict[str, int], seed: int = 0) -> Iterator[str]:
    """Compare labels of all trains, and yield lines of a report."""
    total, every = 0, list[Different]()
    for name, count in counts.items():
        begun = time.process_time()
        labels, different = compare(name, count, seed)
        total, every = total + labels, [*every, *different]
        yield f"{name}: {labels} labels, {len(different)} differ ({time.process_time() - begun:.0f} s CPU)"
        yield from (f"  {each.verdict}: {each}" for each in different)
    outside, died = ([each.verdict for each in every].count(what) for what in ("WRONG", DIED))
    yield f"{total} labels: {outside + died} wrong, {outside} of them outside the stated confidence"


COUNTS = dict(zip(trains(), (120, 75, 90, 130, 50, 40), strict=True)) if __name__ == "__main__" else {}
if __name__ == "__main__":
    for line in main(
        {name: max(int(count * float((sys.argv[1:] or ["1"])[0])), 2) for name, count in COUNTS.items()},
        int((sys.argv[2:] or ["0"])[0]),
    ):
        print(line, flush=True)

"""The response of a gear train of ten degrees of freedom, with backlash and varying stiffness in two meshes."""

from __future__ import annotations

from itertools import pairwise, product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.effort import Effort
from benchmarks.row import Row, Target
from benchmarks.stages import Exit, Stage, integrate
from benchmarks.stopwatch import fastest, side_by_side
from gapwalk import Branch, System, WalkOptions, find_orbit, follow, read_study, verify
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model.coefficients import coefficients_of

GROUP = "Two-stage reducer of ten degrees of freedom (examples/reducer.toml)"
FILE = Path(__file__).resolve().parents[1] / "examples" / "reducer.toml"
_STEPS = WalkOptions(largest_step=0.1)
_POINTS = 7  # two folds, two Neimark-Sacker points, three grazing points
_AGREE = 1e-6


def rows(effort: Effort) -> list[Row]:
    """Measure all lines."""
    system = read_study(FILE).system.at(speed=12000.0)
    orbit = find_orbit(system)
    flow, coefficients, peer = flow_of(system), coefficients_of(system), ScipyReducer(system)
    works = [lambda: flow.integrate(coefficients, orbit.state), lambda: peer.period(orbit.state)]
    ends = works[0]().state, works[1]()
    difference = float(np.abs(ends[0] - ends[1]).max() / np.abs(orbit.state).max())
    if not difference < _AGREE:
        raise RuntimeError(f"gapwalk and SciPy differ by {difference:.3g}")
    state, baseline = side_by_side(works, effort)
    start, branches = find_orbit(system.at(speed=15000.0)), list[Branch]()

    def respond() -> None:
        branches[:] = [follow(start, "speed", to=10500.0, walk=_STEPS)]

    seconds = fastest(respond, effort)
    found = len(branches[0].special_points)
    counts = {"points": len(branches[0].points), "special points found": found}
    check = fastest(lambda: verify(branches[0]), effort)
    return [
        Row(GROUP, "one forcing period: state", state, baseline, "DOP853"),
        Row(
            GROUP,
            "15000 to 10500 rpm with special points",
            seconds,
            targets=(Target(_POINTS, "found"),),
            counts=counts,
            note=f"{counts['points']} points, {found} of {_POINTS} special points",
        ),
        Row(GROUP, "the same, verified as a whole by DOP853 and other means", seconds + check, targets=(Target(5.0),)),
    ]


class ScipyReducer:
    """The reducer for SciPy: linear equations for each side on which the teeth touch, and for each level of stiffness.

    Parameters
    ----------
    system
        A system with two contacts of one stage on both sides, each with a stiffness of two levels, and a mean load.
    """

    def __init__(self, system: System) -> None:
        n, plain = system.size, system.equations
        self.rate = 1.0 / system.frequency
        inverse = np.linalg.inv(plain.matrix("mass"))
        self.matrix = np.block(
            [
                [np.zeros((n, n)), np.eye(n)],
                [-inverse @ plain.matrix("stiffness"), -inverse @ plain.matrix("damping")],
            ]
        )
        self.mean = np.concatenate((np.zeros(n), inverse @ plain.vector("mean")))
        self.meshes, self.jumps = [], {0.0, PERIOD}
        for contact, load in zip(plain.structure.contacts, plain.structure.harmonics, strict=True):
            row, name = plain.vector(f"{contact.name}.deflection"), contact.name
            push = np.concatenate((np.zeros(n), inverse @ row))
            levels = load.levels(system.frequency, [plain[parameter] for parameter in load.parameters])
            self.meshes.append((row, push, plain[f"{name}.stiffness"], plain[f"{name}.clearance"], levels, load.order))
            for number in range(load.order):
                for angle in (levels.up, levels.down):
                    self.jumps.add(float((angle + number * PERIOD / load.order) % PERIOD))

    def period(self, state: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the state after one forcing period."""
        for begin, end in pairwise(sorted(self.jumps)):
            stiffness = [self._stiffness(mesh, 0.5 * (begin + end)) for mesh in self.meshes]
            depths = [self._side(mesh, state) for mesh in self.meshes]
            stages = [self._stage(sides, stiffness) for sides in _SIDES]
            state = integrate(stages, _SIDES.index(tuple(depths)), state, end - begin)
        return state

    def _stiffness(self, mesh, theta: float) -> float:
        _, _, stiffness, _, levels, order = mesh
        cycle = PERIOD / order
        is_high = (theta - levels.up) % cycle < levels.down - levels.up
        return stiffness * (1.0 + (levels.high if is_high else levels.low))

    def _side(self, mesh, state: NDArray[np.float64]) -> int:
        row, _, _, clearance, *_ = mesh
        deflection = row @ state[: len(row)]
        return int(np.sign(deflection)) if abs(deflection) > clearance else 0

    def _stage(self, sides: tuple[int, ...], stiffness: list[float]) -> Stage:
        """Return the equations while the teeth touch on some sides, and the events that end that."""
        matrix, constant, exits = self.matrix.copy(), self.mean.copy(), []
        for place, (side, size, mesh) in enumerate(zip(sides, stiffness, self.meshes, strict=True)):
            row, push, _, clearance, *_ = mesh
            if side:
                matrix[:, : len(row)] -= size * np.outer(push, row)
                constant += size * side * clearance * push
            for way in (1, -1) if side == 0 else (side,):
                leads_to = list(sides)
                leads_to[place] = way if side == 0 else 0

                def gap(_: float, y: NDArray[np.float64], row=row, level=way * clearance) -> float:
                    return row @ y[: len(row)] - level

                exits.append(Exit(gap, (way > 0) is (side == 0), _SIDES.index(tuple(leads_to))))
        matrix, constant = self.rate * matrix, self.rate * constant
        return Stage(lambda _, y: matrix @ y + constant, exits)


_SIDES: list[tuple[int, ...]] = [*product((0, 1, -1), repeat=2)]

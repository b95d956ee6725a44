"""Error of an orbit or a branch of a reduced system, with its special points, compared with the full system.

Both systems are solved by harmonic balance, with the contact deflections as unknowns. A point of the reduced system's
branch is corrected onto that of the full one, and a special point is located on both.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.special_point import Kind, SpecialPoint
from gapwalk.continuation.corrector import Corrector, powers_of_two, unknown_scales
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import ModelError, NumericalError
from gapwalk.flow.flow import PERIOD
from gapwalk.model.spring import Spring, springs_of
from gapwalk.model.static_force import static_forces_of
from gapwalk.model.system import System
from gapwalk.orbit.harmonic_balance import Balance
from gapwalk.orbit.harmonic_balance.linear_part import deflections_in
from gapwalk.orbit.orbit import Orbit, describe_switch
from gapwalk.orbit.orbit_equation import solve

if TYPE_CHECKING:
    from gapwalk.orbit.harmonic_balance.balance_equation import BalanceEquation
    from gapwalk.reduction.reduction import Reduction


# The linear part of a system in sparse matrices, with the vectors by which contacts and loads act on it.

_SPARSE = 0.1  # fraction of nonzero entries below which a matrix counts as sparse
_ROUNDING = 1e-10  # relative asymmetry of a matrix that counts as rounding


@dataclass(frozen=True, eq=False)
class Matrices:
    """The linear part of a system of n degrees of freedom."""

    #: mass, damping, stiffness: sparse, shape (n, n): M, C and K; M and K are symmetric.
    mass: Any
    damping: Any
    stiffness: Any
    #: shape (contacts, n): Deflection vectors e_k: each of a force by a formula of several deflections counts as a
    #: contact of its own.
    deflections: NDArray[np.float64]
    forces: NDArray[np.float64]  #: shape (n, contacts): Force vectors d_k.
    #: shape (n, loads): The constant load, and the shape of each harmonic, unless they are zero.
    loads: NDArray[np.float64]
    #: shape (contacts,): Stiffness of each contact with all stages of one side closed; of formulas at zero deflection.
    springs: NDArray[np.float64]

    @property
    def size(self) -> int:
        """Number n of degrees of freedom."""
        return self.deflections.shape[1]

    @cached_property
    def ports(self) -> NDArray[np.float64]:
        """All vectors by which contacts and loads act, shape (n, ports)."""
        return np.hstack((self.deflections.T, self.forces, self.loads))

    @cached_property
    def scale(self) -> float:
        """Largest ratio of stiffness to inertia of a coordinate: about the square of the highest frequency."""
        return float(np.abs(self.stiffness.diagonal() / self.mass.diagonal()).max())

    @cached_property
    def is_sparse(self) -> bool:
        """True if sparse factorisation is faster."""
        return max(self.mass.nnz, self.damping.nnz, self.stiffness.nnz) < _SPARSE * self.size**2

    def projected(self, basis: NDArray[np.float64]) -> Matrices:
        """Project the matrices on motions ``q = basis z``."""
        mass, damping, stiffness = (
            sp.csc_array(basis.T @ (each @ basis)) for each in (self.mass, self.damping, self.stiffness)
        )
        deflections, forces, loads = self.deflections @ basis, basis.T @ self.forces, basis.T @ self.loads
        return Matrices(mass, damping, stiffness, deflections, forces, loads, self.springs)


def matrices_of(system: System) -> Matrices:
    """Extract the linear part of a system."""
    n, structure, values = system.size, system.structure, system.values
    for which in ("mass", "stiffness"):
        matrix = system.matrix(which)
        if not np.allclose(matrix, matrix.T, rtol=0.0, atol=_ROUNDING * np.abs(matrix).max()):
            raise ModelError(
                f"the {which} matrix is not symmetric, but a modal reduction requires symmetry; write the equations "
                "of motion in Lagrange's form, or solve the system without reduction, with "
                "method=Balance()"
            )

    def vector(prefix: str) -> NDArray[np.float64]:
        return values[structure.block(prefix, n)]

    deflections, forces, springs = [], [], []
    for spring, force in zip(springs_of(system), static_forces_of(system), strict=True):
        stiffness = force.at(np.zeros(n)).stiffness if force.is_formula else [_stiffness(spring)]
        for deflection, slope in zip(force.deflections, stiffness, strict=True):
            deflections.append(deflection)
            forces.append(force.direction)
            springs.append(slope if np.isfinite(slope) else 0.0)
    shapes = [vector(load.shape) for load in structure.driving]
    loads = [load for load in (vector("mean"), *shapes) if load.any()]
    mass, damping, stiffness = (sp.csc_array(system.matrix(which)) for which in ("mass", "damping", "stiffness"))
    return Matrices(
        mass,
        damping,
        stiffness,
        np.array(deflections).reshape(-1, n),
        np.array(forces).reshape(-1, n).T,
        np.array(loads).reshape(-1, n).T,
        np.array(springs),
    )


def _stiffness(spring: Spring) -> float:
    """Return the stiffness of one contact with all stages of its stiffer side closed."""
    sides = {1: 0.0, -1: 0.0}
    for slope in spring.slopes:
        sides[slope.sign] += slope.stiffness
    return max(sides.values(), key=abs)


_POINTS = 12  # ordinary points of the branch that are checked as well
_MARGIN = 1.1  # factor on estimates in reports: the truncation of harmonics changes the difference slightly
_OTHER = 1.0  # change of a motion, relative to its size, above which it counts as another motion
_HARMONICS = 15
_CONTRACTION = 0.5  # largest ratio of the second of two Newton corrections to the first
_FIRST = 1e-5  # first step of the secant method, in arclength
_FARTHEST = 0.1  # distance in arclength above which a special point counts as another one
_SHARP = 1e-9  # last step of the secant method
_STEPS = 12
_ASIDE = 2e-3  # arclength from a branch point at which the Jacobian is regular

Test = Callable[[BranchPoint], float]


@dataclass(frozen=True)
class SpecialCheck:
    """The special point of the full system that corresponds to one of the reduced system."""

    special: SpecialPoint  #: The special point of the reduced system.
    shift: float  #: Correction to be added to its parameter value; nan if the full system has no such point nearby.
    error: float  #: Estimated error of its parameter value; inf if the full system has no such point nearby.
    motion: float  #: Difference of the two motions, as in `OrbitCheck.error`.

    @property
    def corrected(self) -> float:
        """The parameter value of the special point in the full system."""
        return self.special.value + self.shift

    def __repr__(self) -> str:
        what = f"{self.special.kind.value} at {self.special.value:.8g}"
        if not np.isfinite(self.error):
            return f"SpecialCheck({what}: not found nearby in the full system)"
        return f"SpecialCheck({what}, within {self.error:.1e} of that of the full system)"


@dataclass(frozen=True)
class BranchCheck:
    """The comparison of a branch of the reduced system with the full system's equation."""

    branch: Branch  #: The branch.
    special: tuple[SpecialCheck, ...]  #: Checks of its special points.
    #: Estimated errors of the motions at some points of the branch, as in `OrbitCheck.error`.
    motions: tuple[float, ...]
    harmonics: int  #: Number of harmonics of the check.

    @property
    def error(self) -> float:
        """Largest estimated error of the parameter value of a special point; 0 if there is none."""
        return max((each.error for each in self.special), default=0.0)

    @property
    def motion(self) -> float:
        """Largest estimated error of a motion."""
        return max((*self.motions, *(each.motion for each in self.special)), default=0.0)

    def __repr__(self) -> str:
        lost = sum(not np.isfinite(each.error) for each in self.special)
        found = [each.error for each in self.special if np.isfinite(each.error)]
        text = f"{len(found)} special points within {max(found, default=0.0):.1e}"
        if lost:
            text += f", {lost} not found nearby in the full system"
        return f"BranchCheck({text}; motions within {self.motion:.2g}, with {self.harmonics} harmonics)"


@dataclass(frozen=True)
class OrbitCheck:
    """The comparison of an orbit of the reduced system with the full system's equation."""

    orbit: Orbit  #: The orbit.
    #: Estimated error of the deflections of the contacts: the largest sum of the errors of the amplitudes of all
    #: harmonics, relative to the largest sum of amplitudes. inf if the full system has no such motion nearby.
    error: float
    harmonics: int  #: Number of harmonics of the check.

    def __repr__(self) -> str:
        return f"OrbitCheck(deflections within {self.error:.2g} of the full system's, with {self.harmonics} harmonics)"


def check_branch(reduction: Reduction, branch: Branch, method: Balance | None = None) -> BranchCheck:
    """Check a branch; see `Reduction.check`."""
    if not isinstance(branch, Branch):
        raise ModelError(f"{branch!r} cannot be checked; give an orbit or a branch of reduction.system")
    first = branch.points[0].orbit
    pair = Pair(reduction, first.system, branch.parameter, branch.period, method_for(first, method))
    width = float(np.ptp(branch.values)) or abs(branch.values[0]) or 1.0
    paired = PairedBranch(pair, first, width)
    _ = paired.offset  # raises an error if the system is not the reduced one
    chosen = np.unique(np.linspace(0, len(branch.points) - 1, _POINTS).astype(int))
    motions = tuple(_motion(paired, branch.points[place]) for place in chosen.tolist())
    special = tuple(_special(paired, each) for each in branch.special_points)
    return BranchCheck(branch, special, motions, pair.full.harmonics)


def _motion(paired: PairedBranch, point: BranchPoint) -> float:
    """Return the error of the motion at one point."""
    start = paired.start(point.orbit, point)
    image = None if start is None else paired.image(start)
    if start is None or image is None:
        return float("inf")
    return _MARGIN * paired.change(start, image)


def _special(paired: PairedBranch, special: SpecialPoint) -> SpecialCheck:
    lost = SpecialCheck(special, float("nan"), float("inf"), float("inf"))
    start = paired.start(special.orbit, special.point)
    test = None if start is None else test_of(special, start)
    if start is None or test is None:
        return lost
    ours = find_special(paired.reduced, start.x, start.tangent, test, special.kind)
    if ours is None:
        return lost
    theirs = find_special(paired.full, paired.shifted(ours[0].x), start.tangent, test, special.kind)
    if theirs is None:
        return lost
    shift = theirs[0].value - paired.offset - ours[0].value
    motion = _MARGIN * paired.change(ours[0], theirs[0])
    if motion > _OTHER:
        return lost
    # Both are located again, and the truncation is common to both, so the error of the point itself does not enter.
    rest = (_ROUNDING + ours[1] + theirs[1]) * float(paired.scales[-1])
    return SpecialCheck(special, shift, _MARGIN * abs(shift) + rest, motion)


def check_orbit(reduction: Reduction, orbit: Orbit, method: Balance | None = None) -> OrbitCheck:
    """Check an orbit; see `Reduction.check`."""
    pair = Pair(reduction, orbit.system, None, orbit.period, method_for(orbit, method))
    full = pair.full  # raises an error if the system is not the reduced one
    unknowns, _ = solve(pair.reduced, pair.reduced.unknowns(orbit), 0.0)
    try:
        error = pair.correct(unknowns).change
    except (NumericalError, np.linalg.LinAlgError):
        error = float("inf")
    return OrbitCheck(orbit, error, full.harmonics)


class Correction(NamedTuple):
    """The result of two steps of Newton's method on the full system's equation from a motion of the reduced one."""

    unknowns: NDArray[np.float64]  #: shape (N,): The motion after the steps.
    #: float: Bound on the distance of the full system's motion, relative to the size of the motion; inf if the steps do
    #: not converge, because then nothing is known.
    change: float


@dataclass(frozen=True)
class Pair:
    """The equations of both systems.

    In harmonic balance all coordinates except the deflections of the contacts are eliminated, exactly, so equations of
    systems of different size have the same unknowns. Their difference at a motion is the effect of the reduction alone,
    because the truncation of harmonics is common to both.
    """

    reduction: Reduction  #: The reduction.
    system: System  #: The reduced system, at its parameter values.
    parameter: str | None  #: Name of the parameter that varies, or None.
    period: int  #: Period m in forcing periods.
    method: Balance  #: Options of the harmonic balance.

    @cached_property
    def reduced(self) -> BalanceEquation:
        """The equation of the reduced system."""
        return self.method.pose(self.system, self.parameter, self.period)

    @cached_property
    def full(self) -> BalanceEquation:
        """The equation of the full system."""
        return self.method.pose(self.reduction.full_at(self.system), self.parameter, self.period)

    def correct(self, unknowns: NDArray[np.float64], value: float = 0.0) -> Correction:
        """Correct a motion of the reduced system towards that of the full one."""
        # By Newton and Kantorovich: after corrections of lengths a and theta a, with ``theta < 1/2``, the solution is
        # within ``a / (1 - theta)``.
        size = self.size(unknowns)
        lengths: list[float] = []
        for _ in range(2):
            evaluation = self.full.evaluate(unknowns, value)
            step = np.asarray(
                np.linalg.lstsq(evaluation.by_unknowns, -evaluation.residual, rcond=1e-14)[0], dtype=float
            )
            unknowns = unknowns + step
            lengths.append(self.size(step, mean=True))
        first, second = lengths
        if first == 0.0:
            return Correction(unknowns, 0.0)
        theta = second / first
        return Correction(unknowns, first / (1.0 - theta) / size if theta < _CONTRACTION else np.inf)

    def size(self, unknowns: NDArray[np.float64], *, mean: bool = False) -> float:
        """Return the largest sum of amplitudes of a deflection, with its mean or without."""
        from gapwalk.orbit.harmonic_balance.kernels import (
            from_real_form,  # imported late: it loads numba, which takes long
        )

        lines = np.abs(from_real_form(unknowns.reshape(deflections_in(self.system.structure), -1)))
        return float(lines[:, 0 if mean else 1 :].sum(axis=1).max())


@dataclass(frozen=True)
class PairedBranch:
    """The equations of a reduced and of the full system along one parameter, in the same scaled variables."""

    pair: Pair  #: The equations.
    orbit: Orbit  #: An orbit of the reduced system, whose size gives the scales.
    width: float  #: Range of the parameter that is scaled to one.

    @cached_property
    def offset(self) -> float:
        """Parameter of the full system minus that of the reduced one; matrix entries include static contributions."""
        name = self.pair.parameter or ""
        return self.pair.full.system[name] - self.pair.system[name]

    @cached_property
    def scales(self) -> NDArray[np.float64]:
        """Scales of the unknowns and of the parameter."""
        return powers_of_two(np.append(unknown_scales(self.pair.reduced, self.orbit), self.width))

    @cached_property
    def reduced(self) -> Corrector:
        """Corrector onto the branch of the reduced system."""
        return Corrector(self.pair.reduced, self.scales, iterations=15)

    @cached_property
    def full(self) -> Corrector:
        """Corrector onto the branch of the full system."""
        return Corrector(self.pair.full, self.scales, iterations=15)

    def start(self, orbit: Orbit, along: BranchPoint) -> BranchPoint | None:
        """Convert an orbit to a point of the reduced system's branch in harmonic balance; None if that fails."""
        equation = self.pair.reduced
        x = np.append(equation.unknowns(orbit), along.value) / self.scales
        border = np.zeros(len(x))
        border[-1] = np.sign(along.tangent[-1]) or 1.0
        try:
            tangent, _ = self.reduced.tangent(equation.evaluate(x[:-1] * self.scales[:-1], along.value), border)
        except NumericalError:
            return None
        return self.reduced.point_near(x, tangent)

    def image(self, point: BranchPoint) -> BranchPoint | None:
        """Correct a point of the reduced system's branch onto that of the full system; None if that fails."""
        return self.full.point_near(self.shifted(point.x), point.tangent)

    def shifted(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Convert a point of the reduced system's branch to the full system's value of the parameter."""
        moved = x.copy()
        moved[-1] += self.offset / self.scales[-1]
        return moved

    def change(self, one: BranchPoint, other: BranchPoint) -> float:
        """Return the difference of two motions, relative to the size of the first."""
        u, v = (point.x[:-1] * self.scales[:-1] for point in (one, other))
        return self.pair.size(v - u, mean=True) / self.pair.size(u)


def method_for(orbit: Orbit, method: Balance | None) -> Balance:
    """Return the harmonic balance for an orbit: the given one, or with as many harmonics as the orbit has."""
    if method is not None and not isinstance(method, Balance):
        raise ModelError(f"method is {method!r}; it must be a Balance, as in Balance(harmonics=20)")
    if method is None:
        return Balance(max(_HARMONICS, orbit.harmonics), error=1.0)
    return Balance(method.harmonics or _HARMONICS, error=1.0, stability=method.stability, tolerance=method.tolerance)


def find_special(corrector: Corrector, x: NDArray[np.float64], normal: NDArray[np.float64], test: Test, kind: Kind):
    """Find the zero of a test function on a branch near x, and the last step in arclength; None if there is none."""
    # The secant method is used along the normal. Near a branch point a plane does not intersect the branch uniquely, so
    # the zero is interpolated between points on both sides.

    def at(s: float) -> tuple[BranchPoint, float]:
        point = corrector.point_near(x + s * normal, normal)
        if point is None:
            raise NumericalError("the branch was lost")
        return point, test(point)

    try:
        if kind is Kind.BRANCH_POINT:
            return _between(at)
        return _secant(at)
    except NumericalError:
        return None


def _between(at: Callable[[float], tuple[BranchPoint, float]]) -> tuple[BranchPoint, float] | None:
    (one, low), (other, high) = at(-_ASIDE), at(_ASIDE)
    share = low / (low - high) if low != high else np.inf
    if not abs(2.0 * share - 1.0) * _ASIDE < _FARTHEST:
        return None
    x = one.x + share * (other.x - one.x)
    return BranchPoint(one.value + share * (other.value - one.value), one.orbit, x, one.tangent, 0.0, 0.0), 0.0


def _secant(at: Callable[[float], tuple[BranchPoint, float]]) -> tuple[BranchPoint, float] | None:
    before, now = 0.0, _FIRST
    (point, old), (_, new) = at(before), at(now)
    for _ in range(_STEPS):
        if new == old:
            return None
        step = -new * (now - before) / (new - old)
        before, old, now = now, new, now + step
        if abs(now) > _FARTHEST:
            return None
        point, new = at(now)
        if abs(step) < _SHARP:
            return point, abs(step)
    return None


def test_of(special: SpecialPoint, point: BranchPoint) -> Test | None:
    """Return the test function of a special point for points of either branch; None if it has none."""
    kind = special.kind
    if kind.has_function:
        return kind.at
    switches = [k for k in range(len(point.orbit.closings)) if describe_switch(point.orbit, k) == special.contact]
    if not switches:
        return None
    switch, full = switches[0], PERIOD * point.orbit.period
    thetas, depths = point.orbit.turning_depths[switch]
    if not thetas:
        return None
    near = [thetas[int(np.argmin(np.abs(depths)))]]

    def depth(other: BranchPoint) -> float:
        turns = other.orbit.turning_depths[switch]
        if not turns.thetas:
            raise NumericalError("the extremum was lost")
        return turns.values[turns.nearest(near[0], full)]

    return depth

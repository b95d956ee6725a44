"""Gradient of a special point: how far each parameter of the system moves it.

Along its locus in the plane of the followed parameter and another one, the equations of the special point stay zero.
The implicit function theorem on these equations gives the slope of the locus at its start, for any number of other
parameters at the cost of their sensitivities.

Method: docs/numerics/notes/special-points.md
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.loci.follow_locus import equation_of, plane_of
from gapwalk.bifurcation.loci.locus_equations import (
    GrazingEquation,
    LocusEquation,
    MultiplierEquation,
    OrbitPlane,
    Place,
    ShotPlane,
)
from gapwalk.bifurcation.special_point import Kind, SpecialPoint
from gapwalk.continuation.corrector import powers_of_two
from gapwalk.errors import ConvergenceError, ModelError, NumericalError
from gapwalk.model.system import System
from gapwalk.model.words import parameter_symbol
from gapwalk.notebook import Shown
from gapwalk.orbit.method import Method
from gapwalk.summary import SummaryParts, Table, Tables, remarks, rows_of, summarizes

_STEPS = (3e-5, 3e-6, 3e-7)  # of central differences of the monodromy matrix, in scaled variables
_FIRST = 4  # parameters that a line of text names
_BATCH = 4  # parameters whose sensitivities are integrated together
_OUTSIDE = 1e-3  # depth of a touch where its slopes are taken, relative to that on a locus
_WIDE = 64  # the same where the transition matrix is not integrated with them
_MANY = 400  # names above which only those of single numbers, not of vectors and matrices, are taken by default
_ASIDE = 1e-5  # scaled distance from the special point at which its equations must be solved
_ROUNDING, _TOUCHED = 1e-12, 1e-7  # relative errors of a slope from first derivatives; of a touch
_NOTHING = 1e-10  # share of the largest effect below which one is rounding: such as a frequency at an extremum over it
_FAINT = 1e-4  # error of a slope, relative to the largest one in percent per percent, above which it is reported


@dataclass(frozen=True, eq=False, repr=False)
class Gradient(Shown):
    """Derivatives of the parameter value of a special point with respect to other parameters."""

    special: SpecialPoint  #: The special point.
    names: tuple[str, ...]  #: The other parameters.
    #: shape (k,): Derivative of ``special.value`` with respect to each parameter, in the units of the model. It is the
    #: slope of the point's locus.
    slopes: NDArray[np.float64]
    errors: NDArray[np.float64]  #: shape (k,): Estimated error of each slope.

    def __getitem__(self, name: str) -> float:
        """Return the slope by one parameter."""
        if name not in self.names:
            raise ModelError(f"the gradient has no {name!r}; it has {', '.join(self.names)}")
        return float(self.slopes[self.names.index(name)])

    @property
    def values(self) -> NDArray[np.float64]:
        """Values of the parameters at the special point, shape (k,)."""
        return np.array([self.special.orbit.system[name] for name in self.names])

    @property
    def elasticities(self) -> NDArray[np.float64]:
        """Change of the special point in percent for one percent more of each parameter, shape (k,)."""
        return self.slopes * self.values / self.special.value

    @property
    def order(self) -> list[int]:
        """Indices of the parameters, from the one that moves the point most, in percent per percent, to the least."""
        return np.argsort(-np.abs(self.elasticities), kind="stable").tolist()

    @summarizes
    def summary(self) -> SummaryParts:
        """Return a table of the parameters, those that move the point most first."""
        special, units = self.special, self.special.orbit.system.units
        symbol = parameter_symbol(special.parameter, units)
        yield f"{special.kind} at {special.parameter} = {special.value:.10g}: what moves it most"
        values, shares = self.values, self.elasticities
        rows = [
            [
                parameter_symbol(self.names[k], units),
                f"{values[k]:.6g}",
                f"{self.slopes[k]:+.6g}",
                f"{self.errors[k]:.0e}",
                f"{shares[k]:+.4f}",
            ]
            for k in self.order
        ]
        yield Table(("parameter", ">value", f">slope of {symbol}", ">±", ">% per %"), rows)
        doubts = np.abs(self.errors * values / special.value)
        if faint := [self.names[k] for k in self.order if doubts[k] > _FAINT * float(np.abs(shares).max())]:
            yield f"note: not accurate to four digits: {', '.join(faint)}; a contact grazes near the point"

    def tables(self) -> Tables:
        """Return the table of slopes, one row for each parameter."""
        return {"gradient": lambda: rows_of(self.rows)}

    @property
    def rows(self) -> list[dict[str, object]]:
        """Row of numbers for each parameter."""
        return [
            {
                "kind": self.special.kind.value,
                self.special.parameter: self.special.value,
                "parameter": name,
                "value": float(value),
                "slope": float(slope),
                "error": float(error),
                "percent.per.percent": float(share),
            }
            for name, value, slope, error, share in zip(
                self.names, self.values, self.slopes, self.errors, self.elasticities, strict=True
            )
        ]

    def words(self, count: int) -> str:
        """Return the parameters that move the point most, with their percent per percent, as text."""
        shares = dict(zip(self.names, self.elasticities.tolist(), strict=True))
        least = _NOTHING * float(np.nanmax(np.abs(self.elasticities), initial=0.0))
        found = main_movers(self.special.orbit.system, shares)[:count]
        return ", ".join(f"{name} {share:+.3g}" for name, share in found if abs(share) > least)

    def __repr__(self) -> str:
        most = self.words(_FIRST)
        return f"Gradient({self.special.kind} at {self.special.value:.10g}, % per %: {most})"


def main_movers(system: System, shares: Mapping[str, float]) -> list[tuple[str, float]]:
    """Return parameters with their percent per percent, the largest first; the orders of one torque are one of them."""
    # Where a load acts on one coordinate, ``harmonic1.acts_on.x`` multiplies ``harmonic1.amplitude``.
    left, together, every = dict(shares), dict[tuple[str, ...], list[str]](), system.structure.names
    for load in system.structure.driving if len(every) <= _MANY else ():
        factors = [name for name in every if name.startswith(f"{load.shape}.") and system[name]]
        if len(factors) == 1:
            left.pop(factors[0], None)
        targets = tuple(name.removeprefix(f"{load.shape}.") for name in factors)
        sizes = [name for name in (f"{load.name}.amplitude", f"{load.name}.scale") if name in left]
        together.setdefault(targets, []).extend(sizes)
    for targets, names in together.items():
        if targets and len(names) > 1:
            what = f"{'torque' if system.units else 'load'} on {', '.join(targets)}"
            left[what] = sum(left.pop(name) for name in names)
    return sorted(left.items(), key=lambda each: -abs(each[1]))


@dataclass(frozen=True, eq=False, repr=False)
class Gradients(Shown):
    """Gradients of some special points."""

    found: tuple[Gradient, ...]  #: Gradients in the order of the points.
    failures: tuple[str, ...] = ()  #: Sentences on the points that have none.

    @summarizes
    def summary(self) -> SummaryParts:
        """Return a table of the points, with the parameters that move each most."""
        if self.found:
            special = self.found[0].special
            symbol = parameter_symbol(special.parameter, special.orbit.system.units)
            rows = [[each.special.kind.value, f"{each.special.value:#.8g}", each.words(_FIRST)] for each in self.found]
            yield Table(("kind", f">{symbol}", "what moves it most, in percent for one percent more"), rows)
        yield from remarks((), self.failures)

    def tables(self) -> Tables:
        """Return the table of slopes, one row for each point and parameter."""
        return {"gradients": lambda: rows_of(row for each in self.found for row in each.rows)}

    def __repr__(self) -> str:
        return f"Gradients({len(self.found)} points)"


def gradients(points: Iterable[SpecialPoint], names: Sequence[str] = (), method: Method | None = None) -> Gradients:
    """Compute the derivatives of the values of special points by other parameters.

    Parameters
    ----------
    points
        The special points, such as those of a branch.
    names, method
        As in `SpecialPoint.gradient`.

    Returns
    -------
    gradients : Gradients
        A gradient for each point that has one; ``failures`` say why other points have none.

    Raises
    ------
    ModelError
        For an unknown parameter.

    Examples
    --------
    >>> found = gw.analysis.gradients(branch.special("fold"), ["stop.clearance"])
    >>> [round(each["stop.clearance"], 6) for each in found.found]
    [-0.20789, -0.2092]
    """
    found, failures = [], []
    for special in points:
        for name in names:
            special.orbit.system.structure.place(name)
        try:
            found.append(gradient(special, names, method))
        except (ModelError, NumericalError) as error:
            failures.append(f"{special.kind} at {special.value:.8g} has no gradient: {error}")
    return Gradients(tuple(found), tuple(failures))


def gradient(special: SpecialPoint, names: Sequence[str] = (), method: Method | None = None) -> Gradient:
    """Compute the derivatives of the parameter value of a special point by other parameters."""
    if special.kind.no_locus:
        raise ModelError(f"{special.kind.no_locus}: it has no gradient")
    orbit, parameter = special.orbit, special.parameter
    if not parameter:
        raise ModelError("the point does not name the parameter along which it was found; walk the branch again")
    system = orbit.system
    usual = moving_names(system, parameter)
    names = tuple(names) or usual
    for name in names:
        if system.structure.place(name) == system.structure.place(parameter):
            raise ModelError(f"{name} is the parameter of the branch itself; name other parameters")
    way = (method or orbit.method()).for_loci()
    alike = tuple(dict.fromkeys((*usual, *names)))  # one compiled flow serves all usual requests
    slopes, errors = np.zeros(len(names)), np.zeros(len(names))
    plane = plane_of(way, orbit, (parameter, names[0]))
    if special.kind is Kind.GRAZING and isinstance(plane, ShotPlane):
        slopes = _touch_slopes(replace(plane, names=(parameter,)), special, names)
        return Gradient(special, names, slopes, _TOUCHED * np.abs(slopes))
    for end in range(_BATCH, len(names) + _BATCH, _BATCH):
        batch = slice(max(0, min(end, len(names)) - _BATCH), end)  # the last one reaches back, to be of equal size
        plane = replace(plane, names=(parameter, *names[batch]))
        if isinstance(plane, ShotPlane):
            plane = replace(plane, alike=alike)
        slopes[batch], errors[batch] = _slopes(plane, special)
    return Gradient(special, names, slopes, errors)


def shifts(special: SpecialPoint, names: Sequence[str]) -> NDArray[np.float64]:
    """Return the derivatives of all unknowns of a special point, its parameter value last, by other parameters."""
    # They predict the point in a system near by: shape (unknowns, parameters), the unknowns as in
    # `gapwalk.bifurcation.loci.follow_locus.equation_of`. Those of a condition on multipliers come from forward
    # differences and have about six digits; `gradient` is more accurate. Errors are those of `gradient`.
    orbit, parameter = special.orbit, special.parameter
    found = []
    for first in range(0, len(names), _BATCH):
        batch = tuple(names[first : first + _BATCH])
        plane = plane_of(orbit.method().for_loci(), orbit, (parameter, batch[0]))
        plane = replace(plane, names=(parameter, *batch))
        if isinstance(plane, ShotPlane):
            plane = replace(plane, alike=tuple(dict.fromkeys((*moving_names(orbit.system, parameter), *names))))
        widths = [abs(orbit.system[name]) or 1.0 for name in plane.names]
        equation, unknowns, scales = equation_of(plane, special, widths)
        found.append(_solved(equation, unknowns, scales, plane.names))
    return np.hstack(found)


def wide_planes(plane: OrbitPlane, names: Sequence[str]) -> tuple[OrbitPlane, ...]:
    """Return planes in which `shifts_at` takes derivatives by other parameters, some in each."""
    parameter, found = plane.names[0], []
    for first in range(0, len(names), _BATCH):
        wide = replace(plane, names=(parameter, *names[first : first + _BATCH]))
        if isinstance(wide, ShotPlane):
            wide = replace(wide, alike=tuple(dict.fromkeys((*moving_names(plane.system, parameter), *names))))
        found.append(wide)
    return tuple(found)


def shifts_at(
    equation: LocusEquation, unknowns: NDArray[np.float64], scales: NDArray[np.float64], planes: Iterable[OrbitPlane]
) -> NDArray[np.float64]:
    """Return the derivatives of all unknowns at a solution of the equation of a special point, by other parameters."""
    if isinstance(equation, MultiplierEquation) and not equation.kind.is_turning:
        equation = replace(equation, step=_STEPS[1])
    found = []
    for plane in planes:
        widths = np.array([abs(plane.system[name]) or 1.0 for name in plane.names[1:]])
        every = np.append(scales[: len(unknowns)], powers_of_two(widths))
        found.append(_solved(equation.on(plane, every), unknowns, every, plane.names))
    return np.hstack(found)


def moving_names(system: System, parameter: str) -> tuple[str, ...]:
    """Return the names of the parameters that are not zero, without the one that is followed."""
    structure = system.structure
    own, every = structure.place(parameter), structure.names
    places = range(len(every)) if len(every) <= _MANY else every.single
    values = system.values
    return tuple(every[place] for place in places if place != own and values[place] != 0.0)


def _touch_slopes(plane: ShotPlane, special: SpecialPoint, names: Sequence[str]) -> NDArray[np.float64]:
    """Return the slopes of a grazing point by parameters, in the plane of its own parameter."""
    equation, unknowns, scales = equation_of(plane, special, [abs(special.value) or 1.0])
    assert isinstance(equation, GrazingEquation)
    scales = scales[: len(unknowns)]
    # on the side without the event: where the touch is one, its angles and all derivatives have half the digits
    equation = replace(equation, depth=_OUTSIDE * equation.depth)
    found = equation.linearised(unknowns)
    unknowns = unknowns + _solved_of((found[0], np.column_stack((found[1], found[0])), found[2]), scales)[:, -1]
    residual, by_all, place = equation.linearised(unknowns)
    batches = [names[first : first + _WIDE] for first in range(0, len(names), _WIDE)]
    moved = [plane.by_parameters(equation.switch, place, float(unknowns[-2]), batch) for batch in batches]
    return _solved_of((residual, np.hstack((by_all, *moved)), place), scales)[-1]


def _slopes(plane, special: SpecialPoint) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the slopes by the parameters of a plane after the first, and their errors."""
    system = special.orbit.system
    widths = [abs(system[name]) or 1.0 for name in plane.names]
    equation, unknowns, scales = equation_of(plane, special, widths)
    if not isinstance(equation, MultiplierEquation) or special.kind.is_turning:
        # first derivatives suffice; at a fold those of the multiplier are multiplied by zero
        found = _solved(equation, unknowns, scales, plane.names)[-1]
        return found, _ROUNDING * np.abs(found)
    place = equation.place(unknowns, *(system[name] for name in plane.names[1:]))
    found = [replace(equation, step=step).linearised_at(place) for step in _STEPS]
    tried = [_solved_of(each, scales[: len(unknowns)])[-1] for each in found]
    changes = [np.abs(b - a) for a, b in pairwise(tried)]
    best = int(np.argmin([float(np.max(change)) for change in changes]))
    return tried[best + 1], changes[best]


def _solved(
    equation: LocusEquation, unknowns: NDArray[np.float64], scales: NDArray[np.float64], names: Sequence[str]
) -> NDArray[np.float64]:
    """Return the derivatives of all unknowns by the parameters after the first."""
    others = (equation.system[name] for name in names[1:])
    return _solved_of(equation.linearised(unknowns, *others), scales[: len(unknowns)])


def _solved_of(
    linearised: tuple[NDArray[np.float64], NDArray[np.float64], Place], scales: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the same from the linearised equations; `scales` are those of the unknowns."""
    residual, by_all, _ = linearised
    size = len(scales)
    own = by_all[:, :size] * scales
    try:
        solved = np.linalg.solve(own, -np.column_stack((residual, by_all[:, size:])))
    except np.linalg.LinAlgError:
        raise ConvergenceError("the locus of the point is vertical: it has no slopes") from None
    if float(np.abs(solved[:, 0]).max()) > _ASIDE:
        raise ConvergenceError(
            f"the orbit is not at the special point: a Newton step of {np.abs(solved[:, 0]).max():.1g} is left"
        )
    return solved[:, 1:] * scales[:, None]

"""Sensitivity of an orbit to parameters: exact derivatives of its state, and of its motion over the period.

The implicit function theorem on the shooting equation ``Phi(x; p) - x = 0`` gives ``(Phi_x - I) dx/dp = -Phi_p``. A
later state of the orbit changes by ``Phi_x(theta) dx/dp + Phi_p(theta)``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError, NumericalError
from gapwalk.flow.flow import PERIOD, Flow, flow_of
from gapwalk.flow.motion import Motion, sample
from gapwalk.flow.signal import Signal
from gapwalk.model.coefficients import ParameterLine, coefficients_of, layout_of
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.sticking import released, transition_of

_SINGULAR = 1e-11  # smallest relative singular value of ``Phi_x - I`` of an orbit that has derivatives


class SignalSlopes(NamedTuple):
    """Signal at some angles of an orbit, and its derivatives."""

    values: NDArray[np.float64]  #: shape (samples,): The signal.
    #: shape (samples, k): Its derivatives with respect to the parameters, at the same angles.
    by_parameters: NDArray[np.float64]
    by_angle: NDArray[np.float64]  #: shape (samples,): Its derivative with respect to the angle.
    #: shape (k,): Rms of the two parts of each derivative before they are added: the contribution of the state and that
    #: of the parameter itself. If they cancel, the remainder is rounding.
    sizes: NDArray[np.float64]


@dataclass(frozen=True)
class Sensitivity:
    """Derivatives of one orbit with respect to some named parameters."""

    #: orbit, names: The orbit and the parameters.
    orbit: Orbit
    names: tuple[str, ...]

    @cached_property
    def state(self) -> NDArray[np.float64]:
        """Derivative of the orbit's state at theta = 0, shape (state_size, k)."""
        length = PERIOD * self.orbit.period
        arc = self._flow.integrate(self._coefficients, self.orbit.state, 0.0, length, self.slopes)
        size = len(self.orbit.state)
        (arc,) = released(layout_of(self.orbit.system.structure), self._coefficients, [arc], self.orbit.state)
        matrix = transition_of(arc) - np.eye(size)
        singular = np.linalg.svd(matrix, compute_uv=False)
        if singular[-1] <= _SINGULAR * singular[0]:
            raise NumericalError("the orbit lies on a fold or a branch point, where it has no derivative by parameters")
        by_parameters = np.zeros((size, 0)) if arc.sensitivity is None else arc.sensitivity.reshape(size, -1)
        return np.linalg.solve(matrix, -by_parameters).astype(float, copy=False)

    @cached_property
    def slopes(self) -> NDArray[np.float64]:
        """Derivative of the flow's coefficients, shape (k, coefficients)."""
        system = self.orbit.system
        lines = [ParameterLine(system, name).coefficients(system[name])[1] for name in self.names]
        return np.array(lines).reshape(len(self.names), len(self._coefficients))

    def signal(self, signal: Signal, theta: NDArray[np.float64]) -> SignalSlopes:
        """Return a signal at any angles, with its derivatives by the parameters and by the angle."""
        grid, back = _grid(self.orbit, theta)
        system = self.orbit.system
        found = self._flow.vary(self._coefficients, self.orbit.state, grid, self.slopes)
        motion = Motion.of(system, grid, found.states, *found.logs)
        states = found.transitions @ self.state + found.sensitivities
        by_parameters, sizes = np.zeros((len(grid), len(self.names))), np.zeros(len(self.names))
        for k, direction in enumerate(self.slopes):
            through_state = signal.slope(motion, states[:, :, k])
            by_parameters[:, k] = signal.slope(motion, states[:, :, k], direction)
            sizes[k] = np.sqrt(np.mean(through_state**2) + np.mean((by_parameters[:, k] - through_state) ** 2))
        by_angle = signal.slope(motion, motion.rates / system.frequency, theta=1.0)
        return SignalSlopes(signal.of(motion)[back], by_parameters[back], by_angle[back], sizes)

    @cached_property
    def _coefficients(self) -> NDArray[np.float64]:
        return coefficients_of(self.orbit.system)

    @cached_property
    def _flow(self) -> Flow:
        return flow_of(self.orbit.system, *self.names, transition=True)


def sensitivity(orbit: Orbit, names: Sequence[str]) -> Sensitivity:
    """Return the sensitivity of an orbit to named parameters; raise a ModelError for an unknown name."""
    for name in names:
        orbit.system.structure.place(name)
    if orbit.own_method is not None:
        raise ModelError("this motion has no excitation, and its frequency is an unknown: it has no gradients here")
    if len(orbit.restarts):
        raise NumericalError(
            f"small changes of this motion grow by {abs(complex(orbit.multipliers[0])):.3g} in a period, too much for "
            "its gradients: take them of a motion that is less unstable"
        )
    return Sensitivity(orbit, tuple(names))


def signal_along(orbit: Orbit, signal: Signal, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the values of a signal of an orbit at any angles, exact at each; shape (samples,)."""
    grid, back = _grid(orbit, theta)
    return signal.of(sample(orbit.system, orbit.state, grid, orbit.known_states))[back]


def _grid(orbit: Orbit, theta: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Return increasing angles from 0 within one period that include the given ones, and the indices of these."""
    grid, back = np.unique(np.concatenate(([0.0], theta % (PERIOD * orbit.period))), return_inverse=True)
    return grid, back[1:]

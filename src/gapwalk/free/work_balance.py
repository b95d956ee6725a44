"""Work of losses and of a load over a free vibration: the load at which the two balance.

A lightly damped motion under a small load stays near a free vibration. Over a period the load puts in what the losses
take: with the load in phase with the rate (phase resonance) the smallest amplitude suffices (Peter and Leine 2017,
Mech. Syst. Signal Process. 96, 139-158; Hill, Cammarano, Neild and Barton 2016, Proc. R. Soc. A 473, 20160494;
Cenedese and Haller 2020, Proc. R. Soc. A 476, 20200078, from Melnikov's method). Where the equations do not show their
energy, its gradient is replaced by the left eigenvector of the monodromy matrix at the multiplier 1, carried along.

Method: docs/numerics/backbones.md
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.flow.forces import accelerations
from gapwalk.free.backbone_record import Backbone, BackbonePoint
from gapwalk.free.conservative import shows_energy
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.system import System

_SAMPLES = 512  # of a period
_NONE = 1e-12  # work of a load, as a share of the largest possible, that is rounding


@dataclass(frozen=True, eq=False)
class WorkBalance:
    """Work of the losses of a system and of one of its loads over free vibrations of its backbone."""

    system: System  #: The system with its damping.
    line: Backbone  #: Its backbone.
    load: str  #: Name of a load with one order, such as ``harmonic1``.

    def amplitudes(self, point: BackbonePoint, harmonics: tuple[int, ...]) -> list[float]:
        """Return the amplitude of the load that balances the losses if it drives each of some harmonics.

        It is infinite where the free vibration has no such harmonic, or where the load does no work on it.
        """
        lost, done = self._work(point, harmonics)
        return [lost / abs(each) if each else np.inf for each in done]

    def states(self, point: BackbonePoint, harmonic: int, amplitude: float) -> list[NDArray[np.float64]]:
        """Return the states of a free vibration at the two phases at which a load of some amplitude balances losses.

        They are those at the angle 0 of the excitation; guesses of the forced motions, shape (2n,) each.
        """
        lost, (done,) = self._work(point, (harmonic,))
        share = lost / (amplitude * abs(done)) if done else np.inf
        if not 0.0 < share <= 1.0:
            return []
        system = self.line.system.at({self.pace: point.value})
        start, best = point.state, float(np.angle(done))
        flow, coefficients = flow_of(system), coefficients_of(system)
        found = []
        for way in (1.0, -1.0):
            angle = ((best + way * np.arccos(share)) / harmonic) % PERIOD
            found.append(flow.integrate(coefficients, start, 0.0, angle).state if angle > 0.0 else start)
        return found

    def _work(self, point: BackbonePoint, harmonics: tuple[int, ...]) -> tuple[float, list[complex]]:
        """Return the mean power of the losses, and for each harmonic the complex one of the load with amplitude 1.

        Its real part belongs to the phase at which both begin together.
        """
        theta = PERIOD * np.arange(_SAMPLES) / _SAMPLES
        system = self.line.system.at({self.pace: point.value})
        states, weights = self._motion(system, point, theta)
        n = system.size
        q, v = states[:, :n], states[:, n:]
        lossy = self._plain.at({self.pace: point.value, **self._others})
        lost = -float(np.mean(np.sum(weights * (_accelerate(lossy, q, v) - _accelerate(system, q, v)), axis=1)))
        found = list[complex]()
        for harmonic in harmonics:
            push = self._push(point.value * harmonic / self.order)
            done = complex(np.mean((weights @ push) * np.exp(1j * harmonic * theta)))
            most = float(np.mean(np.abs(weights) @ np.abs(push)))
            found.append(done if abs(done) > _NONE * most else 0j)
        return lost, found

    @property
    def pace(self) -> str:
        """Name of the frequency."""
        return self.line.system.structure.pace

    @property
    def order(self) -> int:
        """Order of the load."""
        (order,) = next(each for each in self._plain.structure.harmonics if each.name == self.load).orders
        return order

    @property
    def _plain(self) -> System:
        return self.system.equations

    @property
    def _others(self) -> dict[str, float]:
        """The amplitudes of all loads, which are left out of the losses."""
        names = self._plain.structure.names
        known = (f"{each.name}.amplitude" for each in self._plain.structure.harmonics)
        return {name: 0.0 for name in known if name in names}

    def _push(self, pace: float) -> NDArray[np.complex128]:
        """Return the complex acceleration by the load with the amplitude 1 at a frequency of the excitation."""
        there = {**self._others, self.pace: pace}
        layout, structure = layout_of(self._plain.structure), self._plain.structure
        with_load, without = (
            coefficients_of(self._plain.at({**there, f"{self.load}.amplitude": size}))[layout.accelerations]
            for size in (1.0, 0.0)
        )
        lines = (with_load - without)[:, 2 * structure.size + len(structure.contacts) + 1 :]
        column, count = layout.orders.index(self.order), len(layout.orders)
        return lines[:, column] - 1j * lines[:, column + count]

    def _motion(
        self, system: System, point: BackbonePoint, theta: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the states at some angles, and the vectors whose products with accelerations are the work."""
        start, coefficients = point.state, coefficients_of(system)
        n = system.size
        if shows_energy(system):
            states = flow_of(system).sample(coefficients, start, theta).states
            return states, states[:, n:] @ system.matrix("mass").T
        flow = flow_of(system, transition=True)
        sampled = flow.vary(coefficients, start, theta)
        around = flow.integrate(coefficients, start, 0.0, PERIOD).transition
        assert around is not None
        # the gradient of the energy is at right angles to the motion; in the linear range another vector is not
        unit = system.state_scales()
        along = np.append(start[n:], _accelerate(system, start[:n], start[n:])) / unit
        across = np.linalg.svd(along[None])[2][1:].T
        defect = (around * unit / unit[:, None] - np.eye(2 * n)).T @ across
        left = across @ np.linalg.svd(defect)[2][-1] / unit
        weights = np.linalg.solve(sampled.transitions.transpose(0, 2, 1), left[:, None])[:, n:, 0]
        way = 1.0 if np.sum(weights * sampled.states[:, n:]) >= 0.0 else -1.0
        return sampled.states, way * weights


def _accelerate(system: System, q: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    return accelerations(layout_of(system.structure), coefficients_of(system), 0.0, q, v)


def check_load(system: System, load: str) -> None:
    """Raise a ModelError unless a system has a load of one order and an amplitude with this name."""
    structure = system.equations.structure
    names = [each.name for each in structure.harmonics]
    if load not in names:
        raise ModelError(
            f"load is {load!r}; it must be one of {', '.join(names) or 'none, for the system has no load'}"
        )
    form = structure.harmonics[names.index(load)]
    if len(form.orders) != 1 or f"{load}.amplitude" not in structure.names or form.varies:
        raise ModelError(f"{load} must be a harmonic that acts on coordinates, with one order and an amplitude")

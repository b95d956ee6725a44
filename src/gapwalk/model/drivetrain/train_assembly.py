"""Equations of motion of a train from the numbers of its parts, without the rotation of the train as a whole.

The coordinates ``x`` are the deflections of the springs along a tree of links. With the angles ``theta`` of the
inertias, ``theta = T x + r psi``: `r` holds the speeds at which a free train turns as a whole, and the columns of `T`
have no angular momentum, ``r^T J T = 0``. So ``psi`` drops out, exactly, whatever the loads, and what is left is

    T^T J T x'' + L^T C L x' + L^T K L x + sum_k e_k f_k = T^T (torques)

with the deflections ``L x`` of all links. A train that the ground holds has no ``r``. Padmanabhan and Singh (1995),
equations 1 to 18, do the same for three inertias, and divide by the masses.

Where a drag alone joins two groups of inertias (a fluid coupling), the angle ``x_s`` between them is in no equation,
only its rate is, and with a mean torque it grows for ever. So the coordinate is a leaky integral ``y`` of the rate,

    x_s' = y' + g y

That changes no motion: a steady slip is the constant ``g y``, and one multiplier is ``exp(-g T)`` where that of the
angle would be 1. With ``G = diag(g)``, zero for deflections, the equations become

    M x'' + (C + M G) x' + (K + C G) x + ...

for ``x_s`` has no stiffness and deflects no contact. The leak g is twice the rate at which the drag by itself ends the
slip: it follows from inertias and damping alone, and the equations of two inertias keep two different multipliers.

Method: docs/numerics/drive-trains.md
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array

from gapwalk.model.drivetrain import geometry
from gapwalk.model.drivetrain.train_form import TrainForm
from gapwalk.model.names import NameBlock, ParameterNames
from gapwalk.model.structure import Structure
from gapwalk.model.system import System
from gapwalk.model.units import Units

_CONSISTENT = 1e-9  # relative error of the ratios around a loop


@dataclass(frozen=True)
class TrainAssembly:
    """Computes the equations of motion from the numbers of a train of this form.

    Parameters
    ----------
    form
        The train without its numbers.
    units
        In which units its numbers are; None if they are plain numbers, in consistent units already.
    """

    form: TrainForm
    units: Units | None = None

    @property
    def names(self) -> ParameterNames:
        """The names of all numbers of its parts."""
        return self._names

    @cached_property
    def _names(self) -> ParameterNames:
        names = self.form.names
        if self.units is None or self.units.pace == names[0]:
            return names
        return ParameterNames((NameBlock(self.units.pace), *names.blocks[1:]))

    def consistent(self, values: NDArray[Any]) -> NDArray[Any]:
        """Its numbers in consistent units: those of the equations of motion."""
        return values if self.units is None else values * self._factors

    def expand(self, values: NDArray[Any]) -> NDArray[Any]:
        """The values of the equations of motion, in symmetric form."""
        form, turned, values = self.form, self.angles(values), self.consistent(values)
        deflections = geometry.deflections(form, form.ratios(values))
        mass = turned.T @ (form.inertia(values)[:, None] * turned)
        damping, stiffness = (
            deflections.T @ (numbers[:, None] * deflections)
            for numbers in (form.dampings(values), form.stiffnesses(values))
        )
        if form.slips:
            leaks = self._leaks(values)
            damping, stiffness = damping + mass * leaks, stiffness + damping * leaks
        parts = [values[:1], mass.ravel(), damping.ravel(), stiffness.ravel(), turned.T @ self._mean(values)]
        for torque in form.torques:
            parts += [form.parameters(values, torque), turned.T @ form.shape(values, torque)]
        for number, contact in form.contacts:
            parts += [deflections[number], form.springs_and_law(values, contact)]
        return np.concatenate(parts)

    def accelerations(self, values: NDArray[Any]) -> NDArray[Any]:
        """The columns of stiffness, damping, contacts, mean load and excitation, divided by the masses.

        ``T^T J T`` is the inverse of ``W B^-1 W^T``, with the deflections ``W`` of the coordinates by the bodies that
        rigid gears make of the inertias, and the inertias ``B`` of those. So nothing is solved, and zeros stay zeros.
        """
        values = self.consistent(values)
        form, ratios = self.form, self.form.ratios(values)
        bodies, flexed, inverse = self._flexed(values)
        deflections = csr_array(geometry.deflections(form, ratios))
        torques = [self._mean(values), *(form.shape(values, torque) for torque in form.torques)]
        stiffness, damping = (
            (inverse @ (diags_array(numbers) @ deflections)).toarray()
            for numbers in (form.stiffnesses(values), form.dampings(values))
        )
        if form.slips:
            leaks = self._leaks(values)
            stiffness, damping = stiffness + damping * leaks, damping + np.diag(leaks)
        columns = [
            stiffness,
            damping,
            inverse.toarray()[:, [number for number, _ in form.contacts]],
            flexed @ (bodies.T @ np.stack(torques, axis=1)),
        ]
        return np.concatenate(columns, axis=1)

    def leaks(self, values: NDArray[Any]) -> NDArray[Any]:
        """The leaks g of the coordinates, in consistent units, shape (n,): 0 for deflections."""
        return self._leaks(self.consistent(values))

    def _leaks(self, values: NDArray[Any]) -> NDArray[Any]:
        form, found = self.form, np.zeros(len(self.form.springs), dtype=values.dtype)
        if form.slips:
            inverse = self._flexed(values)[2].toarray()
            deflections = geometry.deflections(form, form.ratios(values))
            for place in form.slips:
                column = deflections[:, place]
                drag = column @ (form.dampings(values) * column)  # with that of other drags in parallel
                found[place] = 2.0 * inverse[place, form.springs[place]] * drag
        return found

    def _flexed(self, values: NDArray[Any]) -> tuple[csr_array, csr_array, csr_array]:
        """Bodies, deflections of the coordinates by them over their inertias, and accelerations by forces of links."""
        form, ratios = self.form, self.form.ratios(values)
        bodies = geometry.bodies(form, ratios)
        pulls = geometry.pulls(form, ratios, bodies)
        flexed = pulls[list(form.springs)] @ diags_array(1.0 / ((bodies * bodies).T @ form.inertia(values)))
        return bodies, csr_array(flexed), csr_array(flexed @ pulls.T)

    def angles(self, values: NDArray[Any]) -> NDArray[Any]:
        """The matrix T: angles of the inertias by the coordinates, without momentum, shape (inertias, n)."""
        values = self.consistent(values)
        ratios, inertia = self.form.ratios(values), self.form.inertia(values)
        turned = geometry.angles(self.form, ratios)[:-1]
        if not self.form.is_free:
            return turned
        speeds = geometry.speeds(self.form, ratios)
        momentum = (inertia * speeds) @ turned
        return turned - np.outer(speeds, momentum / np.sum(inertia * speeds * speeds))

    def links(self, values: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Return stiffness and damping of the links that always act, and deflections, shape (links, n)."""
        values, form = self.consistent(values), self.form
        return form.stiffnesses(values), form.dampings(values), geometry.deflections(form, form.ratios(values))

    def mean(self, values: NDArray[Any]) -> NDArray[Any]:
        """The mean torques on the inertias in consistent units, with the reaction, shape (inertias,)."""
        return self._mean(self.consistent(values))

    def acceleration(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """The steady accelerations of the inertias as a free train turns as a whole, shape (inertias,)."""
        if self.form.reaction is not None:  # it leaves rounding errors at most
            return np.zeros(len(self.form.inertias))
        return self.turning(values)[:, 0]

    def turning(self, values: NDArray[Any]) -> NDArray[Any]:
        """The accelerations of the inertias by their torques as a free train turns as a whole.

        They are in consistent units, shape (inertias, 1 + terms of the excitation): by the mean torques, then by each
        term at the size 1. Together with `angles`, which have no momentum, they are all of the motion: the angles are
        ``T x + r psi``, and ``r^T J r psi'' = r^T (torques)``. Zeros where the ground holds the train.
        """
        values, form = self.consistent(values), self.form
        shapes = [self._mean(values), *(form.shape(values, torque) for torque in form.torques)]
        if not form.is_free:
            return np.zeros((len(form.inertias), len(shapes)), dtype=values.dtype)
        speeds, inertia = geometry.speeds(form, form.ratios(values)), form.inertia(values)
        return np.outer(speeds, speeds @ np.stack(shapes, axis=1)) / np.sum(inertia * speeds * speeds)

    def _mean(self, values: NDArray[Any]) -> NDArray[Any]:
        mean = self.form.mean(values)
        if self.form.reaction is not None:
            speeds = geometry.speeds(self.form, self.form.ratios(values))
            mean[self.form.reaction] = -(speeds @ mean) / speeds[self.form.reaction]
        return mean

    @cached_property
    def _factors(self) -> NDArray[np.float64]:
        return np.ones(1) if self.units is None else self.units.factors(self.names)

    def problems(self, values: NDArray[np.float64]) -> Iterator[str]:
        """List the errors of the numbers, one sentence each."""
        for name, value in zip(self.names, values.tolist(), strict=True):
            what = name.rsplit(".", 1)[-1]
            if what == "inertia" and not value > 0:
                yield f"{name} is {value:g}; it must be > 0: leave a part without inertia out, and join its neighbours"
            elif what == "ratio" and value == 0:
                yield f"{name} is 0; it must be the speed of the first inertia over that of the second"
            elif what.endswith("damping") and not value >= 0:
                yield f"{name} is {value:g}; it must be >= 0"
        for link, value in zip(self.form.links, self.form.stiffnesses(values).tolist(), strict=True):
            if link.always and not value > 0:
                yield f"{link.name}.stiffness is {value:g}; it must be > 0"
        dampings = self.form.dampings(values).tolist()
        for link in (self.form.springs[place] for place in self.form.slips):
            if dampings[link] == 0.0:
                yield (
                    f"{self.form.links[link].name}.damping is 0; it must be > 0, for nothing else joins its two "
                    "inertias: compute what is on either side of it as a train of its own"
                )

    def loop_problems(self, values: NDArray[np.float64]) -> Iterator[str]:
        """List the errors of closed loops, once only: the ratios on them are not parameters."""
        form, ratios = self.form, self.form.ratios(values)
        speeds, body = geometry.speeds(form, ratios), geometry.bodies(form, ratios).indices
        for number in form.tree.chords:
            link, (first, second) = form.links[number], form.links[number].ends
            if number not in form.tree.looped:
                continue
            wanted = speeds[first] / speeds[second]
            if abs(ratios[number] / wanted - 1.0) > _CONSISTENT:
                here = f"its ratio is {ratios[number]:.10g}" if link.geared else "as a shaft it has the ratio 1"
                if link.drag:
                    yield (
                        f"{link.name} closes a loop, and {here}, but by the other way round it is {wanted:.10g}: it "
                        "slips as the train turns, with a torque that grows with the speed, which is no part of the "
                        "equations; join two inertias that turn at one speed"
                    )
                    continue
                yield (
                    f"{link.name} closes a loop, and {here}, but by the other way round it is {wanted:.10g}: the train "
                    "is locked; correct one of the ratios on the loop"
                )
            elif not link.rigid and body[first] == body[second]:
                yield f"{link.name} never deflects, for rigid gears hold its two inertias together; leave it out"


def of_angles(
    system: System, stiffness: NDArray[np.float64], damping: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Stiffness and damping matrices with the angles of slips as coordinates, from those by the slips themselves."""
    assembly = system.structure.assembly
    if not isinstance(assembly, TrainAssembly) or not assembly.form.slips:
        return stiffness, damping
    stiffness = stiffness.copy()
    stiffness[:, assembly.form.slips] = 0.0  # no spring acts on the angle of a slip, nor any contact
    return stiffness, damping - system.matrix("mass") * assembly.leaks(system.values)


def structure_of(assembly: TrainAssembly) -> Structure:
    """The structure of the system that a train makes up."""
    form = assembly.form
    contacts = tuple(contact for _, contact in form.contacts)
    return Structure(form.coordinates, contacts, tuple(torque.harmonic for torque in form.torques), assembly)

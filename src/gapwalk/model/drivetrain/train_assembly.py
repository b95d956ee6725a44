"""Equations of motion of a train from the numbers of its parts, without the rotation of the train as a whole.

The coordinates ``x`` are the deflections of the springs along a tree of links. With the angles ``theta`` of the
inertias, ``theta = T x + r psi``: `r` holds the speeds at which a free train turns as a whole, and the columns of `T`
have no angular momentum, ``r^T J T = 0``. So ``psi`` drops out, exactly, whatever the loads, and what is left is

    T^T J T x'' + L^T C L x' + L^T K L x + sum_k e_k f_k = T^T (torques)

with the deflections ``L x`` of all links. An inertia whose motion is prescribed is taken for the ground, and displaces
the links that end at it. A train that the ground holds has no ``r``. Padmanabhan and Singh (1995),
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
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.drivetrain.train_form import Step, TrainForm
from gapwalk.model.loads import Line
from gapwalk.model.structure import NameBlock, ParameterNames, Structure
from gapwalk.model.system import System
from gapwalk.model.units import Units

if TYPE_CHECKING:
    from scipy.sparse import csr_array

CONSISTENT = 1e-9  # relative error of the ratios around a loop
_LONG = 100  # links above which products of sparse matrices are cheaper: below, each costs more than all of its sums

Matrix: TypeAlias = "csr_array | NDArray[Any]"
"""A matrix: sparse for a long train."""


@dataclass(frozen=True)
class TrainAssembly:
    """Assembly of the equations of motion from the numbers of a train of this form."""

    form: TrainForm  #: The train without its numbers.
    units: Units | None = None  #: Units of its numbers; None for plain numbers, which are in consistent units already.

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

    def numbers(self, values: NDArray[Any]) -> TrainNumbers:
        """Return the train with its numbers, converted to consistent units."""
        return TrainNumbers(self.form, values if self.units is None else values * self._factors)

    @cached_property
    def _factors(self) -> NDArray[np.float64]:
        return np.ones(1) if self.units is None else self.units.factors(self.names)

    def expand(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the values of the equations of motion, in symmetric form."""
        numbers = self.numbers(values)
        form, turned, deflections = self.form, numbers.angles, numbers.deflections
        mass = turned.T @ (numbers.inertia[:, None] * turned)
        damping, stiffness = (
            deflections.T @ (each[:, None] * deflections) for each in (numbers.damping, numbers.stiffness)
        )
        if form.slips:
            damping, stiffness = damping + mass * numbers.leaks, stiffness + damping * numbers.leaks
        mean, *torques = numbers.torques
        parts, acting = [numbers.values[:1], mass.ravel(), damping.ravel(), stiffness.ravel()], iter(torques)
        parts.append(turned.T @ mean)
        for load, number, link, factor, _ in form.loads:
            parts.append(form.numbers(form.torques[number].harmonic.parameters, numbers.values))
            if link >= 0:
                parts += [numbers.stiffness[[link]], numbers.damping[[link]], -factor * deflections[link]]
            elif not load.varies:
                parts.append(turned.T @ next(acting))
        for number, contact in form.contacts:
            parts += [deflections[number], form.numbers(contact.parameters, numbers.values)]
        return np.concatenate(parts)

    def accelerations(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the columns of stiffness, damping, contacts, mean load and excitation, divided by the masses.

        ``T^T J T`` is the inverse of ``W B^-1 W^T``, with the deflections ``W`` of the coordinates by the bodies that
        rigid gears make of the inertias, and the inertias ``B`` of those. So nothing is solved, and zeros stay zeros.
        """
        numbers = self.numbers(values)
        bodies, flexed, inverse = numbers.flexed
        stiffness, damping = (
            inverse @ (each[:, None] * numbers.deflections) for each in (numbers.stiffness, numbers.damping)
        )
        if self.form.slips:
            stiffness, damping = stiffness + damping * numbers.leaks, damping + np.diag(numbers.leaks)
        by_links = _filled(inverse)
        contacts = by_links[:, [number for number, _ in self.form.contacts]]
        torques = flexed @ (bodies.T @ np.stack(numbers.torques, axis=1))
        columns, driving = [torques[:, 0]], iter(torques.T[1:])
        for load, _, link, factor, _ in self.form.loads:
            if link >= 0:
                columns.append(-factor * by_links[:, link])
            elif not load.varies:
                columns.append(next(driving))
        return np.concatenate((stiffness, damping, contacts, np.stack(columns, axis=1)), axis=1)

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
        numbers = TrainNumbers(self.form, values)
        for link, value in zip(self.form.links, numbers.stiffness.tolist(), strict=True):
            if link.always and not value > 0:
                yield f"{link.name}.stiffness is {value:g}; it must be > 0"
        for link in (self.form.springs[place] for place in self.form.slips):
            if numbers.damping[link] == 0.0:
                yield (
                    f"{self.form.links[link].name}.damping is 0; it must be > 0, for nothing else joins its two "
                    "inertias: compute what is on either side of it as a train of its own"
                )

    def loop_problems(self, values: NDArray[np.float64]) -> Iterator[str]:
        """List the errors of closed loops, once only: the ratios on them are not parameters."""
        form, numbers = self.form, TrainNumbers(self.form, values)
        ratios, speeds, body = numbers.ratios, numbers.speeds, numbers.bodies[0]
        for number in form.tree.chords:
            link, (first, second) = form.links[number], form.links[number].ends
            if number not in form.tree.looped:
                continue
            slips = link.drag or link.loose
            wanted = speeds[first] / speeds[second]
            if abs(ratios[number] / wanted - 1.0) > CONSISTENT and not slips:
                here = f"its ratio is {ratios[number]:.10g}" if link.geared else "as a shaft it has the ratio 1"
                yield (
                    f"{link.name} closes a loop, and {here}, but by the other way round it is {wanted:.10g}: the train "
                    "is locked; correct one of the ratios on the loop"
                )
            elif link.loose and numbers.deflections[number][list(form.slips)].any():
                across = next(form.links[form.springs[place]].name for place in form.slips)
                yield (
                    f"{link.name} acts across {across}, which slips: the equations have no such friction or formula "
                    "yet. A linear drag may act there: write it as a [[shaft]] with damping = ... alone"
                )
            elif not link.rigid and body[first] == body[second]:
                yield f"{link.name} never deflects, for rigid gears hold its two inertias together; leave it out"


@dataclass(frozen=True, eq=False)
class TrainNumbers:
    """A train with its numbers, real or complex, and the vectors and matrices that follow from them."""

    form: TrainForm  #: The train without its numbers.
    values: NDArray[Any]  #: The numbers in the order of `TrainForm.names`, in consistent units.

    @cached_property
    def inertia(self) -> NDArray[Any]:
        """The inertias, shape (inertias,)."""
        return self.values[1 : 1 + len(self.form.inertias)]

    @cached_property
    def ratios(self) -> NDArray[Any]:
        """The ratios of all links, shape (links,); that of a shaft is 1."""
        return self._of_links("ratio", [1.0 if link.fixed is None else link.fixed for link in self.form.links])

    @cached_property
    def stiffness(self) -> NDArray[Any]:
        """The stiffnesses of the springs that act always, shape (links,)."""
        return self._of_links("stiffness", [0.0] * len(self.form.links))

    @cached_property
    def damping(self) -> NDArray[Any]:
        """The coefficients of the dampers that act always, shape (links,)."""
        return self._of_links("damping", [0.0] * len(self.form.links))

    def _of_links(self, what: str, otherwise: list[float]) -> NDArray[Any]:
        which, places = self.form.places[what]
        numbers = np.array(otherwise, dtype=self.values.dtype)
        numbers[which] = self.values[places]
        return numbers

    @cached_property
    def _steps(self) -> list[tuple[Step, Any]]:
        """The steps through the tree, each with the angle of its child by that of its parent while nothing deflects."""
        found = []
        for step in self.form.tree.steps:
            forward, ratio = self.form.links[step.link].ends[0] == step.parent, self.ratios[step.link]
            found.append((step, 1 / ratio if forward else ratio))
        return found

    @cached_property
    def speeds(self) -> NDArray[Any]:
        """The speeds at which the inertias turn together, the first at 1, shape (inertias,).

        Of a train that is connected to the ground, those at which it would turn without that connection.
        """
        found = np.ones(len(self.form.inertias) + 1, dtype=self.ratios.dtype)
        for step, factor in self._steps:
            if step.parent != self.form.ground:
                found[step.child] = found[step.parent] * factor
        return found[:-1]

    @cached_property
    def _turned(self) -> NDArray[Any]:
        """The angles of the inertias, and of the ground, by the coordinates while the root of the tree is at rest."""
        columns = {link: column for column, link in enumerate(self.form.springs)}
        found = np.zeros((len(self.form.inertias) + 1, len(columns)), dtype=self.ratios.dtype)
        for step, factor in self._steps:
            angle = found[step.child]
            np.multiply(found[step.parent], factor, out=angle)
            if step.link in columns:
                forward = self.form.links[step.link].ends[0] == step.parent
                angle[columns[step.link]] += -factor if forward else 1.0
        return found

    @cached_property
    def angles(self) -> NDArray[Any]:
        """The matrix T: angles of the inertias by the coordinates, without momentum, shape (inertias, n)."""
        turned = self._turned[:-1]
        if not self.form.is_free:
            return turned
        momentum = (self.inertia * self.speeds) @ turned
        return turned - np.outer(self.speeds, momentum / np.sum(self.inertia * self.speeds * self.speeds))

    @cached_property
    def deflections(self) -> NDArray[Any]:
        """The deflections of the links by the coordinates, shape (links, n)."""
        form = self.form
        found = np.zeros((len(form.links), len(form.springs)), dtype=self.ratios.dtype)
        found[list(form.springs), range(len(form.springs))] = 1.0
        for chord in form.tree.chords:
            if not form.links[chord].rigid:
                first, second = form.links[chord].ends
                found[chord] = self._turned[first] - self.ratios[chord] * self._turned[second]
        return found

    @cached_property
    def bodies(self) -> tuple[NDArray[np.intp], NDArray[Any], int]:
        """The body of each inertia, its angle by that of the body, and the number of bodies.

        Rigid gears make one body of several inertias.
        """
        count = len(self.form.inertias)
        body, turn = np.zeros(count + 1, dtype=np.intp), np.ones(count + 1, dtype=self.ratios.dtype)
        known = 1 if self.form.is_free else 0
        for step, factor in self._steps:
            if self.form.links[step.link].rigid:
                body[step.child], turn[step.child] = body[step.parent], turn[step.parent] * factor
            else:
                body[step.child], known = known, known + 1
        return body[:count], turn[:count], known

    @cached_property
    def flexed(self) -> tuple[Matrix, Matrix, Matrix]:
        """Angles of the inertias by those of the bodies, of shape (inertias, bodies), and what follows from them.

        That is deflections of the coordinates by the bodies over their inertias, and accelerations by forces of links.
        """
        form, (body, turn, known) = self.form, self.bodies
        count, links = len(body), len(form.links)
        turned = self._matrix(turn, np.arange(count), body, (count, known))
        # deflections of the links by the angles of the inertias, then of the bodies
        ends = form.ends
        weights, moving = np.concatenate((np.ones(links), -self.ratios)), ends != form.ground
        places = np.tile(np.arange(links), 2)[moving]
        pulls = self._matrix(weights[moving], places, ends[moving], (links, count)) @ turned
        each = np.arange(known)
        inverse = self._matrix(1.0 / ((turned * turned).T @ self.inertia), each, each, (known, known))
        flexed = pulls[list(form.springs)] @ inverse
        return turned, flexed, flexed @ pulls.T

    def _matrix(
        self, entries: NDArray[Any], rows: NDArray[np.intp], columns: NDArray[np.intp], shape: tuple[int, int]
    ) -> Matrix:
        """Return the matrix of these entries."""
        if len(self.form.links) > _LONG:
            from scipy.sparse import csr_array  # imported late, because the import is slow

            return csr_array((entries, (rows, columns)), shape=shape)
        found = np.zeros(shape, dtype=entries.dtype)
        found[rows, columns] = entries
        return found

    @cached_property
    def leaks(self) -> NDArray[Any]:
        """The leaks g of the coordinates, shape (n,): 0 for deflections."""
        form, found = self.form, np.zeros(len(self.form.springs), dtype=self.values.dtype)
        if form.slips:
            inverse = _filled(self.flexed[2])
            for place in form.slips:
                column = self.deflections[:, place]
                drag = column @ (self.damping * column)  # with that of other drags in parallel
                found[place] = 2.0 * inverse[place, form.springs[place]] * drag
        return found

    @cached_property
    def torques(self) -> list[NDArray[Any]]:
        """The mean torques, and each load that acts on inertias at the size 1, each shape (inertias,)."""
        form, mean = self.form, np.zeros(len(self.form.inertias), dtype=self.values.dtype)
        mean[list(form.loaded)] = self.values[1 + len(form.inertias) :][: len(form.loaded)]
        if form.reaction is not None:
            mean += self._reaction(mean)
        found = [mean]
        for part in form.acting:
            shape = form.shape(self.values, form.torques[part.torque])
            found.append(self._reaction(shape) if part.reacts else shape)
        return found

    def _reaction(self, torques: NDArray[Any]) -> NDArray[Any]:
        """Return the torque of the reaction that balances some torques, shape (inertias,)."""
        place, found = self.form.reaction, np.zeros_like(torques)
        found[place] = -(self.speeds @ torques) / self.speeds[place]
        return found

    @cached_property
    def turning(self) -> NDArray[Any]:
        """The accelerations of the inertias by their torques as a free train turns as a whole.

        Shape (inertias, 1 + loads on inertias): by the mean torques, then by each load at the size 1. Together
        with `angles`, which have no momentum, they are all of the motion: the angles are ``T x + r psi``, and
        ``r^T J r psi'' = r^T (torques)``. Zeros if the train is connected to the ground.
        """
        if not self.form.is_free:
            return np.zeros((len(self.form.inertias), len(self.torques)), dtype=self.values.dtype)
        moved = self.speeds @ np.stack(self.torques, axis=1)
        return np.outer(self.speeds, moved) / np.sum(self.inertia * self.speeds * self.speeds)

    @property
    def sizes(self) -> list[tuple[Line, ...]]:
        """The lines of each of the `torques`, of which the first, the mean, is constant."""
        form, values = self.form, self.values
        return [(Line(0, 1.0, 0.0),)] + [
            part.form.lines(values[0], form.numbers(form.torques[part.torque].harmonic.parameters, values))
            for part in form.acting
        ]

    @property
    def unbalanced(self) -> float:
        """The constant torque that nothing balances, in terms of the first inertia; 0 with a reaction."""
        if self.form.reaction is not None:  # it leaves rounding errors at most
            return 0.0
        sizes = [sum(line.cosine for line in lines if not line.order) for lines in self.sizes]
        return float(self.speeds @ np.stack(self.torques, axis=1) @ sizes / self.speeds[0])


def _filled(matrix: Matrix) -> NDArray[Any]:
    return matrix if isinstance(matrix, np.ndarray) else matrix.toarray()


def of_angles(
    system: System, stiffness: NDArray[np.float64], damping: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return stiffness and damping matrices with the angles of slips as coordinates, from those by the slips."""
    assembly = system.structure.assembly
    if not isinstance(assembly, TrainAssembly) or not assembly.form.slips:
        return stiffness, damping
    stiffness = stiffness.copy()
    stiffness[:, assembly.form.slips] = 0.0  # no spring acts on the angle of a slip, nor any contact
    return stiffness, damping - system.matrix("mass") * assembly.numbers(system.values).leaks


def structure_of(assembly: TrainAssembly) -> Structure:
    """Make the structure of the system of a train."""
    form = assembly.form
    contacts = tuple(contact for _, contact in form.contacts)
    return Structure(form.coordinates, contacts, tuple(load.form for load in form.loads), assembly)

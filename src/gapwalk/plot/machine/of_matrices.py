"""The machine of a system of matrices: what its mass and stiffness matrices and the directions of its contacts say.

A symmetric stiffness matrix is a set of springs: ``-K_ij`` between two coordinates, and the sum of a row to the base.
Equations that were divided by their masses are multiplied by them first. Where a force acts in more equations than its
deflection has coordinates, coordinates are deflections of a chain (Padmanabhan and Singh 1995, equations 11 to 18):

    x'' = -P (k x + f) with P = W J^-1 W^T

Then ``-1 / P_ij`` is the inertia between two springs. What is neither is drawn as coupled coordinates.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.structure import ContactForm
from gapwalk.model.system import System
from gapwalk.plot.machine.elements import BASE, Body, Element, Link, Machine, Push, combination, elements_of

Array = NDArray[np.float64]

MOST = 14
"""Coordinates of a system that is drawn whole; of a larger one, only contacts are."""

_CONTACTS = 24  # that are drawn, at most
_CLOSE = 1e-6  # relative difference of equal numbers


def machine_of_matrices(system: System) -> Machine:
    """Return the machine of a system that is given by matrices."""
    if system.size > MOST:
        return _contacts_alone(system, f"{system.size} coordinates")
    mass = system.matrix("mass")
    if system.structure.contacts and np.count_nonzero(mass - np.diag(np.diag(mass))):
        return _contacts_alone(system, "the mass matrix couples the coordinates")
    return _chain_of_deflections(system) or _bodies_and_springs(system)


def _contacts_alone(system: System, why: str) -> Machine:
    bodies: list[Body] = []
    links = tuple(_to_place(system, form, bodies) for form in system.structure.contacts[:_CONTACTS])
    more = len(system.structure.contacts) - _CONTACTS
    note = f"{why}: only contacts are drawn, with their coordinates"
    return Machine(tuple(bodies), links, (note, *([f"and {more} more contacts"] if more > 0 else [])))


def _to_place(system: System, form: ContactForm, bodies: list[Body]) -> Link:
    """Return the link of a contact from the base to the place that its deflection names, which it adds."""
    terms = _terms(system, form)
    text = combination(tuple((system.coordinates[place], factor) for place, factor in terms[:3]))
    text += " + ..." if len(terms) > 3 else ""
    place = terms[0][0] if len(terms) == 1 else -1
    signal, loads = (system.coordinates[place], _loads(system)[place]) if place >= 0 else ("", ())
    body = Body(text, terms, 0.0, signal, tuple(loads))
    if body not in bodies:
        bodies.append(body)
    return Link((bodies.index(body), BASE), 1, tuple(elements_of(system, form)))


def _terms(system: System, form: ContactForm) -> tuple[tuple[int, float], ...]:
    vector = system.vector(form.vectors[0])
    return tuple((int(place), float(vector[place])) for place in np.flatnonzero(vector))


def _bodies_and_springs(system: System) -> Machine:
    mass, damping, stiffness = (system.matrix(each) for each in ("mass", "damping", "stiffness"))
    masses = _masses(system, mass, stiffness)
    notes, own = [], np.diag(mass)
    if masses is not None:
        damping, stiffness = masses[:, None] * damping, masses[:, None] * stiffness
        own = masses * own
    loads = _loads(system)
    bodies = [
        Body(name, ((place, 1.0),), float(abs(own[place])), name, tuple(loads[place]))
        for place, name in enumerate(system.coordinates)
    ]
    found: dict[tuple[int, int], list[Element]] = {}
    if not _is_symmetric(stiffness):
        notes.append("the stiffness matrix is not symmetric: its couplings are dashed")
    for place, other in ((i, j) for i in range(system.size) for j in range(i)):
        pair = [*_between(mass, damping, stiffness, other, place)]
        if pair:
            found[other, place] = pair
    for place in range(system.size):
        to_base = [*_to_base(damping, stiffness, place)]
        if to_base:
            found[place, BASE] = to_base
    links = [Link(ends, 1, tuple(elements)) for ends, elements in found.items()]
    for form in system.structure.contacts[:_CONTACTS]:
        links.append(_contact(system, form, bodies))
    more = len(system.structure.contacts) - _CONTACTS
    notes += [f"and {more} more contacts"] if more > 0 else []
    return Machine(tuple(bodies), _joined(links), tuple(notes))


def _contact(system: System, form: ContactForm, bodies: list[Body]) -> Link:
    terms, several = _terms(system, form), len(form.vectors) > 1
    if several or len(terms) > 2 or not terms:
        return _to_place(system, form, bodies)
    (first, factor), *rest = terms
    if not rest:
        return Link((first, BASE), int(np.sign(factor)), tuple(elements_of(system, form)))
    (second, other) = rest[0]
    if abs(factor + other) > _CLOSE * abs(factor):  # a lever, or bodies at different radii
        return _to_place(system, form, bodies)
    return Link((first, second), int(np.sign(factor)), tuple(elements_of(system, form)))


def _joined(links: Sequence[Link]) -> tuple[Link, ...]:
    """Join links between the same bodies with the same sign."""
    found: dict[tuple[tuple[int, int], int], list[Element]] = {}
    for link in links:
        ends, sign = link.ends, link.sign
        if not any(each.contact for each in link.elements) and (ends, -1) in found and (ends, 1) not in found:
            sign = -1  # a spring has no sign
        found.setdefault((ends, sign), []).extend(link.elements)
    return tuple(Link(ends, sign, tuple(elements)) for (ends, sign), elements in found.items())


def _is_symmetric(matrix: Array) -> bool:
    return bool(np.abs(matrix - matrix.T).max() <= _CLOSE * np.abs(matrix).max(initial=0.0))


def _masses(system: System, mass: Array, stiffness: Array) -> Array | None:
    """Return masses that make the stiffness matrix symmetric, by which it was divided; None if there are none."""
    if _is_symmetric(stiffness) or np.count_nonzero(mass - np.diag(np.diag(mass))):
        return None
    factors = _symmetric_factors(stiffness)
    if factors is None:
        return None
    for form in system.structure.contacts:
        push, deflection = factors * system.vector(form.push), system.vector(form.vectors[0])
        if abs(abs(push @ deflection) - np.linalg.norm(push) * np.linalg.norm(deflection)) > _CLOSE * abs(push).max():
            return None
    return factors


def _symmetric_factors(matrix: Array) -> Array | None:
    """Return factors of the rows, > 0, that make a matrix symmetric; None if there are none."""
    size, factors = len(matrix), np.zeros(len(matrix))
    for start in range(size):
        if factors[start]:
            continue
        factors[start], waiting = 1.0, [start]
        while waiting:
            row = waiting.pop()
            for column in np.flatnonzero(matrix[row]):
                if not factors[column]:
                    if matrix[row, column] * matrix[column, row] <= 0.0:
                        return None
                    factors[column] = factors[row] * matrix[row, column] / matrix[column, row]
                    waiting.append(int(column))
    return factors if _is_symmetric(factors[:, None] * matrix) else None


def _between(mass: Array, damping: Array, stiffness: Array, i: int, j: int) -> Iterator[Element]:
    for matrix, kind, what in ((stiffness, "spring", "stiffness"), (damping, "damper", "damping")):
        value, back = -matrix[i, j], -matrix[j, i]
        if abs(value - back) > _CLOSE * max(abs(value), abs(back)) or value < 0.0:
            yield Element("coupling", what, f"coupled by the {what} matrix")
        elif value:
            yield Element(kind, f"{value:.3g}" if kind == "spring" else "", f"{kind}, {value:.4g}")
    if mass[i, j] or mass[j, i]:
        yield Element("coupling", "mass", "coupled by the mass matrix")


def _to_base(damping: Array, stiffness: Array, place: int) -> Iterator[Element]:
    for matrix, kind in ((stiffness, "spring"), (damping, "damper")):
        row, others = matrix[place], np.arange(len(matrix)) != place
        springs = others & (row < 0.0) & (np.abs(row - matrix[:, place]) <= _CLOSE * np.abs(row))
        value = float(row[place] + row[springs].sum())
        if abs(value) > _CLOSE * np.abs(row).max(initial=0.0):
            name = f"{value:.3g}".replace("-", "−") if kind == "spring" or value < 0.0 else ""
            yield Element(kind, name, f"{kind} to the base, {value:.4g}")


def _loads(system: System) -> list[list[Push]]:
    found: list[list[Push]] = [[] for _ in system.coordinates]
    vectors = [(load.name, system.vector(load.shape)) for load in system.structure.driving]
    for name, vector in (*vectors, ("mean", system.vector("mean"))):
        for place in np.flatnonzero(vector):
            found[place].append(Push.of(name, vector[place]))
    return found


def _chain_of_deflections(system: System) -> Machine | None:
    """Return the chain of inertias of which the coordinates are deflections; None if they are not."""
    mass, contacts = system.matrix("mass"), system.structure.contacts
    size = system.size
    if size < 2 or np.count_nonzero(mass - np.diag(np.diag(mass))) or not contacts:
        return None
    if all(form.reciprocal for form in contacts):
        return None
    own = np.diag(mass)
    stiffness = system.matrix("stiffness") / own[:, None]
    factors = _symmetric_factors(stiffness.T)
    if factors is None or any(len(form.vectors) > 1 for form in contacts):
        return None
    flexed = stiffness * factors  # P times a number: its columns are divided by the stiffnesses
    for form in contacts:
        terms, push = _terms(system, form), system.vector(form.push) / own
        if len(terms) != 1:
            return None
        column = flexed[:, terms[0][0]]
        scale = push @ column / (column @ column)
        if np.abs(push - scale * column).max() > _CLOSE * np.abs(push).max():
            return None
    order = _path(flexed)
    if order is None:
        return None
    # signs by which all deflections count one way along the chain
    signs = np.ones(size)
    for before, after in pairwise(order):
        signs[after] = -np.sign(flexed[before, after]) * signs[before]
    chain = (flexed * signs * signs[:, None])[np.ix_(order, order)]
    inverse = [*(-np.diag(chain, 1)).tolist()]
    inverse = [chain[0, 0] - inverse[0], *inverse, chain[-1, -1] - inverse[-1]]
    sums = np.array([a + b for a, b in pairwise(inverse)])
    if min(inverse) < -_CLOSE * max(inverse) or np.abs(np.diag(chain) - sums).max() > _CLOSE * max(inverse):
        return None
    return _chain(system, order, signs, np.array(inverse))


def _path(matrix: Array) -> list[int] | None:
    """Return the order in which coordinates follow one another along a path; None if they do not."""
    near = [[int(k) for k in np.flatnonzero(row) if k != place] for place, row in enumerate(matrix)]
    ends = [place for place, each in enumerate(near) if len(each) == 1]
    if len(ends) != 2 or max(map(len, near)) > 2:
        return None
    order = [min(ends)]
    while len(order) < len(near):
        following = [k for k in near[order[-1]] if k not in order]
        if not following:
            return None
        order.append(following[0])
    return order


def _chain(system: System, order: list[int], signs: Array, inverse: Array) -> Machine:
    """Build the chain: `inverse` are the inverse inertias; 0 at an end is the base."""
    size, held = len(order), [place for place in (0, -1) if inverse[place] <= _CLOSE * inverse.max()]
    turned = np.zeros(
        (size + 1, system.size)
    )  # displacements by the coordinates: each is the one before less a deflection
    for place, coordinate in enumerate(order):
        turned[place + 1] = turned[place]
        turned[place + 1, coordinate] -= signs[coordinate]
    if held:
        turned = turned - turned[held[0]]
    else:
        inertia = 1.0 / inverse
        turned = turned - (inertia @ turned) / inertia.sum()
    numbers = [
        place for place in range(size + 1) if not (place == 0 and 0 in held) and not (place == size and -1 in held)
    ]
    loads = _loads_on_chain(system, order, signs, numbers)
    bodies = tuple(
        Body(
            f"inertia {number + 1}",
            tuple((k, float(turned[place, k])) for k in range(system.size) if turned[place, k]),
            float(1.0 / inverse[place]),
            "",
            tuple(loads[place]),
        )
        for number, place in enumerate(numbers)
    )
    of = {place: number for number, place in enumerate(numbers)}
    links, damping = [], system.matrix("damping")
    for place, coordinate in enumerate(order):
        name, sign = system.coordinates[coordinate], int(signs[coordinate])
        elements = [Element("spring", name, f"{name}: spring whose deflection is the coordinate", "", name)]
        for form in system.structure.contacts:
            (at, factor), *_ = _terms(system, form)
            if at == coordinate:
                sign = int(signs[coordinate] * np.sign(factor))
                elements += elements_of(system, form)
        if damping[coordinate, coordinate]:
            elements.append(Element("damper", "", f"damper along {name}", "", name))
        first, second = of.get(place, BASE), of.get(place + 1, BASE)
        ends, sign = ((first, second), sign) if first != BASE else ((second, BASE), -sign)
        links.append(Link(ends, sign, tuple(elements)))
    note = "the coordinates are deflections of a chain; its inertias follow from the matrices"
    return Machine(bodies, tuple(links), (note,), turns=True)


def _loads_on_chain(system: System, order: list[int], signs: Array, numbers: list[int]) -> list[list[Push]]:
    """Find on which inertias loads act: the fewest that accelerate the deflections as the loads do."""
    found: list[list[Push]] = [[] for _ in range(len(order) + 1)]
    vectors = [(load.name, system.vector(load.shape)) for load in system.structure.driving]
    for name, vector in (*vectors, ("mean", system.vector("mean"))):
        along = (vector / np.diag(system.matrix("mass")))[order] * signs[order]
        moved = np.concatenate(([0.0], -np.cumsum(along)))
        fixed = [place for place in range(len(moved)) if place not in numbers]
        shifts = moved[fixed[:1]] if fixed else moved
        amounts = [moved - shift for shift in shifts]
        loaded = [np.abs(each) > _CLOSE * np.abs(moved).max() for each in amounts]
        # of equally few, those at the ends: an engine and what takes its mean torque
        counts = [(np.count_nonzero(each), np.count_nonzero(each[1:-1])) for each in loaded]
        best = counts.index(min(counts))
        for place in np.flatnonzero(loaded[best]):
            found[place].append(Push.of(name, amounts[best][place]))
    return found

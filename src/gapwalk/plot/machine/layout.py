"""The layout of a machine on a drawing of some width: bodies, elements between them, and texts that keep apart."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, zip_longest

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.contact import ContactForm
from gapwalk.model.drivetrain.train_assembly import TrainAssembly, TrainNumbers
from gapwalk.model.drivetrain.train_rows import LinkForm
from gapwalk.model.system import System
from gapwalk.plot.machine.elements import (
    BASE,
    HEIGHT,
    LETTER,
    STAGES,
    Body,
    Element,
    Link,
    Machine,
    Mover,
    Moves,
    Part,
    Pen,
    Point,
    Push,
    Scene,
    Shape,
    Span,
    combination,
    draw_element,
    elements_of,
    fitted,
    height_of,
    length_of,
)

# The order of bodies on a drawing: rows of bodies along the longest chain, then branches and loops.
#
# Each connection has one place. A row that goes on below, a branch, and a loop begin with a stub: the edge of a body
# that is drawn elsewhere.

WALL, BODY, STUB = "wall", "body", "stub"


@dataclass(frozen=True)
class Node:
    """The base, a body, or a stub of a body that is drawn elsewhere."""

    kind: str
    body: int = BASE


@dataclass(frozen=True)
class Slot:
    """The room between two nodes: links that fill it, and links of the right node to the base."""

    links: tuple[Link, ...] = ()
    to_base: tuple[Link, ...] = ()


@dataclass(frozen=True)
class Row:
    """Nodes from left to right, and the slots between them."""

    nodes: tuple[Node, ...]
    slots: tuple[Slot, ...] = ()


def rows_of(machine: Machine) -> list[Row]:
    """Return the rows of a machine, as long as they come out."""
    pairs: dict[frozenset[int], list[Link]] = {}
    held: dict[int, list[Link]] = {}
    for link in machine.links:
        if link.ends[1] == BASE:
            held.setdefault(link.ends[0], []).append(link)
        else:
            pairs.setdefault(frozenset(link.ends), []).append(link)
    near: dict[int, list[int]] = {number: [] for number in range(len(machine.bodies))}
    for pair in pairs:
        first, second = sorted(pair)
        near[first].append(second)
        near[second].append(first)
    whole = any(near.values()) or not machine.links  # bodies without links are drawn too
    rows, seen = [], set[int]()
    for start, others in near.items():
        if start in seen or not (others or start in held or whole):
            continue
        path = _longest(near, start, held)
        rows.append(_row([Node(BODY, each) for each in path], pairs, held))
        seen |= {*path}
        waiting = deque(path)
        while waiting:
            node = waiting.popleft()
            while following := _branch(near, node, seen):
                rows.append(_row([Node(STUB, node), *(Node(BODY, each) for each in following)], pairs, held))
                seen |= {*following}
                waiting.extend(following)
    # what is left of the pairs closes loops
    for pair in list(pairs):
        first, second = sorted(pair)
        rows.append(_row([Node(STUB, first), Node(STUB, second)], pairs, held))
    return rows


def _longest(near: dict[int, list[int]], start: int, held: dict[int, list[Link]]) -> list[int]:
    """Return the longest of the shortest ways through the bodies connected with one."""
    first = _ways(near, start)[-1][-1]
    path = max(_ways(near, first), key=len)
    if (path[-1] in held, -path[-1]) > (path[0] in held, -path[0]):
        path.reverse()
    return path


def _ways(near: dict[int, list[int]], start: int) -> list[list[int]]:
    """Return the shortest way to each connected body, the nearest ones first."""
    ways, waiting = {start: [start]}, deque([start])
    while waiting:
        node = waiting.popleft()
        for other in near[node]:
            if other not in ways:
                ways[other] = [*ways[node], other]
                waiting.append(other)
    return list(ways.values())


def _branch(near: dict[int, list[int]], node: int, seen: set[int]) -> list[int]:
    """Return bodies not drawn yet, one after the other, beginning beside a body that is."""
    found: list[int] = []
    while following := [each for each in near[node] if each not in seen and each not in found]:
        node = following[0]
        found.append(node)
    return found


def _row(nodes: list[Node], pairs: dict[frozenset[int], list[Link]], held: dict[int, list[Link]]) -> Row:
    """Make a row; it takes the links that it draws."""
    slots = [
        Slot(tuple(_along(link, before.body) for link in pairs.pop(frozenset((before.body, after.body)), [])))
        for before, after in pairwise(nodes)
    ]
    last = len(nodes) - 1
    whole, left, right = [*nodes], (), ()
    for place, node in enumerate(nodes):
        links = tuple(held.pop(node.body, ())) if node.kind == BODY else ()
        if not links:
            continue
        if not place:
            left, right = _sides(links) if not last else (links, ())
        elif place < last:
            slots[place - 1] = replace(slots[place - 1], to_base=links)
        else:
            right = links
    if right:
        whole, slots = [*whole, Node(WALL)], [*slots, Slot(right)]
    if left:
        turned = tuple(Link((BASE, link.ends[0]), -link.sign, link.elements) for link in left)
        whole, slots = [Node(WALL), *whole], [Slot(turned), *slots]
    return Row(tuple(whole), tuple(slots))


def _sides(links: Iterable[Link]) -> tuple[tuple[Link, ...], tuple[Link, ...]]:
    """Put contacts of a body without neighbours on its right, and its springs on its left."""
    left, right = [], []
    for link in links:
        own = tuple(each for each in link.elements if not each.contact)
        others = tuple(each for each in link.elements if each.contact)
        if own:
            left.append(Link(link.ends, link.sign, own))
        if others:
            right.append(Link(link.ends, link.sign, others))
    return tuple(left), tuple(right)


def _along(link: Link, first: int) -> Link:
    """Turn a link so that it begins at a body."""
    return link if link.ends[0] == first else Link((link.ends[1], link.ends[0]), -link.sign, link.elements)


# The machine of a system of matrices: what its mass and stiffness matrices and the directions of its contacts say.
#
# A symmetric stiffness matrix is a set of springs: ``-K_ij`` between two coordinates, and the sum of a row to the
# base. Equations that were divided by their masses are multiplied by them first. Where a force acts in more equations
# than its deflection has coordinates, coordinates are deflections of a chain (Padmanabhan and Singh 1995, equations 11
# to 18):
#
#     x'' = -P (k x + f) with P = W J^-1 W^T
#
# Then ``-1 / P_ij`` is the inertia between two springs. What is neither is drawn as coupled coordinates.

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
            label = "gyroscopic" if what == "damping" and value == -back else what
            yield Element("coupling", label, f"coupled by the {what} matrix")
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


# The machine of a drive train: its inertias, shafts and gears, from its own topology.

MOST_INERTIAS = 24
"""Inertias of a train that is drawn whole; of a longer one, only links with contacts are."""


def machine_of_train(system: System, assembly: TrainAssembly) -> Machine:
    """Return the machine of a train, with displacements referred to the first inertia."""
    form, numbers = assembly.form, assembly.numbers(system.values)
    speeds = numbers.referring
    rows = np.real(numbers.angles) / speeds[:, None]
    loads: list[list[Push]] = [[] for _ in form.inertias]
    # a displacement is the angle divided by the speed: the torque of an inertia that turns backwards pushes back
    constant, *others = numbers.torques
    # to the others only drags give a mean torque
    given = {form.reaction, *(each for each in form.loaded if system[f"mean.{form.inertias[each]}"])}
    for part, sizes, lines in zip(form.acting, others, numbers.sizes[1:], strict=True):
        if part.reacts:
            constant = constant + sizes * sum(line.cosine for line in lines)
            given |= {*np.flatnonzero(sizes).tolist()}
            continue
        for number in np.flatnonzero(sizes):
            loads[number].append(Push.of(part.form.name, float(np.real(sizes[number])) * speeds[number]))
    for number, mean in enumerate(np.real(constant).tolist()):
        if mean and number in given:
            name = "reaction" if number == form.reaction else "mean"
            loads[number].append(Push.of(name, mean * speeds[number]))
    bodies = tuple(
        Body(name, _indices(row), float(mass), f"{name}''", tuple(loads[number]))
        for number, (name, row, mass) in enumerate(
            zip(form.inertias, rows.tolist(), np.real(numbers.inertia).tolist(), strict=True)
        )
    )
    displaced = {link for torque in form.torques for link, _ in torque.displaces}
    notes = []
    links = tuple(_link(system, numbers, place, place in displaced) for place in range(len(form.links)))
    if len(bodies) > MOST_INERTIAS:
        notes.append(f"{len(bodies)} inertias: only the shafts and gears with contacts are drawn")
        links = tuple(link for link in links if any(each.contact for each in link.elements))
    if np.ptp(speeds):
        notes.append(f"angles are referred to {form.inertias[0]}")
    return Machine(bodies, links, tuple(notes), turns=True)


def _indices(row: list[float]) -> tuple[tuple[int, float], ...]:
    return tuple((place, factor) for place, factor in enumerate(row) if factor)


def _link(system: System, numbers: TrainNumbers, place: int, is_displaced: bool) -> Link:
    form, speeds, ratio = numbers.form, numbers.referring, float(np.real(numbers.ratios[place]))
    link = form.links[place]
    elements = tuple(_elements(system, link, ratio, is_displaced))
    first, second = link.ends
    if first == form.ground:  # the base is always second
        return Link((second, BASE), -int(np.sign(ratio * speeds[second])), elements)
    return Link((first, BASE if second == form.ground else second), int(np.sign(speeds[first])), elements)


def _elements(system: System, link: LinkForm, ratio: float, is_displaced: bool) -> Iterator[Element]:
    signal = f"{link.name}.torque"
    geared = f", ratio {ratio:.4g}" if link.geared else ""
    what = "gear" if link.geared else "mesh of a planetary set" if link.row else "shaft"
    label = link.name + "(θ)" * is_displaced
    named = False
    if link.rigid:
        yield Element("gear", label, f"{link.name}: rigid {what}{geared}")
        return
    if link.always:
        stiffness = _with_unit(system, f"{link.name}.stiffness")
        yield Element("spring", label, f"{link.name}: {what}{geared}, stiffness {stiffness}", "", signal)
        named = True
    for form in link.parts:
        of_link = form.name == link.name
        for number, element in enumerate(elements_of(system, form, "" if not of_link or named else label)):
            yield _renamed(element, number, of_link and named)
        named = named or of_link
    for what, words in (("damping", "damper"), ("linear", "drag"), ("constant", "constant drag")):
        number = f"{link.name}.{what}"
        if number in system.parameters and system[number] and not (named and what == "constant"):
            words = f"{link.name}: {words}{geared}, {_with_unit(system, number)}"
            yield Element("damper", "" if named else label, words, "", signal)
            return


def _renamed(element: Element, number: int, is_later: bool) -> Element:
    """Number the stages of a link after the spring that acts always, which is the first."""
    if not is_later:
        return element
    return replace(element, name=STAGES[min(number, len(STAGES) - 1)])


def _with_unit(system: System, name: str) -> str:
    unit = system.units.parameter(name) if system.units else ""
    return f"{system[name]:.4g} {unit}".strip()


NARROW, WIDE = 330.0, 660.0
"""Widths of a drawing, in pixels: of a panel of the explorer, and of a page."""

_SLOT = 58.0, 94.0, 150.0  # width between two bodies: the least, that of a contact, the largest (of a long name)
_WALL, _STUB, _PLACE = 10.0, 12.0, 34.0  # widths
_BODY = 26.0, 38.0  # least and largest width of a body, the latter of the heaviest
_MARGIN, _APART = 8.0, 22.0  # round the drawing, and between two rows side by side
_LEAST = 40.0  # height of a body
_NAMES, _LOADS = 17.0, 24.0  # heights of the band of names below a row, and of that of loads above it
_LOCAL = 22.0  # from the left end of a slot to a wall within it

_Pair = tuple[float, float]


@dataclass(frozen=True)
class _Piece:
    """A row, or what of it fits into the width, at its place from the left."""

    row: Row
    widths: tuple[float, ...]
    x: float = 0.0

    @property
    def width(self) -> float:
        return sum(self.widths) + sum(map(_slot_width, self.row.slots))


def machine_of(system: System) -> Machine:
    """Return the bodies and elements of a system: of its train, or of its matrices."""
    assembly = system.structure.assembly
    if isinstance(assembly, TrainAssembly):
        return machine_of_train(system, assembly)
    return machine_of_matrices(system.equations)


def scene_of(system: System, width: float = WIDE) -> Scene:
    """Return the drawing of the machine of a system."""
    machine = machine_of(system)
    edges = [edge for link in machine.links for each in link.elements for edge in each.edges if edge]
    pen = Pen(max(edges, default=1.0))
    for body in machine.bodies:
        pen.mover(Mover("body", body.row))
    heaviest = max((body.mass for body in machine.bodies), default=0.0)
    wide = [_width(body.mass, heaviest) for body in machine.bodies]
    top = _MARGIN
    for line in _lines(rows_of(machine), wide, width - 2.0 * _MARGIN):
        top = _draw_line(pen, machine, line, top, width - _MARGIN)
    for note in machine.notes:
        for text in _wrapped(note, width - 2.0 * _MARGIN):
            top += LETTER + 3.0
            pen.part = -1
            pen.text("note", _MARGIN, top, text, "start")
    drawn = tuple(pen.movers), tuple(pen.parts), tuple(pen.shapes)
    right = min(width, _right(pen.shapes) + _MARGIN)
    return Scene(right, top + _MARGIN, _words(machine), *drawn, machine.notes)


def _right(shapes: Sequence[Shape]) -> float:
    """Return where a drawing ends on the right."""
    texts = (each.points[0].x + length_of(each.text) * (0.5 + 0.5 * (each.anchor == "start")) for each in shapes)
    return max((*texts, *(point.x for each in shapes for point in each.points)), default=0.0)


def _width(mass: float, heaviest: float) -> float:
    if not mass:
        return _PLACE
    return _BODY[0] + (_BODY[1] - _BODY[0]) * (mass / heaviest) ** (1.0 / 3.0)


def _words(machine: Machine) -> str:
    bodies = [body.name for body in machine.bodies if body.mass]
    links = [each.name for link in machine.links for each in link.elements if each.contact and each.name]
    return f"Machine: {', '.join(bodies) or 'contacts'}" + (f"; contacts {', '.join(links)}" if links else "")


def _wrapped(text: str, room: float) -> list[str]:
    lines, line = [], ""
    for word in text.split():
        if line and length_of(f"{line} {word}") > room:
            lines.append(line)
            line = word
        else:
            line = f"{line} {word}".strip()
    return [*lines, line]


def _lines(rows: Sequence[Row], wide: Sequence[float], width: float) -> list[list[_Piece]]:
    """Break rows that are too long, and put short ones side by side."""
    lines: list[list[_Piece]] = []
    left = 0.0
    for row in rows:
        for piece in _broken(row, wide, width):
            if lines and left + _APART + piece.width <= width:
                piece = _Piece(piece.row, piece.widths, left + _APART)
                lines[-1].append(piece)
            else:
                lines.append([piece])
            left = piece.x + piece.width
    return lines


def _broken(row: Row, wide: Sequence[float], width: float) -> list[_Piece]:
    pieces: list[_Piece] = []
    nodes, slots = [row.nodes[0]], list[Slot]()
    total = _node_width(row.nodes[0], wide)
    for slot, node in zip(row.slots, row.nodes[1:], strict=True):
        more = _slot_width(slot) + _node_width(node, wide)
        if slots and total + more > width and nodes[-1].kind == BODY:
            pieces.append(_piece(nodes, slots, wide))
            nodes, slots, total = [Node(STUB, nodes[-1].body)], [], _STUB
        nodes.append(node)
        slots.append(slot)
        total += more
    return [*pieces, _piece(nodes, slots, wide)]


def _piece(nodes: Sequence[Node], slots: Sequence[Slot], wide: Sequence[float]) -> _Piece:
    return _Piece(Row(tuple(nodes), tuple(slots)), tuple(_node_width(node, wide) for node in nodes))


def _node_width(node: Node, wide: Sequence[float]) -> float:
    return {WALL: _WALL, STUB: _STUB}.get(node.kind) or wide[node.body]


def _draw_line(pen: Pen, machine: Machine, line: Sequence[_Piece], top: float, right: float) -> float:
    """Draw pieces side by side, and return where the next line begins."""
    loaded = any(node.kind == BODY and machine.bodies[node.body].loads for piece in line for node in piece.row.nodes)
    top += _LOADS if loaded else 4.0
    slots = [slot for piece in line for slot in piece.row.slots]
    height = max([_LEAST, *(_slot_height(slot) + 6.0 for slot in slots)])
    for place, piece in enumerate(line):
        end = _MARGIN + line[place + 1].x - 4.0 if place + 1 < len(line) else right + 4.0
        _draw_piece(pen, machine, piece, top, height, end)
    return top + height + _NAMES


def _slot_width(slot: Slot) -> float:
    elements = [each for link in (*slot.links, *slot.to_base) for each in link.elements]
    room = max([_SLOT[0], *(length_of(each.name) + 16.0 for each in elements)])
    if any(each.contact for each in elements):
        room = max(_SLOT[1], room)
    return min(_SLOT[2], room) + _LOCAL * bool(slot.to_base)


def _slot_height(slot: Slot) -> float:
    return sum(height_of(each) for link in (*slot.links, *slot.to_base) for each in link.elements)


def _draw_piece(pen: Pen, machine: Machine, piece: _Piece, top: float, height: float, end: float) -> None:
    x = _MARGIN + piece.x
    places = []
    for width, slot in zip_longest(piece.widths, piece.row.slots):
        places.append((x, x + width))
        x += width + (_slot_width(slot) if slot else 0.0)
    for slot, (_, x0), (x1, _), before, after in zip(
        piece.row.slots, places, places[1:], piece.row.nodes, piece.row.nodes[1:], strict=False
    ):
        y = top + 3.0 + 0.5 * (height - 6.0 - _slot_height(slot))
        for link in slot.links:
            for element in link.elements:
                _draw_one(pen, element, Span(x0, x1, y, before.body, after.body, link.sign))
                y += height_of(element)
        for link in slot.to_base:
            start = y
            for element in link.elements:
                _draw_one(pen, element, Span(x0 + _LOCAL, x1, y, BASE, after.body, -link.sign))
                y += height_of(element)
            pen.part = -1
            _wall(pen, x0 + _LOCAL, start + 3.0, y - 1.0, left=True)
    _draw_nodes(pen, machine, piece, places, top, height, end)


def _draw_one(pen: Pen, element: Element, span: Span) -> None:
    """Draw an element with its texts, from the top of its room, which is the `y` of the span."""
    top, name = span.y, 13.0 * bool(element.name)
    box = (span.x0 + 1.0, top, span.x1 - 1.0, top + height_of(element))
    pen.parts.append(
        Part(element.kind, element.name or element.kind, element.words, element.contact, element.signal, box)
    )
    pen.part = len(pen.parts) - 1
    room, middle = span.x1 - span.x0 - 14.0, 0.5 * (span.x0 + span.x1)
    if element.name:
        pen.text("name", middle, top + 10.0, fitted(element.name, room))
    draw_element(
        pen, element, Span(span.x0, span.x1, top + name + 0.5 * HEIGHT + 1.0, span.left, span.right, span.sign)
    )
    if element.contact:
        pen.text("state", middle, top + name + HEIGHT + 12.0, fitted(element.detail, room))


def _wall(pen: Pen, x: float, y0: float, y1: float, *, left: bool) -> None:
    """Draw a wall whose face is at x, hatched on its left or right side."""
    side = -1.0 if left else 1.0
    for k in range(int((y1 - y0) // 7)):
        y = y0 + 3.0 + 7.0 * k
        pen.line("hatch", Point(x, y), Point(x + 6.0 * side, y + 6.0))
    pen.line("wall", Point(x, y0), Point(x, y1))


def _draw_nodes(
    pen: Pen,
    machine: Machine,
    piece: _Piece,
    places: Sequence[tuple[float, float]],
    top: float,
    height: float,
    end: float,
) -> None:
    nodes, whole = piece.row.nodes, (_MARGIN + piece.x - 2.0, end)
    named = [k for k, node in enumerate(nodes) if node.kind != WALL]
    names = _rooms({k: places[k] for k in named}, whole, [length_of(machine.bodies[nodes[k].body].name) for k in named])
    loaded = (k for k, node in enumerate(nodes) if node.kind == BODY and machine.bodies[node.body].loads)
    loads = _rooms({k: places[k] for k in loaded}, whole)
    for place, node in enumerate(nodes):
        if node.kind != WALL:
            _draw_body(pen, machine, node, places[place], (top, height), names[place])
        if place in loads:
            _draw_loads(pen, machine.bodies[node.body].pushes, node.body, places[place], top, loads[place])
    pen.part = -1
    for place, node in enumerate(piece.row.nodes):
        if node.kind == WALL:
            x0, x1 = places[place]
            _wall(pen, x1 if not place else x0, top, top + height, left=not place)


def _rooms(places: dict[int, _Pair], whole: _Pair, lengths: Sequence[float] = ()) -> dict[int, _Pair]:
    """Share a row among texts below or above some of its places: each has the room half way to the next.

    A text that is longer than that takes what the next one leaves.
    """
    centres, edges = [0.5 * sum(place) for place in places.values()], [whole[0]]
    for number, (a, b) in enumerate(pairwise(centres)):
        own, other = lengths[number : number + 2] if lengths else (0.0, 0.0)
        middle, need, most = 0.5 * (a + b), edges[-1] + own + 4.5, b - 0.5 * other - 2.0
        edges.append(need if middle < need <= most else middle)
    edges.append(whole[1])
    return {k: (low + 2.0, high - 2.0) for k, (low, high) in zip(places, pairwise(edges), strict=False)}


def _draw_body(
    pen: Pen,
    machine: Machine,
    node: Node,
    across: tuple[float, float],
    down: tuple[float, float],
    room: tuple[float, float],
) -> None:
    body, (x0, x1), (top, height) = machine.bodies[node.body], across, down
    moves: Moves = ((node.body, 1.0),)
    middle, bottom = 0.5 * (x0 + x1), top + height
    stub = node.kind == STUB
    words = f"{body.name}, goes on here" if stub else body.name
    if body.loads and not stub:
        words += f"; loads: {', '.join(body.loads)}"
    pen.parts.append(Part("body", body.name, words, "", body.signal, (x0, top, x1, bottom + 14.0)))
    pen.part = len(pen.parts) - 1
    if stub:
        pen.box("stub", x0, top, x1, bottom, moves)
    elif not body.mass:
        pen.line("stroke", Point(x1, top + 4.0, moves), Point(x1, bottom - 4.0, moves))
        pen.circle("body", Point(x1 - 6.0, 0.5 * (top + bottom), moves), 6.0)
    else:
        pen.box("body", x0, top, x1, bottom, moves)
        if machine.turns:  # a disc seen from its edge
            for x in (x0 + 5.0, x1 - 5.0):
                pen.line("thin", Point(x, top + 1.0, moves), Point(x, bottom - 1.0, moves))
    _beside(pen, "name", body.name, middle, bottom + 12.0, room)


def _draw_loads(pen: Pen, pushes: Sequence[Push], body: int, across: _Pair, top: float, room: _Pair) -> None:
    """Draw the arrow of loads above a body, with their names, or how many there are."""
    # Loads in both directions have an arrow with two heads.
    x, y, moves = 0.5 * sum(across), top - 6.0, ((body, 1.0),)
    ways, names = {push.way for push in pushes}, [push.label for push in pushes]
    left, right = (9.0 if way in ways else 15.0 for way in (-1, 1))
    pen.line("load", Point(x - left, y, moves), Point(x + right, y, moves))
    for way in sorted(ways):
        head = ((16.0, 0.0), (8.0, -3.5), (8.0, 3.5))
        pen.area("load-head", *(Point(x + way * dx, y + dy, moves) for dx, dy in head))
    text, wide = ", ".join(names), room[1] - room[0]
    if length_of(text) > wide and names[1:]:
        text = f"{len(names)} loads"
    _beside(pen, "load-name", text, x, top - 13.0, room)


def _beside(pen: Pen, look: str, text: str, x: float, y: float, room: _Pair) -> None:
    """Write a text as near to a place as its room allows."""
    text = fitted(text, room[1] - room[0])
    half = 0.5 * length_of(text)
    pen.text(look, max(room[0] + half, min(x, room[1] - half)), y, text)

"""Random systems to be walked: each seed gives one, five in a row share their structure and so their compiled flow."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk import Contact, Harmonic, Side, Stage, System
from gapwalk.train import Inertia, Shaft, Train

SHARED = 5  # neighbouring seeds with one structure: compiling takes as long as a walk
_LAWS = ("elastic", "hunt-crossley", "hunt-crossley", "viscous")
_STIFFER = 30.0  # largest ratio of a stage's stiffness to the rest


class Task(NamedTuple):
    """What to walk: from which system, along which parameter, and up to where."""

    system: System
    parameter: str
    to: float


def random_task(seed: int) -> Task:
    """A damped system with gaps of one to four degrees of freedom, and a parameter to walk it along."""
    shape = np.random.default_rng([seed // SHARED, 8])
    numbers = np.random.default_rng([seed, 80])
    make = (_oscillator, _chain, _dense, _drive_train)[int(shape.integers(4))]
    system = make(shape, numbers)
    slow, fast = _natural_frequencies(system)
    low, high = max(0.35 * slow, 0.12 * fast), 1.4 * fast
    match int(numbers.integers(6)):
        case 0:
            system = system.at(frequency=numbers.uniform(low, min(1.3 * fast, 4.0 * slow)))
            name = "harmonic1.amplitude"
            return Task(system.at({name: 0.05 * system[name]}), name, 2.5 * system[name])
        case 1:
            system = system.at(frequency=numbers.uniform(low, min(1.3 * fast, 4.0 * slow)))
            name = _first_clearance(system)
            return Task(system.at({name: 0.02 * system[name]}), name, 1.0 * system[name])
        case _:
            return Task(system.at(frequency=high), "frequency", low)


def _first_clearance(system: System) -> str:
    contact = system.structure.contacts[0]
    return f"{contact.stage_prefix(contact.stages[0])}.clearance"


def _natural_frequencies(system: System) -> tuple[float, float]:
    """The lowest and the highest natural frequency with the first stage of every contact closed."""
    equations = system.equations
    stiffness = equations.matrix("stiffness").copy()
    for contact in equations.structure.contacts:
        slope = equations[f"{contact.stage_prefix(contact.stages[0])}.stiffness"]
        e = np.array([equations[f"{contact.name}.deflection.{q}"] for q in equations.coordinates])
        which = "deflection" if contact.reciprocal else "force"
        d = np.array([equations[f"{contact.name}.{which}.{q}"] for q in equations.coordinates])
        stiffness += slope * np.outer(d, e)
    squares = np.linalg.eigvals(np.linalg.solve(equations.matrix("mass"), stiffness)).real
    frequencies = np.sqrt(squares[squares > 1e-3])
    return float(frequencies.min()), float(frequencies.max())


def _contact(
    shape: np.random.Generator, numbers: np.random.Generator, name: str, deflection: dict[str, float], unit: float
) -> Contact:
    law = _LAWS[int(shape.integers(len(_LAWS)))]
    return Contact(
        name,
        deflection,
        _stages(shape, numbers, unit),
        None,
        law,
        {
            "impact_damping": numbers.uniform(0.01, 0.3) if law == "hunt-crossley" else 0.0,
            "viscous_damping": numbers.uniform(0.01, 0.2) if law == "viscous" else 0.0,
        },
    )


def _stages(shape: np.random.Generator, numbers: np.random.Generator, unit: float) -> tuple[Stage, ...]:
    """One to three stages; stiffnesses in units of `unit`."""
    count, stages, clearance = int(shape.choice([1, 1, 2, 3])), [], 0.0
    for index in range(count):
        clearance += numbers.uniform(0.1, 1.0)
        side = shape.choice([Side.BOTH, Side.BOTH, Side.POSITIVE, Side.NEGATIVE])
        cubic = float(shape.choice([0.0, 0.0, 0.0, 1.0])) * numbers.uniform(0.1, 1.0) * unit
        stiffness = unit * _STIFFER ** numbers.uniform(-0.2, 1.0 if index else 0.6)
        stages.append(Stage(clearance, stiffness, cubic, Side(str(side)), f"s{index + 1}" if count > 1 else ""))
    return tuple(stages)


def _harmonics(
    shape: np.random.Generator, numbers: np.random.Generator, names: list[str], unit: float
) -> list[Harmonic]:
    """One to three harmonics of the first orders, the first of them on the first coordinate."""
    orders = [1, *shape.choice([2, 3, 4], int(shape.choice([0, 0, 1, 2])), replace=False)]
    harmonics = []
    for index, order in enumerate(orders):
        size = unit * (numbers.uniform(0.3, 1.5) if index == 0 else numbers.uniform(0.05, 0.5))
        on = names[0] if index == 0 else names[int(shape.integers(len(names)))]
        harmonics.append(Harmonic(size, {on: 1.0}, int(order), numbers.uniform(-3.0, 3.0) if index else 0.0))
    return harmonics


def _mean(shape: np.random.Generator, numbers: np.random.Generator, names: list[str], unit: float) -> dict[str, float]:
    if shape.random() < 0.3:
        return {}  # symmetric where all contacts are: pitchforks
    return {name: unit * numbers.normal() * 0.4 for name in names}


def _damping(numbers: np.random.Generator) -> float:
    return 10.0 ** numbers.uniform(-2.0, -0.9)


def _oscillator(shape: np.random.Generator, numbers: np.random.Generator) -> System:
    """One mass between stops, on a soft spring."""
    contacts = [_contact(shape, numbers, f"c{k + 1}", {"x": 1.0}, 1.0) for k in range(int(shape.choice([1, 1, 2])))]
    return System(
        ("x",),
        [[numbers.uniform(0.05, 1.0)]],
        [[2.0 * _damping(numbers)]],
        contacts=contacts,
        mean=_mean(shape, numbers, ["x"], 1.0),
        harmonics=_harmonics(shape, numbers, ["x"], 0.8),
    )


def _chain(shape: np.random.Generator, numbers: np.random.Generator) -> System:
    """Two to four masses in a row, with gaps between neighbours or to the ground."""
    n = int(shape.choice([2, 2, 3, 4]))
    names = [f"q{i + 1}" for i in range(n)]
    springs = numbers.uniform(0.5, 1.5, n + 1)
    stiffness = np.diag(springs[:-1] + springs[1:]) - np.diag(springs[1:-1], 1) - np.diag(springs[1:-1], -1)
    contacts = []
    for k, place in enumerate(shape.choice(n, int(shape.choice([1, 1, 2])), replace=False)):
        deflection = {names[place]: 1.0}
        if place and shape.random() < 0.5:
            deflection[names[place - 1]] = -1.0
        contacts.append(_contact(shape, numbers, f"c{k + 1}", deflection, 1.0))
    return System(
        names,
        stiffness,
        _damping(numbers) * (stiffness + 0.5 * np.eye(n)),
        np.diag(numbers.uniform(0.5, 2.0, n)),
        contacts,
        _mean(shape, numbers, names, 0.6),
        _harmonics(shape, numbers, names, 0.6),
    )


def _definite(numbers: np.random.Generator, n: int, low: float, high: float) -> NDArray[np.float64]:
    basis = np.linalg.qr(numbers.normal(size=(n, n)))[0]
    return basis @ np.diag(numbers.uniform(low, high, n)) @ basis.T


def _dense(shape: np.random.Generator, numbers: np.random.Generator) -> System:
    """Two or three coordinates that all act on each other, and gaps in combinations of them."""
    n = int(shape.choice([2, 2, 3]))
    names = [f"q{i + 1}" for i in range(n)]
    contacts = [
        _contact(shape, numbers, f"c{k + 1}", dict(zip(names, numbers.normal(size=n), strict=True)), 0.7)
        for k in range(int(shape.choice([1, 1, 2])))
    ]
    return System(
        names,
        _definite(numbers, n, 0.3, 2.0),
        _damping(numbers) * _definite(numbers, n, 0.5, 2.0),
        _definite(numbers, n, 0.5, 2.0),
        contacts,
        _mean(shape, numbers, names, 0.5),
        _harmonics(shape, numbers, names, 0.5),
    )


def _drive_train(shape: np.random.Generator, numbers: np.random.Generator) -> System:
    """An engine, one to three more inertias, a clutch of some stages, perhaps a gear with backlash; it runs free."""
    n = int(shape.choice([2, 3, 3, 4]))
    inertias = [Inertia(f"J{i + 1}", numbers.uniform(0.3, 3.0)) for i in range(n)]
    with_gap = {0, n - 2} if shape.random() < 0.5 else {0}  # links
    share, links = _damping(numbers), []
    for i in range(n - 1):
        stiffness = numbers.uniform(0.05, 0.5) if i in with_gap else numbers.uniform(1.0, 4.0)
        stages = _stages(shape, numbers, 1.0) if i in with_gap else ()
        links.append(
            Shaft(
                f"s{i + 1}",
                (f"J{i + 1}", f"J{i + 2}"),
                stiffness=stiffness,
                damping=2.0 * share * np.sqrt(stiffness) + 0.02,
                stages=stages,
                impact_damping=numbers.uniform(0.01, 0.3) if stages else None,
            )
        )
    load = numbers.uniform(0.0, 0.8)
    return Train(
        inertias,
        links,
        mean={"J1": load, f"J{n}": -load},
        harmonics=_harmonics(shape, numbers, ["J1"], 0.8),
        frequency=1.0,
    ).system()

"""Kinds of random machines, each a function of a seed: ``@kind("name")`` adds one to those that are compared."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import gapwalk as gw
from tests.bifurcation.alike.machine import Machine
from tests.bifurcation.equal_parts import equal_parts
from tests.gyroscopic import gyroscopic_machine

Draw = Callable[[int], Machine]
KINDS: dict[str, Draw] = {}
"""The kinds by name."""

_SHARED = 10  # neighbouring seeds with one structure, so that it is compiled once


def kind(name: str) -> Callable[[Draw], Draw]:
    """Add a kind of random machines."""

    def added(draw: Draw) -> Draw:
        KINDS[name] = draw
        return draw

    return added


def machine_of(name: str) -> Machine:
    """Return the machine of a name such as ``preload 3``."""
    word, seed = name.rsplit(" ", 1)
    return KINDS[word](int(seed))


def generators(seed: int, stream: int) -> tuple[np.random.Generator, np.random.Generator]:
    """Return the generator of a structure, which neighbouring seeds share, and that of its numbers."""
    return np.random.default_rng([seed // _SHARED, stream]), np.random.default_rng([seed, 10 * stream])


def chain(springs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the stiffness matrix of a chain between two walls, with one spring more than masses."""
    return np.diag(springs[:-1] + springs[1:]) - np.diag(springs[1:-1], 1) - np.diag(springs[1:-1], -1)


@kind("preload")
def preloaded(seed: int) -> Machine:
    """One or two masses with one to three preloaded stages on one contact or two, on one side or on both."""
    shape, numbers = generators(seed, 40)
    n = int(shape.choice([1, 2]))
    names = tuple(f"q{number + 1}" for number in range(n))
    contacts = []
    for place in range(int(shape.choice([1, 1, n]))):
        side, count = str(shape.choice(["both", "positive", "negative"])), int(shape.choice([1, 1, 2, 3]))
        stages = []
        for number, clearance in enumerate(numbers.uniform(0.3, 1.3) + np.cumsum(numbers.uniform(0.2, 0.6, count))):
            preload = {"preload": 10.0 ** numbers.uniform(-2.0, 0.0)}
            stiffness = 10.0 ** numbers.uniform(-0.5, 1.3)
            stages.append(gw.Stage(float(clearance) - 0.2, stiffness, side=side, name=f"s{number}", numbers=preload))
        relative = n == 2 and shape.random() < 0.5
        deflection = {names[0]: 1.0, names[-1]: -1.0} if relative else {names[-1 - place]: 1.0}
        contacts.append(gw.Contact(f"p{place}", deflection, stages, law="piecewise"))
    return Machine(
        names,
        chain(numbers.uniform(0.3, 1.2, n + 1)),
        np.diag(numbers.uniform(0.05, 0.2, n)),
        np.diag(numbers.uniform(0.7, 1.3, n)),
        tuple(contacts),
        (gw.Harmonic(numbers.uniform(0.3, 0.8), {names[0]: 1.0}),),
        0.3,
        2.2,
        {names[0]: 0.3 * numbers.normal() * float(shape.random() < 0.5)},
    )


@kind("equal")
def two_equal_parts(seed: int) -> Machine:
    """Two equal parts with gaps, in which two multipliers become critical at once."""
    return equal_parts(np.random.default_rng([seed, 410]))


@kind("rotor")
def rotor(seed: int) -> Machine:
    """A rotor with gyroscopic terms and gaps, which a large load closes."""
    machine = gyroscopic_machine(np.random.default_rng([seed, 420]))
    (load,) = machine.harmonics
    return replace(machine, harmonics=(replace(load, amplitude=5.0 * load.amplitude),))


@kind("friction")
def friction(seed: int) -> Machine:
    """A mass that two or three friction elements hold, at most one of them rigid, with or without a stop."""
    shape, numbers = generators(seed, 41)
    count, rigid = int(shape.integers(2, 4)), int(shape.integers(6))
    contacts = [
        gw.friction(name, {"x": 1.0}, numbers.uniform(0.1, 0.4), stiffness=None if place == rigid else stiffness)
        for place, (name, stiffness) in enumerate(zip("abc", numbers.uniform(1.0, 5.0, count), strict=False))
    ]
    if shape.random() < 0.5:
        contacts.append(gw.backlash("gap", {"x": 1.0}, numbers.uniform(2.0, 10.0), 0.4))
    # without a spring the mean load may drag the mass away for ever
    spring, slow = numbers.uniform(0.2, 1.0), numbers.uniform(0.6, 1.4)
    return Machine(
        ("x",),
        np.array([[spring]]),
        np.array([[numbers.uniform(0.03, 0.1)]]),
        np.array([[numbers.uniform(0.5, 1.5)]]),
        tuple(contacts),
        (
            gw.Harmonic(numbers.uniform(0.15, 0.5), {"x": 1.0}),
            gw.Harmonic(numbers.uniform(0.0, 0.2), {"x": 1.0}, 2, numbers.uniform(0.0, 6.28)),
        ),
        slow,
        1.6 * slow,
        {"x": numbers.uniform(-0.08, 0.08)},
    )

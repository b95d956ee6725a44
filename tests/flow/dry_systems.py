"""Systems with dry friction and rigid stops, by name, each with a state from which motions begin."""

import numpy as np

import gapwalk as gw
from gapwalk.model.contact import Contact, Side, Stage, friction
from gapwalk.model.laws import Coulomb, Hysteretic, Jenkins, Rigid

ONE, TWO = ("x",), ("x", "y")
SOFT, LOSS = [[2.0, -1.0], [-1.0, 1.5]], [[0.1, 0.0], [0.0, 0.1]]
CLUTCH = Contact(
    "c",
    {"x": 1.0},
    [Stage(0.2, 3.0, name="a", numbers={"hysteresis": 0.2}), Stage(0.8, 5.0, name="b", numbers={"hysteresis": 0.4})],
    law=Hysteretic("viscous"),
    viscous_damping=0.1,
)


def load(amplitude=1.0, **acts_on):
    """Return a harmonic load, by default on x."""
    return gw.Harmonic(amplitude, acts_on or {"x": 1.0})


def stop(clearance, restitution, side=Side.POSITIVE):
    """Return a rigid stop on x."""
    return Contact("w", {"x": 1.0}, [Stage(clearance, side=side)], law=Rigid(), restitution=restitution)


def system(coordinates, stiffness, contacts, damping=None, mass=None, frequency=0.5, loads=None):
    """Return a system."""
    loss = damping if damping is not None else (0.05 * np.eye(len(coordinates))).tolist()
    return gw.System(
        coordinates, stiffness, loss, mass, contacts=contacts, harmonics=loads or [load()], frequency=frequency
    )


def clutch(limit, *, stiffness=None, phase=0.0):
    """Return the clutch of figure 13 of the paper, with friction on the rate of q1."""
    stage = Contact(
        "stage2",
        {"q1": 1.0},
        [Stage(1.0, 1.0)],
        force={"q1": 0.9, "q3": -0.54},
        law="hunt-crossley",
        impact_damping=0.05,
    )
    lining = friction("lining", {"q1": 1.0}, limit, stiffness=stiffness, force={"q1": 1.0, "q3": -0.6})
    return gw.System(
        ("q1", "q3"),
        [[0.1, -0.6], [-0.06, 1.1]],
        [[0.04, -0.04], [-0.04, 0.06]],
        mean={"q1": 0.25, "q3": 0.25},
        contacts=[stage, lining],
        harmonics=[gw.Harmonic(0.25, {"q1": 1.0}, phase=phase)],
        frequency=2.0,
    )


SYSTEMS = {
    "stick": system(ONE, [[1.0]], [friction("f", {"x": 1.0}, 0.75)], [[0.0]]),
    "static": system(ONE, [[1.0]], [friction("f", {"x": 1.0}, 0.5, static=1.4)], [[0.0]]),
    "belt": system(ONE, [[1.0]], [friction("f", {"x": 1.0}, 0.5, static=1.4, speed=0.3)], loads=[load(0.3)]),
    "two rigid": system(
        TWO, SOFT, [friction("f", {"x": 1.0}, 0.3), friction("g", {"x": -1.0, "y": 1.0}, 0.4)], LOSS, frequency=0.45
    ),
    "acts elsewhere": system(
        TWO,
        SOFT,
        [
            friction("f", {"x": 1.0}, 0.3, static=1.3, force={"x": 1.0, "y": -0.4}),
            friction("g", {"x": -1.0, "y": 1.0}, 0.4, static=1.2),
        ],
        LOSS,
        frequency=0.45,
    ),
    "jenkins": system(ONE, [[1.0]], [friction("f", {"x": 1.0}, 0.3, stiffness=2.0)]),
    "iwan": system(
        TWO,
        SOFT,
        [
            friction("f", {"x": 1.0}, 0.3, stiffness=3.0),
            friction("g", {"x": 1.0}, 0.2, stiffness=1.0),
            friction("h", {"y": 1.0, "x": -1.0}, 0.1, speed=0.05),
        ],
        LOSS,
        frequency=0.45,
    ),
    "impact": system(ONE, [[1.0]], [stop(1.0, 0.8)], [[0.1]], frequency=1.0),
    "chatter": system(ONE, [[0.2]], [stop(0.1, 0.5)], [[0.1]], frequency=0.3),
    "chatter and friction": system(
        TWO,
        [[1.0, -0.5], [-0.5, 0.9]],
        [stop(0.1, 0.5, Side.BOTH), friction("h", {"y": 1.0}, 0.1)],
        LOSS,
        [[1.0, 0.2], [0.2, 0.7]],
        0.3,
    ),
    "stages rigid": system(ONE, [[0.1]], [CLUTCH, Contact("cf", {"x": 1.0}, (), law=Coulomb("stages", "c"))]),
    "stages": system(ONE, [[0.1]], [CLUTCH, Contact("cf", {"x": 1.0}, (), law=Jenkins("stages", "c"), stiffness=8.0)]),
    "normal": system(
        TWO,
        [[0.5, -0.2], [-0.2, 0.6]],
        [
            Contact("c", {"x": 1.0}, [Stage(0.2, 3.0)]),
            Contact("cf", {"y": 1.0}, (), law=Coulomb("normal", "c"), coefficient=0.3),
        ],
        loads=[load(1.0, x=1.0, y=0.4)],
    ),
    "normal spring": system(
        TWO,
        [[0.5, -0.2], [-0.2, 0.6]],
        [
            Contact("c", {"x": 1.0}, [Stage(0.2, 3.0)]),
            Contact("cf", {"y": 1.0}, (), law=Jenkins("normal", "c"), coefficient=0.3, stiffness=3.0),
        ],
        loads=[load(1.0, x=1.0, y=0.4)],
    ),
}


def beginning(system):
    """Return a state in which all stops are open."""
    state = np.zeros(system.state_size)
    state[: 2 * system.size] = np.resize([0.05, 0.1, 0.2, 0.1], 2 * system.size)
    return state

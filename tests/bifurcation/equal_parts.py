"""Random systems with equal parts, in which several multipliers become critical at once."""

import numpy as np

import gapwalk as gw
from tests.bifurcation.alike.machine import Machine


def ring(count: int = 3, coupling: float = 0.2, damping: float = 0.02, depth: float = 0.3) -> gw.System:
    """Return equal masses, each coupled to all others, on springs whose stiffness jumps between two levels (Meissner).

    All modes but the first have the same frequency, so that `count` - 1 multipliers pass -1 at once.
    """
    names = [f"x{place}" for place in range(count)]
    stiffness = coupling * (count * np.eye(count) - np.ones((count, count)))
    return gw.System(
        names,
        mass=[1.0] * count,
        damping=[damping] * count,
        stiffness=stiffness.tolist(),
        contacts=[gw.force(f"s{name}", {name: 1.0}, law="p*x + x*x*x", p=1.0) for name in names],
        harmonics=[gw.loads.Rectangle(depth, varies=f"s{name}.p", share=0.5, name=f"r{name}") for name in names],
        frequency=2.9,
    )


def equal_parts(rng: np.random.Generator) -> Machine:
    """Return a random machine with two equal parts that carry gaps, under equal loads, coupled to each other."""
    own, coupling = rng.uniform(0.6, 1.4), rng.uniform(0.05, 0.5)
    damping, clearance = rng.uniform(0.02, 0.12), rng.uniform(0.6, 1.2)
    stiffness, impact_damping = rng.uniform(2.0, 15.0), rng.uniform(0.0, 0.2)
    load, mean = rng.uniform(0.2, 0.6), rng.choice([0.0, rng.uniform(0.05, 0.3)])
    return Machine(
        ("a", "b"),
        np.array([[own + coupling, -coupling], [-coupling, own + coupling]]),
        damping * np.eye(2),
        np.eye(2),
        tuple(gw.backlash(f"gap{q}", {q: 1.0}, clearance, stiffness, impact_damping=impact_damping) for q in "ab"),
        (gw.Harmonic(load, {"a": 1.0, "b": 1.0}),),
        rng.uniform(0.4, 0.7),
        2.2,
        {"a": mean, "b": mean},
    )

"""Random systems with several friction elements on one deflection, with and without springs in series and stops."""

from __future__ import annotations

import numpy as np

import gapwalk as gw


def several_elements(rng: np.random.Generator) -> gw.System:
    """Return a mass that two or three friction elements hold, at most one of them rigid; half of them have a stop."""
    count, rigid = int(rng.integers(2, 4)), int(rng.integers(6))
    contacts = [
        gw.friction(
            name,
            {"x": 1.0},
            round(float(rng.uniform(0.1, 0.4)), 4),
            stiffness=None if place == rigid else round(float(rng.uniform(1.0, 5.0)), 3),
        )
        for place, name in enumerate("abc"[:count])
    ]
    if rng.random() < 0.5:
        contacts.append(gw.backlash("gap", {"x": 1.0}, round(float(rng.uniform(2.0, 10.0)), 3), 0.4))
    return gw.System(
        ["x"],
        mass=[[round(float(rng.uniform(0.5, 1.5)), 3)]],
        damping=[[round(float(rng.uniform(0.03, 0.1)), 3)]],
        stiffness=[[round(float(rng.choice([0.0, rng.uniform(0.2, 1.0)])), 3)]],
        mean={"x": round(float(rng.uniform(-0.08, 0.08)), 4)},
        contacts=contacts,
        harmonics=[
            gw.Harmonic(round(float(rng.uniform(0.15, 0.7)), 4), {"x": 1.0}),
            gw.Harmonic(round(float(rng.uniform(0.0, 0.3)), 4), {"x": 1.0}, 2, round(float(rng.uniform(0, 6.28)), 4)),
        ],
        frequency=round(float(rng.uniform(0.6, 1.4)), 4),
    )

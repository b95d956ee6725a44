"""Systems that the tests share, and a strategy that draws random ones."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from gapwalk.model import Contact, Harmonic, Side, Stage, System
from gapwalk.model.laws import LAWS

# springs; rigid stops have tests of their own in tests/dry
OWN_LAWS = tuple(name for name, law in LAWS.items() if type(law).__module__.startswith("gapwalk.") and not law.rebounds)
"""The force laws of gapwalk; tests of toys register more."""


def clutch(**changes) -> System:
    """The paper's figure-13 system, typed again here."""
    contact = Contact(
        "stage2", {"q1": 1.0}, (Stage(1.0),), {"q1": 0.9, "q3": -0.54}, "hunt-crossley", impact_damping=0.05
    )
    system = System(
        ("q1", "q3"),
        stiffness=[[0.1, -0.6], [-0.06, 1.1]],
        damping=[[0.04, -0.04], [-0.04, 0.06]],
        contacts=[contact],
        mean={"q1": 0.25, "q3": 0.25},
        harmonics=[Harmonic(0.25, {"q1": 1.0})],
        frequency=0.5,
    )
    return system.at(changes)


def backlash_oscillator(frequency: float = 1.0, clearance: float = 0.5) -> System:
    """An undamped, unforced mass between two springs of unit stiffness with a gap."""
    return System(("x",), [[0.0]], contacts=[Contact("gap", {"x": 1.0}, (Stage(clearance),))], frequency=frequency)


def linear(damping: float = 0.1, frequency: float = 0.8) -> System:
    """Two coupled masses without any contact."""
    return System(
        ("a", "b"),
        stiffness=[[2.0, -1.0], [-1.0, 1.5]],
        damping=[[damping, -damping / 2], [-damping / 2, damping]],
        mass=[[1.5, 0.2], [0.2, 0.8]],
        mean={"a": 0.3},
        harmonics=[Harmonic(0.7, {"a": 1.0, "b": -0.4}, phase=0.3), Harmonic(0.2, {"b": 1.0}, order=3)],
        frequency=frequency,
    )


def far_and_near() -> System:
    """Two masses and three contacts: the first one is never reached, the others are hit in every period."""
    return System(
        ("x", "y"),
        stiffness=[[1.0, 0.0], [0.0, 1.0]],
        damping=[[0.2, 0.0], [0.0, 0.2]],
        contacts=[
            Contact("far", {"x": 1.0, "y": 1.0}, (Stage(9.0, 5.0),)),
            Contact("near", {"x": 1.0}, (Stage(0.3, 5.0),)),
            Contact("other", {"y": 1.0}, (Stage(0.3, 1.0),)),
        ],
        harmonics=[Harmonic(1.0, {"x": 1.0, "y": 0.5})],
        frequency=0.7,
    )


def viscous_stop(frequency: float = 0.7) -> System:
    """A one-sided stop with a damper that acts only while it touches: the force jumps at contact."""
    stop = Contact(
        "stop", {"x": 1.0}, (Stage(0.3, 8.0, side=Side.POSITIVE),), None, "viscous", {"viscous_damping": 0.4}
    )
    return System(
        ("x",), [[1.0]], [[0.08]], contacts=[stop], harmonics=[Harmonic(0.6, {"x": 1.0})], frequency=frequency
    )


@st.composite
def random_systems(draw, laws=OWN_LAWS):
    """Damped systems of one to three degrees of freedom with one or two contacts of one to three stages."""
    n = draw(st.integers(1, 3))
    seed = draw(st.integers(0, 2**32 - 1))
    random = np.random.default_rng(seed)
    names = tuple(f"q{i}" for i in range(n))

    def definite(low, high):
        basis = np.linalg.qr(random.normal(size=(n, n)))[0]
        return basis @ np.diag(random.uniform(low, high, n)) @ basis.T

    contacts = [_random_contact(draw, random, f"c{k}", names, laws) for k in range(draw(st.integers(1, 2)))]
    orders = draw(st.lists(st.integers(1, 3), min_size=1, max_size=2, unique=True))
    harmonics = [
        Harmonic(
            random.uniform(0.1, 0.8), dict(zip(names, random.normal(size=n), strict=True)), order, random.uniform(-3, 3)
        )
        for order in orders
    ]
    return System(
        names,
        stiffness=definite(0.3, 2.0),
        damping=definite(0.05, 0.3),
        mass=definite(0.5, 2.0),
        contacts=contacts,
        mean=dict(zip(names, random.normal(size=n) * 0.3, strict=True)),
        harmonics=harmonics,
        frequency=random.uniform(0.4, 2.0),
    )


def _random_contact(draw, random, name, coordinates, laws):
    law = draw(st.sampled_from(laws))
    side = draw(st.sampled_from(list(Side)))
    count = draw(st.integers(1, 3))
    clearances = np.cumsum(random.uniform(0.05, 0.4, count))
    stages = tuple(
        Stage(float(b), random.uniform(0.5, 5.0), random.choice([0.0, 0.4]), side, f"s{i}" if count > 1 else "")
        for i, b in enumerate(clearances)
    )
    deflection = dict(zip(coordinates, random.normal(size=len(coordinates)), strict=True))
    impact = 0.1 if law in ("hunt-crossley", "hunt-crossley-as-printed") else 0.0
    return Contact(
        name,
        deflection,
        stages,
        None,
        law,
        {"impact_damping": impact, "viscous_damping": 0.2 if law in ("viscous", "pushing") else 0.0},
    )

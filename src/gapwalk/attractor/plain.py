"""Conversion of attractors to plain JSON values and back, for stores and for other programs."""

from __future__ import annotations

from typing import Any

import numpy as np

from gapwalk.attractor.attractor import Attractor, AttractorKind
from gapwalk.attractor.lyapunov import Lyapunov
from gapwalk.attractor.rotation import Rotation
from gapwalk.model.system import System
from gapwalk.motion.switching import ContactEvent
from gapwalk.orbit.orbit import Orbit

Plain = Any
"""A value that JSON can represent."""


def plain_attractor(attractor: Attractor) -> Plain:
    """Convert an attractor without its system, which the reader must supply, to JSON values without loss."""
    return {
        "kind": attractor.kind.value,
        "period": attractor.period,
        "strobes": attractor.strobes.tolist(),
        "orbit": _plain_orbit(attractor.orbit),
        "lyapunov": _plain_lyapunov(attractor.lyapunov),
        "rotation": _plain_rotation(attractor.rotation),
        "evidence": list(attractor.evidence),
    }


def attractor_of(plain: Plain, system: System) -> Attractor:
    """Restore an attractor of `system`; raise KeyError, TypeError or ValueError if the values describe no attractor."""
    strobes = np.array(plain["strobes"], dtype=float)
    if strobes.ndim != 2 or strobes.shape[1] != 2 * system.size:
        raise ValueError(f"strobes of shape {strobes.shape} do not belong to this system")
    return Attractor(
        AttractorKind(plain["kind"]),
        system,
        int(plain["period"]),
        strobes,
        _orbit(plain["orbit"], system),
        _lyapunov(plain["lyapunov"]),
        _rotation(plain["rotation"]),
        tuple(str(sentence) for sentence in plain["evidence"]),
    )


def _plain_orbit(orbit: Orbit | None) -> Plain:
    if orbit is None:
        return None
    return {
        "period": orbit.period,
        "state": orbit.state.tolist(),
        "multipliers": [[mu.real, mu.imag] for mu in orbit.multipliers.tolist()],
        "events": [[event.theta, event.switch, bool(event.enters), event.velocity] for event in orbit.events],
        "residual": orbit.residual,
        "steps": orbit.steps,
    }


def _orbit(plain: Plain, system: System) -> Orbit | None:
    if plain is None:
        return None
    return Orbit(
        system,
        int(plain["period"]),
        np.array(plain["state"], dtype=float),
        np.array([complex(*parts) for parts in plain["multipliers"]], dtype=complex),
        tuple(ContactEvent(float(t), int(k), bool(e), float(v)) for t, k, e, v in plain["events"]),
        float(plain["residual"]),
        int(plain["steps"]),
    )


def _plain_lyapunov(exponents: Lyapunov | None) -> Plain:
    if exponents is None:
        return None
    return {
        "exponents": exponents.exponents.tolist(),
        "errors": exponents.errors.tolist(),
        "periods": exponents.periods,
        "frequency": exponents.frequency,
        "regular": exponents.regular,
        "converged": exponents.converged,
    }


def _lyapunov(plain: Plain) -> Lyapunov | None:
    if plain is None:
        return None
    return Lyapunov(
        np.array(plain["exponents"], dtype=float),
        np.array(plain["errors"], dtype=float),
        int(plain["periods"]),
        float(plain["frequency"]),
        bool(plain["regular"]),
        bool(plain["converged"]),
    )


def _plain_rotation(found: Rotation | None) -> Plain:
    if found is None:
        return None
    return {"number": found.number, "error": found.error, "curves": found.curves, "roughness": found.roughness}


def _rotation(plain: Plain) -> Rotation | None:
    if plain is None:
        return None
    return Rotation(float(plain["number"]), float(plain["error"]), int(plain["curves"]), float(plain["roughness"]))

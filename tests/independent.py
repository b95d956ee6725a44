"""The equations of motion written a second time, for SciPy: what the tests compare the compiled flow with."""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp

from gapwalk.model.system import System


def contact_force_of(form, values):
    """Force of one contact as a function of its deflection x and rate v, from the law's definition."""
    law, name = form.law.name, form.name
    sides = []
    for stage in form.stages:
        b, k, c = (values[f"{form.stage_prefix(stage)}.{name}"] for name in ("clearance", "stiffness", "cubic"))
        sides += [(side, b, k, c) for side in stage.side.signs]
    damping = values.get(f"{name}.viscous_damping" if law in ("viscous", "pushing") else f"{name}.impact_damping", 0.0)

    def force(x, v):
        g, touching = 0.0, False
        for side, b, k, c in sides:
            if side * x > b:
                depth = x - side * b
                g += k * depth + c * depth**3
                touching = True
        if law == "viscous":
            return g + damping * v * touching
        if law == "pushing":  # on the side that touches
            pushed = g + damping * v * touching
            return max(pushed, 0.0) if x > 0 else min(pushed, 0.0)
        if law == "hunt-crossley":
            return g + damping * abs(g) * v
        if law == "hunt-crossley-as-printed":
            return g * (1 + damping * v)
        return g

    return force


def contact_force(form, values, x, v):
    """Force of one contact at deflection x and rate v."""
    return contact_force_of(form, values)(x, v)


def acceleration_of(system: System):
    """q'' as a function of t, q and v: M q'' + C q' + K q + sum d f = mean + sum F cos(h W t + phi), term by term."""
    values, names = system.parameters, system.coordinates

    def vector(prefix):
        return np.array([values[f"{prefix}.{name}"] for name in names])

    inverse = np.linalg.inv(system.matrix("mass"))
    mean, stiffness, damping = vector("mean"), system.matrix("stiffness"), system.matrix("damping")
    loads = []
    for each in system.structure.harmonics:
        shape = vector(f"{each.name}.acts_on") * values[f"{each.name}.amplitude"]
        loads.append((shape, each.order * system.frequency, values[f"{each.name}.phase"]))
    contacts = [
        (
            vector(f"{form.name}.deflection"),
            vector(f"{form.name}.{'deflection' if form.reciprocal else 'force'}"),
            contact_force_of(form, values),
        )
        for form in system.structure.contacts
    ]

    def of(t, q, v):
        right = mean - stiffness @ q - damping @ v
        for shape, pace, phase in loads:
            right = right + math.cos(pace * t + phase) * shape
        for e, d, force in contacts:
            right = right - force(float(e @ q), float(e @ v)) * d
        return inverse @ right

    return of


def acceleration(system: System, t: float, q, v):
    """q'' at one place."""
    return acceleration_of(system)(t, q, v)


def integrate(system: System, state, periods: float = 1.0, *, max_step: float = 0.01, rtol: float = 1e-11, t_eval=None):
    """State after some forcing periods, by SciPy's DOP853 with steps too short to miss a contact."""
    n, end = system.size, periods * 2 * np.pi / system.frequency

    of = acceleration_of(system)

    def rhs(t, y):
        return np.concatenate((y[n:], of(t, y[:n], y[n:])))

    result = solve_ivp(rhs, (0.0, end), state, method="DOP853", rtol=rtol, atol=1e-12, max_step=max_step, t_eval=t_eval)
    assert result.success
    return result.y[:, -1] if t_eval is None else result.y.T

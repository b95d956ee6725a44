"""The equations of motion written a second time, for SciPy: what the tests compare the compiled flow with."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from gapwalk.model.system import System


def contact_force(form, values, x, v):
    """Force of one contact at deflection x and rate v, from the law's definition."""
    g, touching = 0.0, False
    for stage in form.stages:
        b, k, c = (values[f"{form.stage_prefix(stage)}.{name}"] for name in ("clearance", "stiffness", "cubic"))
        for side in stage.side.signs:
            if side * x > b:
                depth = x - side * b
                g += k * depth + c * depth**3
                touching = True
    law = form.damping.value
    if law == "viscous":
        return g + values[f"{form.name}.viscous_damping"] * v * touching
    if law == "hunt-crossley":
        return g + values[f"{form.name}.impact_damping"] * abs(g) * v
    if law == "hunt-crossley-as-printed":
        return g * (1 + values[f"{form.name}.impact_damping"] * v)
    return g


def acceleration(system: System, t: float, q, v):
    """q'' from M q'' + C q' + K q + sum d f = mean + sum F cos(h W t + phi), term by term."""
    values, names, n = system.parameters, system.coordinates, system.size
    right = np.array([values[f"mean.{name}"] for name in names])
    for harmonic in system.structure.harmonics:
        shape = np.array([values[f"{harmonic.name}.acts_on.{name}"] for name in names])
        angle = harmonic.order * system.frequency * t + values[f"{harmonic.name}.phase"]
        right = right + values[f"{harmonic.name}.amplitude"] * np.cos(angle) * shape
    right = right - system.matrix("stiffness") @ q - system.matrix("damping") @ v
    for form in system.structure.contacts:
        e = np.array([values[f"{form.name}.deflection.{name}"] for name in names])
        which = "deflection" if form.reciprocal else "force"
        d = np.array([values[f"{form.name}.{which}.{name}"] for name in names])
        right = right - d * contact_force(form, values, e @ q, e @ v)
    assert right.shape == (n,)
    return np.linalg.solve(system.matrix("mass"), right)


def integrate(system: System, state, periods: float = 1.0, *, max_step: float = 0.01, rtol: float = 1e-11, t_eval=None):
    """State after some forcing periods, by SciPy's DOP853 with steps too short to miss a contact."""
    n, end = system.size, periods * 2 * np.pi / system.frequency

    def rhs(t, y):
        return np.concatenate((y[n:], acceleration(system, t, y[:n], y[n:])))

    result = solve_ivp(rhs, (0.0, end), state, method="DOP853", rtol=rtol, atol=1e-12, max_step=max_step, t_eval=t_eval)
    assert result.success
    return result.y[:, -1] if t_eval is None else result.y.T

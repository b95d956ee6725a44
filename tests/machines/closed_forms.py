"""Numbers that need no integration: Mathieu, Meissner, Hill's determinant, equilibria, linear responses."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.special import mathieu_a, mathieu_b


def mathieu_values():
    """Characteristic values of ``x'' + (a - 2 q cos 2t) x = 0``, from SciPy."""
    return {
        str(q): {"a": [float(mathieu_a(m, q)) for m in range(4)], "b": [float(mathieu_b(m, q)) for m in range(1, 4)]}
        for q in (0.5, 1.0, 2.0)
    }


def hill(w, z, order, harmonics=30):
    """``A + e B``, singular where ``x'' + 2 z x' + (1 + e cos W t) x = 0`` has a multiplier +1 or -1 (order 0 or 1).

    The unknowns are the complex amplitudes at (k + order / 2) W.
    """
    k = np.arange(-harmonics, harmonics + 1 - order) + order / 2
    fixed = np.diag(1 - (k * w) ** 2 + 2j * z * k * w)
    side = 0.5 * (np.eye(len(k), k=1) + np.eye(len(k), k=-1))
    return fixed, side


def tongue(w, z, order):
    """The smallest positive e at which a multiplier is +1 (order 0) or -1 (order 1)."""
    fixed, side = hill(w, z, order)
    try:
        inverse = np.linalg.eigvals(np.linalg.solve(fixed, -side))
    except np.linalg.LinAlgError:
        return 0.0  # the tip of a tongue without damping
    e = 1 / inverse[np.abs(inverse) > 1e-9]
    real = e.real[(np.abs(e.imag) < 1e-9 * np.abs(e)) & (e.real > 0)]
    return float(np.min(real, initial=np.inf))


def tongue_frequencies(e, z, order):
    """Find the frequencies at the edges of a tongue: where `tongue` equals e, near 2 (order 1) or 1 (order 0)."""
    center = {0: 1.0, 1: 2.0}[order]
    ws = np.linspace(0.75 * center, 1.25 * center, 401)
    values = [tongue(w, z, order) - e for w in ws]
    edges = [i for i in range(len(ws) - 1) if values[i] * values[i + 1] < 0]
    return [brentq(lambda w: tongue(w, z, order) - e, ws[i], ws[i + 1], xtol=1e-15, rtol=1e-14) for i in edges]


def meissner_trace(w, e, z):
    """Trace of the matrix over a period without its factor exp(-z T), half a period at each stiffness."""
    half = np.pi / w
    high, low = np.sqrt(1 - z * z + e + 0j), np.sqrt(1 - z * z - e + 0j)
    ratio = low / high + high / low
    return (2 * np.cos(high * half) * np.cos(low * half) - ratio * np.sin(high * half) * np.sin(low * half)).real


def meissner_edges(e, z, sign=-1, near=2.0):
    """The frequencies at which a multiplier of Meissner's equation is -1 (flip) or +1."""

    def gap(w):
        return meissner_trace(w, e, z) - sign * 2 * np.cosh(2 * np.pi * z / w)

    ws = np.linspace(0.7 * near, 1.4 * near, 20001)
    values = [gap(w) for w in ws]
    return [
        brentq(gap, ws[i], ws[i + 1], xtol=1e-16, rtol=1e-14)
        for i in range(len(ws) - 1)
        if values[i] * values[i + 1] < 0
    ]


def meissner_matrix(w, e, z):
    """The matrix over a period from theta = 0, by matrix exponentials: to check the trace."""

    def part(sign, share):
        return expm(np.array([[0, 1], [-(1 + sign * e), -2 * z]]) * 2 * np.pi / w * share)

    return part(1, 0.25) @ part(-1, 0.5) @ part(1, 0.25)


def truss_equilibria(k=100.0, force=1.0, a=0.1, length=1.0):
    """SKHiPPR's truss at rest: x with k x (1 - l / sqrt(a^2 + x^2)) = F."""

    def gap(x):
        return k * x * (1 - length / np.sqrt(a * a + x * x)) - force

    xs = np.linspace(-1.5, 1.5, 30001)
    values = gap(xs)
    return [brentq(gap, xs[i], xs[i + 1], xtol=1e-16) for i in range(len(xs) - 1) if values[i] * values[i + 1] < 0]


def truss_limits(k=100.0, a=0.1, length=1.0):
    """The forces at which two equilibria of the truss meet, and where: k (1 - l a^2 / (a^2 + x^2)^1.5) = 0."""
    x = np.sqrt((length * a * a) ** (2 / 3) - a * a)
    force = k * x * (1 - length / np.sqrt(a * a + x * x))
    return {"x": [float(-x), float(x)], "F": [float(-force), float(force)]}


def base_response(w, z=0.02, a=0.1):
    """Absolute state at theta = 0 of the base-excited oscillator without contact, and its relative amplitude."""
    relative = a * w * w / (1 - w * w + 2j * z * w)
    absolute = relative + a
    return {"state": [absolute.real, (1j * w * absolute).real], "relative_amplitude": abs(relative)}


def rotor_response(w, e=0.1, z=0.05, g=0.1, ky=1.3):
    """State at theta = 0 of the rotor of `rotor_stop` without contact."""
    matrix = np.array([[1 - w * w + 2j * z * w, 1j * g * w], [-1j * g * w, ky - w * w + 2j * z * w]])
    q = np.linalg.solve(matrix, e * w * w * np.array([1, -1j]))
    return [*q.real, *(1j * w * q).real]


def circular_whirl(w, e=0.1, z=0.05, ks=10.0, b=0.5):
    """Radii of the circular orbits of `rotor_annulus` without weight: those that rub, and the free one if it fits."""

    def gap(r):
        stiffness = 1 + ks * max(0.0, 1 - b / r)
        return r * np.hypot(stiffness - w * w, 2 * z * w) - e * w * w

    rs = np.linspace(1e-6, 5.0, 200001)
    values = np.array([gap(r) for r in rs])
    return [brentq(gap, rs[i], rs[i + 1], xtol=1e-16) for i in range(len(rs) - 1) if values[i] * values[i + 1] < 0]


def all_of_them():
    """Everything of this module, for the file."""
    pairs = ((0.2, 0.0), (0.2, 0.02), (0.5, 0.05), (0.4, 0.1))
    flips = {f"e={e}, z={z}": meissner_edges(e, z) for e, z in pairs}
    folds = {f"e={e}, z={z}": meissner_edges(e, z, 1, 1.0) for e, z in ((0.5, 0.02), (0.8, 0.02))}
    for (e, z), ws in zip(pairs, flips.values(), strict=True):
        for w in ws:
            m = meissner_matrix(w, e, z)
            assert abs(1 + np.trace(m) + np.linalg.det(m)) < 1e-13, (e, z, w)
    return {
        "mathieu_characteristic_values": mathieu_values(),
        "mathieu_flips": {
            f"e={e}, z={z}": tongue_frequencies(e, z, 1) for e, z in ((0.4, 0.0), (0.4, 0.02), (0.3, 0.05))
        },
        "mathieu_folds": {f"e={e}, z={z}": tongue_frequencies(e, z, 0) for e, z in ((0.4, 0.0), (0.4, 0.02))},
        "mathieu_tongue_of_flips": {
            f"z={z}": [[w, tongue(w, z, 1)] for w in (1.8, 1.9, 2.0, 2.1, 2.2)] for z in (0.0, 0.02, 0.05)
        },
        "mathieu_tongue_of_folds": {f"z={z}": [[w, tongue(w, z, 0)] for w in (0.9, 0.95, 1.0)] for z in (0.0, 0.02)},
        "meissner_flips": flips,
        "meissner_folds": folds,
        "truss_equilibria": truss_equilibria(),
        "truss_limits": truss_limits(),
        "base_without_contact": {str(w): base_response(w) for w in (0.6, 0.9)},
        "rotor_without_contact": {str(w): rotor_response(w) for w in (0.6, 0.9)},
        "circular_whirl": {str(w): circular_whirl(w) for w in (0.8, 1.0, 1.5)},
    }

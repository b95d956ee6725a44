"""Periodic orbits by SciPy alone: event-driven integration, variational equations by complex steps, Newton's method."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq

STEP = 1e-40  # of the complex-step derivatives, which have no cancellation
TINY = 1e-13  # a guard that has just fired is zero to rounding


@dataclass(frozen=True)
class Machine:
    """``q'' = acceleration(theta, W, q, v, p, closed)``, with forces that switch where a guard changes its sign.

    ``closed`` holds one truth value per guard: is it positive? An acceleration switches by them alone, so that it is
    smooth between events, and takes complex arrays of shape (n, many).
    """

    size: int
    acceleration: Callable
    parameters: dict[str, float]
    guards: Callable | None = None

    def closed(self, theta, w, state, p):
        """The guards that are positive at one state."""
        if self.guards is None:
            return ()
        n = self.size
        return tuple(bool(g > 0) for g in self.guards(theta, w, state[:n], state[n:], p))


@dataclass
class Path:
    """Motion over some cycles, as dense pieces between events, with its derivatives by the first state and by W."""

    end: np.ndarray
    transition: np.ndarray
    slope: np.ndarray
    pieces: list = field(default_factory=list)
    events: list = field(default_factory=list)

    def at(self, thetas):
        """States at ascending angles, shape (2n, many)."""
        found, size = [], len(self.end)
        ends = np.array([piece.t_max for piece in self.pieces])
        where = np.minimum(np.searchsorted(ends, thetas), len(ends) - 1)
        for i, piece in enumerate(self.pieces):
            mine = thetas[where == i]
            if len(mine):
                found.append(piece(mine)[:size])
        return np.concatenate(found, axis=1)


def integrate(machine: Machine, state, w: float, p, cycles: int = 1, start=0.0, steps=200, rtol=1e-13) -> Path:
    """Integrate over the angle, with a restart at each event and the saltation there."""
    n, size = machine.size, 2 * machine.size
    columns = size + 1

    def velocity(theta, y, seeds, closed):
        """d(y, seeds)/dtheta: the seeds are directions in the states, the last one together with W."""
        lifted = y[:, None] + 1j * STEP * seeds
        pace = np.full(columns, complex(w))
        pace[-1] += 1j * STEP
        q, v = lifted[:n], lifted[n:]
        rate = np.concatenate((v, machine.acceleration(theta, pace, q, v, p, closed))) / pace
        return rate[:, 0].real, rate.imag / STEP

    def rhs(theta, z, closed):
        dy, ds = velocity(theta, z[:size], z[size:].reshape(size, columns), closed)
        return np.concatenate((dy, ds.ravel()))

    def guards(theta, z, closed):
        return np.array(machine.guards(theta, w, z[:n], z[n:size], p))

    def solver(theta, z, closed, stop):
        step = 2 * np.pi / steps
        return DOP853(lambda t, u: rhs(t, u, closed), theta, z, stop, max_step=step, rtol=rtol, atol=1e-15)

    def carry(theta, z, closed, stop):
        if stop <= theta:
            return z
        run = solver(theta, z, closed, stop)
        while run.status == "running":
            run.step()
        return run.y

    theta, stop = start, start + 2 * np.pi * cycles
    state = np.asarray(state, dtype=float)
    z = np.concatenate((state, np.eye(size, columns).ravel()))
    closed = machine.closed(theta, w, state, p)
    path = Path(state, np.eye(size), np.zeros(size))
    while theta < stop:
        run = solver(theta, z, closed, stop)
        fired = None
        while run.status == "running" and fired is None:
            run.step()
            if run.status == "failed":
                raise RuntimeError("the integration failed")
            dense = run.dense_output()
            if machine.guards is not None:
                fired = _first_event(dense, lambda t, u, c=closed: guards(t, u, c), closed)
            path.pieces.append(_Piece(dense, run.t if fired is None else fired[0]))
        if fired is None:
            theta, z = run.t, run.y
            continue
        index, before, z_before = fired[1], run.t_old, dense(run.t_old)
        at = fired[0]
        for _ in range(8):  # Newton's method on the instant, with the integrator itself in place of its interpolant
            u = carry(before, z_before, closed, at)
            dy = rhs(at, u, closed)
            g = guards(at, u, closed)[index]
            slope = _guard_slope(machine, at, w, u[:size], p, index)
            change = g / (slope[0] @ dy[:size] + slope[1])
            at -= change
            if abs(change) < 1e-15 * max(1.0, at):
                break
        u = carry(before, z_before, closed, at)
        after = tuple(not c if i == index else c for i, c in enumerate(closed))
        z, den = _salt(machine, rhs, at, w, u, p, index, closed, after)
        path.events.append((at, index, after[index], den))
        theta, closed = at, after
        if stop - theta < 1e-14:
            break
    seeds = z[size:].reshape(size, columns)
    path.end, path.transition, path.slope = z[:size], seeds[:, :size], seeds[:, size]
    return path


class _Piece:
    """A dense output that ends at an event."""

    def __init__(self, dense, stop):
        self.dense, self.t_min, self.t_max = dense, dense.t_min, stop

    def __call__(self, thetas):
        return self.dense(thetas)


def _first_event(dense, guards, closed):
    """The first change of sign of a guard inside a step: its angle and the guard's index."""
    thetas = np.linspace(dense.t_min, dense.t_max, 9)[1:]
    values = np.array([guards(t, dense(t), closed) for t in thetas])
    best = None
    for index, is_closed in enumerate(closed):
        wrong = np.flatnonzero((values[:, index] > TINY) if not is_closed else (values[:, index] < -TINY))
        if not len(wrong):
            continue
        low = dense.t_min if wrong[0] == 0 else thetas[wrong[0] - 1]
        high = thetas[wrong[0]]

        def g(t, index=index):
            return guards(t, dense(t), closed)[index]

        at = low if g(low) * g(high) > 0 else brentq(g, low, high, xtol=1e-14)
        if best is None or at < best[0]:
            best = (at, index)
    return best


def _guard_slope(machine, theta, w, y, p, index):
    """The guard's derivatives by the state, by the angle and by W."""
    n, size = machine.size, len(y)
    lifted = y[:, None] + 1j * STEP * np.eye(size)
    by_state = np.array([complex(machine.guards(theta, w, c[:n], c[n:], p)[index]).imag / STEP for c in lifted.T])
    by_angle = complex(machine.guards(theta + 1j * STEP, w, y[:n], y[n:], p)[index]).imag / STEP
    by_pace = complex(machine.guards(theta, w + 1j * STEP, y[:n], y[n:], p)[index]).imag / STEP
    return by_state, by_angle, by_pace


def _salt(machine, rhs, theta, w, z, p, index, closed, after):
    """Carry the directions through an event at which the vector field may jump."""
    size = 2 * machine.size
    by_state, by_angle, by_pace = _guard_slope(machine, theta, w, z[:size], p, index)
    before, behind = rhs(theta, z, closed)[:size], rhs(theta, z, after)[:size]
    den = by_state @ before + by_angle
    seeds = z[size:].reshape(size, -1).copy()
    by_pace_of = np.zeros(seeds.shape[1])
    by_pace_of[-1] = by_pace
    seeds += np.outer(behind - before, (by_state @ seeds + by_pace_of) / den)
    return np.concatenate((z[:size], seeds.ravel())), float(den)


def find(machine: Machine, w: float, guess, changes=None, cycles: int = 1, tolerance=2e-14, limit=30, **options):
    """Newton's method for a state that repeats after some cycles; returns the state, its path and the residual."""
    p = machine.parameters | (changes or {})
    state = np.array(guess, dtype=float)
    best = (np.inf, state, None)
    for _ in range(limit):
        path = integrate(machine, state, w, p, cycles, **options)
        gap = state - path.end
        size = np.max(np.abs(gap)) / (1.0 + np.max(np.abs(state)))
        if size < best[0]:
            best = (size, state, path)
        elif size < 1e-11:
            break
        if size < tolerance:
            break
        change = np.linalg.solve(path.transition - np.eye(len(state)), gap)
        state = state + change
    size, state, path = best
    if not size < 1e-11:
        raise RuntimeError(f"no orbit at W = {w}: the residual is {size:.1e}")
    return state, path, size


def settle(machine: Machine, w: float, guess=None, changes=None, cycles=200):
    """A rough state after many cycles: a first guess for Newton's method."""
    p = machine.parameters | (changes or {})
    state = np.zeros(2 * machine.size) if guess is None else np.array(guess, dtype=float)
    n = machine.size

    def rhs(theta, y):
        q, v = y[:n, None], y[n:, None]
        closed = machine.closed(theta, w, y, p)
        return np.concatenate((v, machine.acceleration(theta, w, q, v, p, closed)))[:, 0] / w

    run = DOP853(rhs, 0.0, state, 2 * np.pi * cycles, max_step=2 * np.pi / 50, rtol=1e-8, atol=1e-10)
    while run.status == "running":
        run.step()
    return run.y


def measures(machine: Machine, state, path: Path, cycles: int = 1, samples: int = 4096):
    """Largest and smallest value, and the amplitudes of the orders 0 to 3, of each coordinate."""
    n = machine.size
    thetas = np.arange(samples) * (2 * np.pi * cycles / samples)
    motion = path.at(thetas)
    found = {"max": [], "min": [], "orders": []}
    for i in range(n):
        q, v = motion[i], motion[n + i]
        peaks = [float(q.max()), float(q.min())]
        for j in np.flatnonzero(v * np.roll(v, -1) <= 0):
            low, high = thetas[j], thetas[j] + 2 * np.pi * cycles / samples
            speed = lambda t, i=i: float(path.at(np.array([t]))[n + i, 0])  # noqa: E731
            if speed(low) * speed(high) < 0:
                at = brentq(speed, low, high, xtol=1e-13)
                peaks.append(float(path.at(np.array([at]))[i, 0]))
        found["max"].append(max(peaks))
        found["min"].append(min(peaks))
        spectrum = np.fft.rfft(q) / samples
        found["orders"].append([float(spectrum[0].real), *(2 * np.abs(spectrum[cycles : 3 * cycles + 1 : cycles]))])
    found["half"] = [(a - b) / 2 for a, b in zip(found["max"], found["min"], strict=True)]
    return found

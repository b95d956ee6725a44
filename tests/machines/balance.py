"""Harmonic balance in NumPy: the peaks of frequency responses, with as many harmonics as another program used."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar


@dataclass(frozen=True)
class Balance:
    """``M q'' + C q' + K q + f(q) = F cos theta``, ``f`` from (n, many) to (n, many), real or complex."""

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    force: object
    load: np.ndarray
    harmonics: int
    samples: int

    @property
    def size(self):
        """Number of unknowns without the frequency."""
        return len(self.mass) * (2 * self.harmonics + 1)

    def bases(self):
        """Matrices from coefficients (mean, cosine 1, sine 1, ...) to samples and back."""
        theta = np.arange(self.samples) * 2 * np.pi / self.samples
        rows = [np.ones_like(theta)]
        for h in range(1, self.harmonics + 1):
            rows += [np.cos(h * theta), np.sin(h * theta)]
        to_time = np.array(rows).T
        weights = np.full(len(rows), 2.0)
        weights[0] = 1.0
        return to_time, (to_time * weights).T / self.samples

    def residual(self, x):
        """Residual and Jacobian by all coefficients (order by order) and the frequency."""
        n, h, w = len(self.mass), self.harmonics, x[-1]
        q = x[:-1].reshape(2 * h + 1, n)
        to_time, back = self.bases()
        motion = (to_time @ q).T
        value = back @ self.force(motion).T
        jacobian = np.zeros((self.size, self.size + 1))
        for j in range(n):
            lifted = motion.astype(complex)
            lifted[j] += 1e-40j
            slope = self.force(lifted).imag / 1e-40
            for i in np.flatnonzero(np.any(slope, axis=1)):
                jacobian[i : self.size : n, j : self.size : n] += back @ (slope[i][:, None] * to_time)
        value = value + q @ self.stiffness.T
        jacobian[:, :-1] += np.kron(np.eye(2 * h + 1), self.stiffness)
        value[1] -= self.load
        for k in range(1, h + 1):
            c, s = 2 * k - 1, 2 * k
            value[c] += -((k * w) ** 2) * self.mass @ q[c] + k * w * self.damping @ q[s]
            value[s] += -((k * w) ** 2) * self.mass @ q[s] - k * w * self.damping @ q[c]
            at, to = slice(c * n, c * n + n), slice(s * n, s * n + n)
            jacobian[at, at] -= (k * w) ** 2 * self.mass
            jacobian[to, to] -= (k * w) ** 2 * self.mass
            jacobian[at, to] += k * w * self.damping
            jacobian[to, at] -= k * w * self.damping
            jacobian[at, -1] = -2 * k * k * w * self.mass @ q[c] + k * self.damping @ q[s]
            jacobian[to, -1] = -2 * k * k * w * self.mass @ q[s] - k * self.damping @ q[c]
        return value.ravel(), jacobian

    def first(self, w):
        """The linear response."""
        linear = np.linalg.solve(self.stiffness - w * w * self.mass + 1j * w * self.damping, self.load)
        q = np.zeros((2 * self.harmonics + 1, len(self.mass)))
        q[1], q[2] = linear.real, -linear.imag
        return np.append(q.ravel(), w)

    def correct(self, x, tangent=None):
        """Newton's method in the plane normal to a tangent (without one: at a given frequency)."""
        tangent = np.eye(len(x))[-1] if tangent is None else tangent
        start = x
        for _ in range(20):
            value, jacobian = self.residual(x)
            gap = np.append(value, tangent @ (x - start))
            change = np.linalg.solve(np.vstack((jacobian, tangent)), gap)
            x = x - change
            if np.max(np.abs(change)) < 1e-13 * (1 + np.max(np.abs(x))):
                return x
        return x if np.max(np.abs(self.residual(x)[0])) < 1e-11 else None

    def walk(self, start, stop, step, scale):
        """Points of the branch from the linear response at one frequency until another is reached."""
        weights = np.append(np.full(self.size, scale), 1.0)
        x = self.correct(self.first(start))
        points, tangent = [x], None
        while len(points) < 20000:
            _, jacobian = self.residual(x)
            null = np.linalg.svd(jacobian * weights)[2][-1]
            if tangent is None:
                null = null * np.sign(null[-1] * (stop - start))
            elif null @ tangent < 0:
                null = -null
            tangent = null
            new = None
            length = step
            while new is None:
                new = self.correct(x + length * weights * tangent, tangent / weights)
                length /= 2
            x = new
            points.append(x)
            if (x[-1] - stop) * np.sign(stop - start) > 0:
                return points, weights
        raise RuntimeError("the walk has not ended")

    def peaks(self, start, stop, step, scale, measure):
        """All maxima of a measure along the branch: its value and the frequency."""
        points, weights = self.walk(start, stop, step, scale)
        values = np.array([measure(self, x) for x in points])
        found = []
        for i in range(1, len(points) - 1):
            if values[i] > values[i - 1] and values[i] >= values[i + 1]:
                chord = (points[i + 1] - points[i - 1]) / weights
                chord /= np.linalg.norm(chord)

                def at(s, x=points[i], chord=chord):
                    return self.correct(x + s * weights * chord, chord / weights)

                best = minimize_scalar(
                    lambda s: -measure(self, at(s)), bounds=(-step, step), method="bounded", options={"xatol": 1e-9}
                )
                x = at(best.x)
                found.append((float(measure(self, x)), float(x[-1])))
        return found


def order_one(coordinate=0):
    """The amplitude of the first harmonic."""

    def of(balance, x):
        q = x[:-1].reshape(-1, len(balance.mass))[:, coordinate]
        return np.hypot(q[1], q[2])

    return of


def geometric_force(q):
    """See `equations.geometric`."""
    one, two = 1.13**2, 4.0
    s = (one + two) / 2
    x, y = q
    return np.stack(
        (
            1.5 * one * x**2 + two * x * y + 0.5 * one * y**2 + s * (x**3 + x * y**2),
            0.5 * two * x**2 + one * x * y + 1.5 * two * y**2 + s * (x**2 * y + y**3),
        )
    )


def geometric(level, harmonics=7, samples=29):
    """NLvib 06 at a level of its force."""
    damping = np.diag([2e-3 * 1.13, 2 * 5e-3 * 2])
    load = np.full(2, level)
    return Balance(np.eye(2), damping, np.diag([1.13**2, 4.0]), geometric_force, load, harmonics, samples)


def unilateral_force(q):
    """See `equations.unilateral`."""
    depth = q[0] - 1.0
    return np.stack((100.0 * depth * (depth.real > 0), 0 * q[1]))


def unilateral(harmonics=21, samples=1024):
    """NLvib 03."""
    k = np.array([[1.0, -1.0], [-1.0, 2.0]])
    return Balance(np.eye(2), 0.03 * k, k, unilateral_force, np.array([0.0, 0.1]), harmonics, samples)

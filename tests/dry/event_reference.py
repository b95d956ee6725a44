"""Motions with dry friction and rigid stops, integrated a second time: event-driven, by SciPy's DOP853.

Everything is written from the named values of a system, and slowly: one function gives accelerations and reactions in
given modes, one the guards of these modes, one the modes after an event. A guard is positive as long as its mode lasts.
Units are taken to be of the order of 1. Where a flight between two impacts is shorter than `_HELD`, a stop is held.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq

from gapwalk.model.system import System

_OPTIONS = {"rtol": 1e-13, "atol": 1e-14}
_FIRES = 1e-11  # a guard as far below zero has changed its sign
_STRIKES = 2e-14  # the same of a gap that may close slowly, at a rate of the order of its square root
_REST = 1e-11  # rate within which friction may stick
_HOP = 1e-3  # time of a flight that is located from its parabola
_HELD = 1e-7  # time of a flight that is not made: an error of the order of its square
_AT_ONCE = 60  # events at one instant
_SAMPLES = (np.arange(1, 17) / 16.0).tolist()  # shares of a step at which guards are looked at
_AFTER = (0.5 ** np.arange(30.0, 3.0, -1.0)).tolist()  # and of a step after an event, where guards begin at 0


class Event(NamedTuple):
    """An event: its angle; the index of a switch (``"contact"``, ``"held"``) or a contact (``"slip"``); mode; rate."""

    kind: str
    theta: float
    index: int
    mode: int
    rate: float = 0.0


@dataclass
class Modes:
    """The closed switches, the slip of each dry contact (1, -1, 0), and the held switches of rigid stops."""

    closed: set[int] = field(default_factory=set)
    slip: dict[int, int] = field(default_factory=dict)
    held: set[int] = field(default_factory=set)


@dataclass
class Result:
    """End of a motion, its events, and the energies over it.

    `work` is the work of the loads (the last is the mean); `taken` what each contact takes from the motion, impacts
    included; `heat` what slips turn into heat, by contact; `damped` what the damping matrix dissipates.
    """

    state: np.ndarray
    modes: Modes
    events: list[Event]
    work: np.ndarray
    taken: np.ndarray
    heat: np.ndarray
    damped: float


class Reference:
    """The equations ``M q'' + C q' + K q + sum d f = mean + sum F cos(h W t + phi)`` of one system."""

    def __init__(self, system: System) -> None:
        values, names, n = system.parameters, system.coordinates, system.size
        structure = system.structure
        assert not structure.variations
        self.n, self.frequency = n, system.frequency

        def vector(prefix):
            return np.array([values[f"{prefix}.{name}"] for name in names])

        self.mass, self.damping, self.stiffness = (system.matrix(each) for each in ("mass", "damping", "stiffness"))
        self.inverse, self.mean, self.loads = np.linalg.inv(self.mass), vector("mean"), []
        for each in structure.harmonics:
            shape = vector(f"{each.name}.acts_on") * values[f"{each.name}.amplitude"]
            self.loads.append((shape, each.order * system.frequency, values[f"{each.name}.phase"]))
        self.contacts = forms = structure.contacts
        self.e = np.array([vector(f"{form.name}.deflection") for form in forms]).reshape(-1, n)
        own = [form.name + (".deflection" if form.reciprocal else ".force") for form in forms]
        self.d = np.array([vector(each) for each in own]).reshape(-1, n)
        self.law = [getattr(form.law, "springs", form.law.name) for form in forms]
        numbers = [{p.name: values[f"{form.name}.{p.name}"] for p in form.law.parameters} for form in forms]
        self.numbers = [{"limit": 0.0, "speed": 0.0, "static": 1.0, **each} for each in numbers]
        places = {form.name: index for index, form in enumerate(forms)}
        self.host = [places.get(form.law.host, -1) for form in forms]
        self.dry = [index for index, law in enumerate(self.law) if law in ("coulomb", "jenkins")]
        self.place = {index: 2 * n + k for k, index in enumerate(i for i in self.dry if self.law[i] == "jenkins")}
        self.switches, self.inner = [], {}  # contact, side, and numbers of its stage
        for index, form in enumerate(forms):
            for stage, side in form.sides:
                prefix = form.stage_prefix(stage)
                given = {p.name: values[f"{prefix}.{p.name}"] for p in form.law.stage_parameters}
                self.inner.setdefault((index, side), len(self.switches))
                self.switches.append((index, side, given))

    # ---- forces

    def spring(self, index, x, v, modes):
        """Return the force of a contact with stages, and the side on which it is closed, or 0."""
        law, numbers, total, side = self.law[index], self.numbers[index], 0.0, 0
        for switch, (contact, sign, given) in enumerate(self.switches):
            if contact == index and switch in modes.closed:
                depth, side = x - sign * given["clearance"], sign
                total += given["stiffness"] * depth + given["cubic"] * depth**3
        if law == "viscous":
            total += numbers["viscous_damping"] * v * (side != 0)
        elif law == "hunt-crossley":
            total += numbers["impact_damping"] * side * total * v
        elif law not in ("elastic", "rigid"):
            raise NotImplementedError(law)
        return total, side

    def limit(self, index, q, v, a, modes):
        """Return the limit of friction and its derivative over time."""
        law, host, numbers = self.contacts[index].law, self.host[index], self.numbers[index]
        if law.by == "limit":
            return numbers["limit"], 0.0
        if law.by == "stages":
            closed = [self.switches[k][2]["hysteresis"] for k in modes.closed if self.switches[k][0] == host]
            return numbers["limit"] + sum(closed), 0.0
        x, rate, turn = (float(self.e[host] @ each) for each in (q, v, a))
        force, side = self.spring(host, x + 1e-100j * rate, rate + 1e-100j * turn, modes)
        pressed = complex(numbers["coefficient"] * side * force)
        return pressed.real, pressed.imag * 1e100

    def motion(self, t, y, modes):
        """Return accelerations, the force of each contact, and limits; forces include reactions."""
        n = self.n
        q, v, none = y[:n], y[n : 2 * n], np.zeros(n)
        f = np.zeros(len(self.contacts))
        limits = {index: self.limit(index, q, v, none, modes)[0] for index in self.dry}
        for index, law in enumerate(self.law):
            if law == "jenkins":
                stuck = self.numbers[index]["stiffness"] * y[self.place[index]]
                f[index] = modes.slip[index] * limits[index] if modes.slip[index] else stuck
            elif law == "coulomb":
                f[index] = modes.slip[index] * limits[index]
            else:
                f[index] = self.spring(index, self.e[index] @ q, self.e[index] @ v, modes)[0]
        right = self.mean - self.stiffness @ q - self.damping @ v - f @ self.d
        for shape, pace, phase in self.loads:
            right = right + math.cos(pace * t + phase) * shape
        a = self.inverse @ right
        active = self.active(modes)
        if active:
            push = self.inverse @ self.d[active].T
            reactions = np.linalg.solve(self.e[active] @ push, self.e[active] @ a)
            a = a - push @ reactions
            f[active] = reactions
        return a, f, limits

    def active(self, modes):
        """Return the contacts that have a reaction."""
        stuck = [index for index in self.dry if self.law[index] == "coulomb" and not modes.slip[index]]
        return [*stuck, *(self.switches[switch][0] for switch in sorted(modes.held))]

    def slip_rate(self, index, y):
        """Return the rate of the deflection less the speed of the base."""
        return float(self.e[index] @ y[self.n : 2 * self.n]) - self.numbers[index]["speed"]

    def sliding(self, index, y, a, modes):
        """Return the rate of the slider of a Jenkins element in slip, in the direction of slip."""
        slope = self.limit(index, y[: self.n], y[self.n : 2 * self.n], a, modes)[1]
        return modes.slip[index] * self.slip_rate(index, y) - slope / self.numbers[index]["stiffness"]

    def rates(self, t, y, modes):
        """Return the derivative of positions, velocities, extensions, and energies over time."""
        n = self.n
        v = y[n : 2 * n]
        a, f, _ = self.motion(t, y, modes)
        extensions, heat = [], np.zeros(len(self.contacts))
        for index in self.dry:
            rate, slip = self.slip_rate(index, y), modes.slip[index]
            heat[index] = f[index] * rate if slip else 0.0
            if index in self.place:
                stiffness = self.numbers[index]["stiffness"]
                still = 0.0 if self.is_idle(index, y, modes) else rate
                extensions.append(slip * self.limit(index, y[:n], v, a, modes)[1] / stiffness if slip else still)
                heat[index] -= f[index] * extensions[-1] if slip else 0.0
        work = [math.cos(pace * t + phase) * (shape @ v) for shape, pace, phase in self.loads]
        taken = f * (self.d @ v)
        return np.concatenate((v, a, extensions, work, [self.mean @ v], taken, heat, [v @ self.damping @ v]))

    def is_idle(self, index, y, modes):
        """Return True for friction of a contact that is open, and has no force."""
        by, host = self.contacts[index].law.by, self.host[index]
        opened = not any(self.switches[k][0] == host for k in modes.closed)
        return (by == "normal" and opened) or (by == "stages" and self.limit(index, y, y, y, modes)[0] == 0.0)

    # ---- guards

    def gap(self, switch, y):
        """Return the distance from a breakpoint, positive where open, and its rate."""
        index, side, given = self.switches[switch]
        x, rate = self.e[index] @ y[: self.n], self.e[index] @ y[self.n : 2 * self.n]
        return given["clearance"] - side * float(x), -side * float(rate)

    def guards(self, t, y, modes):
        """Return each guard by the kind and the index of what may change."""
        a, f, limits = self.motion(t, y, modes)
        found = {}
        for switch, (index, side, _) in enumerate(self.switches):
            if switch in modes.held:
                found["contact", switch] = side * f[index]
            else:
                found["contact", switch] = self.gap(switch, y)[0] * (-1.0 if switch in modes.closed else 1.0)
        for index in self.dry:
            slip = modes.slip[index]
            if self.law[index] == "coulomb":
                inside = self.numbers[index]["static"] * limits[index] - abs(f[index])
                found["slip", index] = slip * self.slip_rate(index, y) if slip else inside
            elif not self.is_idle(index, y, modes):
                found["slip", index] = self.sliding(index, y, a, modes) if slip else limits[index] - abs(f[index])
        return found

    # ---- modes

    def start(self, t, y, log):
        """Return the modes of a motion that starts in a state."""
        modes = Modes()
        for switch, (index, _, _) in enumerate(self.switches):
            gap, rate = self.gap(switch, y)
            if self.law[index] != "rigid" and (gap < -1e-13 or (abs(gap) <= 1e-13 and rate < 0.0)):
                modes.closed.add(switch)
        modes.slip = dict.fromkeys(self.dry, 0)
        for index in self.dry:
            rate = self.slip_rate(index, y)
            if self.law[index] == "coulomb":
                modes.slip[index] = 0 if abs(rate) <= _REST else round(math.copysign(1.0, rate))
            elif not self.is_idle(index, y, modes):
                self.set_slider(index, t, y, modes)
        self.decide(t, y, modes)
        for switch, (index, _, _) in enumerate(self.switches):
            if self.law[index] == "rigid" and abs(self.gap(switch, y)[0]) <= 1e-13:
                self.strike(switch, t, y, modes, log, None)
        return modes

    def set_slider(self, index, t, y, modes):
        """Set the mode of a Jenkins element by its extension, and shorten that to its limit."""
        limit = self.limit(index, y[: self.n], y[self.n : 2 * self.n], 0.0 * y[: self.n], modes)[0]
        place = limit / self.numbers[index]["stiffness"]
        z, modes.slip[index] = y[self.place[index]], 0
        if abs(z) >= place * (1.0 - 1e-13) or place <= 1e-12:
            side = round(math.copysign(1.0, z if place > 1e-12 else self.slip_rate(index, y)))
            y[self.place[index]], modes.slip[index] = side * place, side
            if self.is_idle(index, y, modes) or not self.sliding(index, y, self.motion(t, y, modes)[0], modes) > 0.0:
                modes.slip[index] = 0

    def decide(self, t, y, modes, slipping=()):
        """Decide which rigid friction at rest sticks: as many as can; `slipping` are those that were just released."""
        at_rest = [
            index
            for index in self.dry
            if self.law[index] == "coulomb" and index not in slipping and abs(self.slip_rate(index, y)) <= _REST
        ]
        for slips in sorted(product((0, 1, -1), repeat=len(at_rest)), key=lambda each: sum(map(abs, each))):
            modes.slip.update(zip(at_rest, slips, strict=True))
            try:
                a, f, limits = self.motion(t, y, modes)
            except np.linalg.LinAlgError:  # too many would stick
                continue
            if all(
                slip * float(self.e[index] @ a) > (0.0 if limits[index] else -1e-12)
                if slip
                else limits[index] and abs(f[index]) <= self.numbers[index]["static"] * limits[index] * (1.0 + 1e-11)
                for index, slip in zip(at_rest, slips, strict=True)
            ):
                break
        else:
            raise ArithmeticError("friction has no consistent mode")
        self.project(y, modes)

    def project(self, y, modes):
        """Make the rates of all active constraints vanish."""
        active = self.active(modes)
        if active:
            push = self.inverse @ self.d[active].T
            rates = self.e[active] @ y[self.n : 2 * self.n] - [self.numbers[index]["speed"] for index in active]
            y[self.n : 2 * self.n] -= push @ np.linalg.solve(self.e[active] @ push, rates)

    def strike(self, switch, t, y, modes, log, lost):
        """Reverse the rate at a rigid stop, or hold it if the flight would be short; then other stops that are hit."""
        n = self.n
        rate = self.gap(switch, y)[1]
        index = self.switches[switch][0]
        push = self.inverse @ self.d[index]
        before = y[n : 2 * n].copy()
        side = self.switches[switch][1]
        if rate < 0.0:
            modes.held.discard(switch)
            y[n : 2 * n] += side * push * (1.0 + self.numbers[index]["restitution"]) * rate / (self.e[index] @ push)
            for other in self.dry:  # an impact ends stick
                if self.law[other] == "coulomb" and abs(self.slip_rate(other, y)) > _REST:
                    modes.slip[other] = round(math.copysign(1.0, self.slip_rate(other, y)))
                elif self.law[other] == "jenkins" and modes.slip[other]:
                    self.set_slider(other, t, y, modes)
            self.decide(t, y, modes)
        leaves = max(self.gap(switch, y)[1], 0.0)
        turning = -side * float(self.e[index] @ self.motion(t, y, modes)[0])
        if turning < 0.0 and 2.0 * leaves < _HELD * -turning:
            modes.held.add(switch)
            log.append(Event("held", t * self.frequency, switch, 1, -side * leaves))
            self.project(y, modes)
            self.decide(t, y, modes)
        if lost is not None:
            after = y[n : 2 * n]
            lost[index] += 0.5 * (before @ self.mass @ before - after @ self.mass @ after)
        for other in sorted(modes.held - {switch}):
            if self.gap(other, y)[1] < -1e-14:
                self.strike(other, t, y, modes, log, lost)
            elif self.gap(other, y)[1] > _REST:
                modes.held.discard(other)

    def change(self, key, t, y, modes, log, lost):
        """Set the modes after an event."""
        kind, index = key
        theta, slips = t * self.frequency, dict(modes.slip)
        released: tuple[int, ...] = ()
        if kind == "contact":
            contact, side, _ = self.switches[index]
            rate = -side * self.gap(index, y)[1]
            if self.law[contact] == "rigid":
                enters = index not in modes.held
                log.append(Event("contact", theta, index, int(enters), rate))
                if enters:
                    self.strike(index, t, y, modes, log, lost)
                else:
                    modes.held.discard(index)
            else:
                enters = index not in modes.closed
                (modes.closed.add if enters else modes.closed.discard)(index)
                log.append(Event("contact", theta, index, int(enters), rate))
                for other in self.place:
                    if self.host[other] == contact:
                        stretched = y[self.place[other]]
                        self.set_slider(other, t, y, modes)
                        freed = stretched**2 - y[self.place[other]] ** 2
                        lost[other] += 0.5 * self.numbers[other]["stiffness"] * freed
        elif self.law[index] == "jenkins":
            stuck = modes.slip[index] == 0
            z = y[self.place[index]]
            modes.slip[index] = round(math.copysign(1.0, z)) if stuck else 0
        elif not modes.slip[index]:
            modes.slip[index] = round(math.copysign(1.0, self.motion(t, y, modes)[1][index]))
            released = (index,)
        self.decide(t, y, modes, released)
        log += [Event("slip", theta, k, modes.slip[k]) for k in self.dry if modes.slip[k] != slips[k]]

    # ---- integration

    def integrate(self, state, start: float, stop: float, modes: Modes | None = None) -> Result:
        """Integrate over angles from `start` to `stop`."""
        counts = [len(self.loads) + 1, len(self.contacts), len(self.contacts), 1]
        y = np.concatenate((np.array(state, dtype=float), np.zeros(sum(counts))))
        size = len(y) - sum(counts)
        t, end, lost = start / self.frequency, stop / self.frequency, np.zeros(len(self.contacts))
        log: list[Event] = []
        modes = modes or self.start(t, y, log)
        log += [Event("slip", start, index, modes.slip[index]) for index in self.dry]
        last, repeated, step, samples = t, 0, 1e-3, _AFTER + _SAMPLES
        while t < end:
            t, y, key, step = self._piece(t, y, end, modes, step, samples)
            samples = _SAMPLES
            if key is not None:
                samples = _AFTER + _SAMPLES
                self.change(key, t, y, modes, log, lost)
                repeated = repeated + 1 if t - last <= 1e-14 * (1.0 + abs(t)) else 0
                last = t
                if repeated > _AT_ONCE:
                    raise ArithmeticError(f"events repeat at {t}: {log[-3:]}")
        work, taken, heat, damped = np.split(y[size:], np.cumsum(counts)[:-1])
        return Result(y[:size], modes, log, work, taken + lost, heat, float(damped[0]))

    def _hops(self, t0, y0, modes):
        """Return about when each rigid stop is hit that is near, by a parabola."""
        hops = {}
        a = self.motion(t0, y0, modes)[0]
        for switch, (index, side, _) in enumerate(self.switches):
            if self.law[index] == "rigid" and switch not in modes.held:
                (gap, rate), turning = self.gap(switch, y0), -side * float(self.e[index] @ a)
                if turning < 0.0:
                    root = (rate + math.sqrt(max(rate**2 - 2.0 * turning * gap, 0.0))) / -turning
                    if 0.0 < root < _HOP:
                        hops["contact", switch] = t0 + root
        return hops

    def _piece(self, t0, y0, end, modes, step, samples):
        """Take one step of DOP853, to the first event in it; return time, state, event, and the next step."""

        def rates(t, y):
            return self.rates(t, y, modes)

        def at(t):
            if t <= t0:
                return y0.copy()
            solver = DOP853(rates, t0, y0, t, first_step=t - t0, **_OPTIONS)
            while solver.status == "running":
                solver.step()
            return solver.y.copy()

        hops = self._hops(t0, y0, modes)
        limit = min([end, *(t0 + 1.5 * (each - t0) for each in hops.values())])
        solver = DOP853(rates, t0, y0, limit, first_step=min(step, limit - t0), **_OPTIONS)
        solver.step()
        t1, y1, dense = solver.t, solver.y.copy(), solver.dense_output()
        found, fired = [], []
        for key, guess in hops.items():
            for _ in range(4):
                gap, rate = self.gap(key[1], at(guess))
                if rate < 0.0:
                    guess = max(guess - gap / rate, t0)
            if guess <= t1:
                found.append((guess, key))
        before: dict = {key: (t0, value) for key, value in self.guards(t0, y0, modes).items()}
        for share in samples:
            t = t0 + share * (t1 - t0)
            new = self.guards(t, dense(t) if share < 1.0 else y1, modes)
            for key, value in new.items():
                known = before[key]
                if key in hops or known is None:
                    continue
                fires = _STRIKES if key[0] == "contact" and key[1] not in modes.held else _FIRES
                if value < -fires and self.guards(t, at(t), modes)[key] < -0.1 * fires:
                    below, above = known[0], t
                    if self.guards(below, at(below), modes)[key] <= 0.0:
                        fired.append((t0, key))
                    else:
                        root = brentq(lambda s, key=key: self.guards(s, at(s), modes)[key], below, above, xtol=1e-15)
                        fired.append((root, key))
                    before[key] = None
                elif value > fires:
                    before[key] = (t, value)
            if fired:
                break
        found += fired
        size = float(solver.h_abs) if solver.status == "running" else max(step, t1 - t0)
        if not found:
            return t1, y1, None, size
        t, key = min(found)
        return t, at(t), key, min(step, size)

"""``python -m tests.flow.beside_heyoka COUNT``: motions of random systems, by the kernel and by heyoka."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import gapwalk as gw
from gapwalk.errors import FlowError, GapwalkError, ModelError
from gapwalk.flow.constraints import reachable_masks
from gapwalk.flow.equations import Equations, natural_length
from gapwalk.flow.flow import PERIOD, Flow
from gapwalk.flow.ramp import Ramped
from gapwalk.model import System
from gapwalk.model.coefficients import ParameterLine, coefficients_of, layout_of, varying
from tests.dry.trials import random_systems
from tests.flow.heyoka_flow import HeyokaFlow
from tests.model.drivetrain import test_drag, test_train
from tests.systems import OWN_LAWS

FORMULAS = (
    ("k*x**3 + c*v*abs(v)", {"k": 1.0, "c": 0.2}),
    ("k*(1 + h*v)*max(x - g, 0)**1.5", {"k": 2.0, "h": 0.1, "g": 0.2}),
    ("-mu*(1 - x**2)*v + a*tanh(b*x)", {"mu": 0.1, "a": 0.3, "b": 4.0}),
    ("m*(1 + a*exp(-(v/s)**2))*tanh(v/w)", {"m": 0.1, "a": 0.5, "s": 0.3, "w": 0.05}),
    ("k*log(1 + exp(a*(x - g)))", {"k": 0.3, "a": 8.0, "g": 0.3}),
    ("k*x/sqrt(g**2 + x**2) + d*sin(p*x)*cos(v)", {"k": 1.0, "g": 0.4, "d": 0.2, "p": 3.0}),
    ("k*abs(x)**1.3*x/(1 + x*x) + d*min(x, v)", {"k": 0.7, "d": 0.2}),
)
SAMPLES = 17
_ROUNDING = 1e-9  # radians


def with_laws(seed: int) -> System:
    """One to three masses with gaps of every law, preload, and numbers that vary."""
    random = np.random.default_rng([seed, 44])
    n = int(random.integers(1, 4))
    names = [f"q{i}" for i in range(n)]
    contacts, loads = [], [gw.Harmonic(random.uniform(0.4, 1.2), dict(zip(names, random.normal(size=n), strict=True)))]
    for number in range(int(random.integers(1, 4))):
        law, name = str(random.choice(OWN_LAWS)), f"c{number}"
        more: dict[str, float] = {}
        if "hunt" in law:
            more = {"impact_damping": 0.1}
        elif law in ("viscous", "pushing"):
            more = {"viscous_damping": 0.2}
        elif law == "piecewise":
            more = {"scale": 1.2, "offset": random.choice([0.0, 0.05]), "even_quadratic": random.choice([0.0, 0.1])}
        side, count = str(random.choice(["both", "positive", "negative"])), int(random.integers(1, 3))
        clearances = np.cumsum(random.uniform(0.05, 0.4, count))
        steps = [
            gw.Stage(
                float(clearance),
                float(random.uniform(0.5, 6.0)),
                float(random.choice([0.0, 0.4])),
                side=side,
                name=f"s{place}" if count > 1 else "",
                numbers={"preload": 0.1, "quadratic": 0.2} if law == "piecewise" and random.random() < 0.5 else {},
            )
            for place, clearance in enumerate(clearances)
        ]
        deflection = dict(zip(names, random.normal(size=n), strict=True))
        contacts.append(gw.Contact(name, deflection, steps, law=law, numbers=more))
        stage = f"{name}.s0" if count > 1 else name
        if random.random() < 0.5:
            loads.append(gw.Harmonic(0.3, varies=f"{stage}.stiffness", order=2, phase=0.4, name=f"k{number}"))
        if random.random() < 0.25:
            loads.append(gw.loads.Rectangle(0.2, {f"{stage}.stiffness": 1.0}, order=3, share=0.6, name=f"r{number}"))
        if random.random() < 0.25:
            loads.append(gw.Harmonic(0.1, varies=f"{name}.deflection", order=2, phase=1.0, name=f"u{number}"))
    return _system(random, names, contacts, loads)


def with_formulas(seed: int) -> System:
    """One to three masses with formulas, a gap, and now and then friction."""
    random = np.random.default_rng([seed, 45])
    n = int(random.integers(1, 4))
    names = [f"q{i}" for i in range(n)]
    contacts: list[Any] = []
    loads: list[Any] = [gw.Harmonic(random.uniform(0.4, 1.2), {names[0]: 1.0}), gw.Harmonic(0.3, {names[-1]: 1.0}, 3)]
    for number, place in enumerate(random.choice(len(FORMULAS), int(random.integers(1, 4)), replace=False).tolist()):
        text, numbers = FORMULAS[place]
        scaled = {name: value * float(random.uniform(0.7, 1.3)) for name, value in numbers.items()}
        contacts.append(gw.force(f"f{number}", {str(random.choice(names)): 1.0}, text, numbers=scaled))
        if random.random() < 0.4:
            loads.append(gw.Harmonic(0.2, varies=f"f{number}.{next(iter(numbers))}", order=2, name=f"v{number}"))
    if random.random() < 0.5:
        contacts.append(
            gw.Contact("gap", {names[0]: 1.0}, [gw.Stage(0.3, 6.0)], law="hunt-crossley", impact_damping=0.1)
        )
    if random.random() < 0.4:
        spring = None if random.random() < 0.5 else 3.0
        contacts.append(gw.friction("rub", {names[-1]: 1.0}, float(random.uniform(0.03, 0.2)), stiffness=spring))
    return _system(random, names, contacts, loads)


def _system(random: Any, names: list[str], contacts: list[Any], loads: list[Any]) -> System:
    root = random.normal(size=(len(names), len(names)))
    stiffness = root @ root.T / len(names) + 0.5 * np.eye(len(names))
    return System(
        names,
        stiffness,
        0.06 * stiffness + 0.02 * np.eye(len(names)),
        np.diag(random.uniform(0.5, 2.0, len(names))),
        contacts,
        {names[0]: float(random.uniform(-0.3, 0.3))},
        loads,
        frequency=float(random.uniform(0.4, 1.8)),
    )


def _train(seed: int) -> gw.train.Train:
    """Return the train of a seed, or of the next one of which a train can be made."""
    while True:
        try:
            return test_drag.random_train(seed)
        except ModelError:
            seed += 1000


KINDS: dict[str, Callable[[int], System]] = {
    "dry": random_systems.random_system,
    "laws": with_laws,
    "formulas": with_formulas,
    "drags": lambda seed: _train(seed).system(),
    "tree": lambda seed: test_train.random_tree(seed).system(),
}


@dataclass
class Difference:
    """Relative differences between the kernel and heyoka, and what else is not the same."""

    name: str
    state: float = 0.0
    matrix: float = 0.0
    column: float = 0.0
    events: int = 0
    has_run_up: bool = False
    growth: float = 0.0  #: Largest entry of the transition matrix.
    note: str = ""
    faults: list[str] = field(default_factory=list)

    @property
    def agrees(self) -> bool:
        """True if all is within rounding."""
        return not self.faults and self.state <= 1e-11 and self.matrix <= 1e-9 and self.column <= 1e-9


def compared(number: int) -> Difference:
    """Compare the motions of one system over a period, with all derivatives, with its turns, and in a run-up."""
    kind, seed = [*KINDS][number % len(KINDS)], number // len(KINDS)
    system, random = KINDS[kind](seed), np.random.default_rng([number, 46])
    found = Difference(f"{kind} {seed}")
    free = [name for name in system.structure.names if name != "frequency" and system[name] != 0.0]
    names = ["frequency", str(random.choice(free))]
    coefficients, pattern = coefficients_of(system), coefficients_of(system) != 0.0
    masks = varying(system, names)
    for mask in masks:
        pattern |= mask
    whole, *directions = (
        np.frombuffer(mask, dtype=bool)
        for mask in reachable_masks(system.structure, tuple(mask.tobytes() for mask in (pattern, *masks)))
    )
    layout = layout_of(system.structure)
    equations = Equations(layout, whole, tuple(np.flatnonzero(mask) for mask in directions))
    along = np.array([ParameterLine(system, name).coefficients(system[name])[1] for name in names])
    thetas, n = np.linspace(0.0, PERIOD, SAMPLES), system.size
    flows = [each(equations, transition=True) for each in (Flow, HeyokaFlow)]
    plain = Equations(layout, whole)
    surveys = [each(plain, survey=True) for each in (Flow, HeyokaFlow)]
    size = min(natural_length(layout, coefficients), 1.0)
    start = np.zeros(system.structure.state_size)
    start[: 2 * n] = size * random.normal(size=2 * n)
    if kind in ("drags", "tree"):
        start[: 2 * n] *= np.repeat([0.1, 0.01], n)
        start[2 * n - 1] *= 1e-3 if kind == "drags" else 1.0  # of the turn of the whole train
    for share in (1.0, 0.3, 0.1, 0.03, 0.0):
        try:
            flows[0].integrate(coefficients, share * start, 0.0, PERIOD, along)
            start = share * start
            break
        except FlowError as error:
            found.note = str(error)
    else:
        return found
    found.note = ""
    mine, other = (_outcome(lambda flow=flow: flow.vary(coefficients, start, thetas, along)) for flow in flows)
    if isinstance(mine, str) or isinstance(other, str):
        found.faults.append(f"kernel: {_words(mine)}; heyoka: {_words(other)}")
        return found
    found.state = max(
        _difference(mine.states[:, part], other.states[:, part])
        for part in (slice(n), slice(n, 2 * n), slice(2 * n, None))
    )
    found.matrix = _difference(mine.transitions, other.transitions)
    # a column that is far smaller than the motion over the number is rounding
    least = 1e-3 * np.abs(other.states).max() / np.abs([system[name] for name in names])
    found.column = max(_difference(mine.sensitivities[..., k], other.sensitivities[..., k], least[k]) for k in range(2))
    found.growth = float(np.abs(mine.transitions).max(initial=0.0))
    found.events = sum(map(len, mine.logs))
    events = _events(mine)
    _compare_events(found, "event", events, _events(other))
    mine, other = (_outcome(lambda flow=flow: flow.survey(coefficients, start, thetas)) for flow in surveys)
    if isinstance(mine, str) or isinstance(other, str):
        if mine != other:  # the words of an error may be the same
            found.faults.append(f"survey: kernel: {_words(mine)}; heyoka: {_words(other)}")
        return found
    found.state = max(found.state, *(_difference(*pair) for pair in zip(mine[0], other[0], strict=True)))
    turns = [[(turn.event, turn.theta) for turn in each[1]] for each in (mine, other)]
    # what is held keeps still in an impact: by rounding alone its rate changes its sign there, or does not
    still = [theta for (kind, *_), theta in events if kind == "impact"] if mine[2].holds else []
    _compare_events(found, "turn", *turns, still)
    _run_up(found, system, start)
    return found


def _run_up(found: Difference, system: System, start: np.ndarray) -> None:
    """Compare a run-up, where a system can run up."""
    try:
        ramps = [Ramped(system), Ramped(system)]
        ramps[1].__dict__["flow"] = HeyokaFlow(ramps[0].flow.equations)
    except ModelError:
        return
    found.has_run_up, speed = True, system.frequency
    angles = np.linspace(0.0, PERIOD, SAMPLES)
    mine, other = (_outcome(lambda ramp=ramp: ramp.sample(start, angles, speed, 0.02 * speed**2)) for ramp in ramps)
    if isinstance(mine, str) or isinstance(other, str):
        if mine != other:
            found.faults.append(f"run-up: kernel: {_words(mine)}; heyoka: {_words(other)}")
        return
    found.state = max(found.state, _difference(mine.states, other.states))
    _compare_events(found, "event of the run-up", _events(mine), _events(other))


def _outcome(work: Callable[[], Any]) -> Any:
    try:
        return work()
    except GapwalkError as error:
        return str(error)


def _words(outcome: Any) -> str:
    return outcome if isinstance(outcome, str) else "a motion"


def _difference(one: np.ndarray, other: np.ndarray, least: float = 0.0) -> float:
    size = np.abs(other).max(initial=least)
    return float(np.abs(one - other).max(initial=0.0) / size) if size else float(np.abs(one).max(initial=0.0))


def _events(found: Any) -> list[tuple[Any, float]]:
    """Return all events with their angles, without modes that last for no more than rounding."""
    contacts, slips, holds, impacts = found.logs
    events = [(("contact", each.switch, each.enters), each.theta) for each in contacts]
    events += [(("impact",), each.theta) for each in impacts]
    modes = {("slip", contact): [(e.theta, e.slip) for e in slips if e.contact == contact] for contact in range(9)}
    modes["held",] = [(each.theta, each.reactions) for each in holds]
    for key, changes in modes.items():
        last: Any = None
        for place, (theta, mode) in enumerate(changes):
            following = changes[place + 1][0] if place + 1 < len(changes) else np.inf
            if following - theta > _ROUNDING and mode != last:
                events.append(((*key, mode), theta))
                last = mode
    return sorted(events, key=lambda each: (str(each[0]), each[1]))


def _compare_events(found: Difference, what: str, mine: list[Any], other: list[Any], but: Sequence[float] = ()) -> None:
    """Find for each event its partner, at the same angle to rounding; none is needed at some angles."""
    for one, two, by in ((mine, other, "kernel"), (other, mine, "heyoka")):
        for key, theta in one:
            near = min((abs(theta - each[1]) for each in two if each[0] == key), default=np.inf)
            if near > _ROUNDING and np.abs(theta - np.array([0.0, PERIOD, *but])).min() > _ROUNDING:
                found.faults.append(f"{what} {key} at {theta:.12g} by {by}, the other one's is {near:.1e} away")


def main() -> int:
    """Compare as many systems as are asked for, and print the worst."""
    first, last = (0, int(sys.argv[1])) if len(sys.argv) == 2 else (int(sys.argv[1]), int(sys.argv[2]))
    every = []
    for number in range(first, last):
        found = compared(number)
        every.append(found)
        if found.faults or found.note or not found.agrees:
            print(number, found, flush=True)
    for key in ("state", "matrix", "column"):
        worst = max(every, key=lambda each: getattr(each, key))
        ordered = sorted(getattr(each, key) for each in every)
        print(f"{key}: median {ordered[len(every) // 2]:.1e}, worst {getattr(worst, key):.1e} of {worst.name}")
    events = sum(each.events for each in every)
    print(
        f"{sum(each.has_run_up for each in every)} run-ups, {sum(bool(each.note) for each in every)} without a motion"
    )
    print(f"{len(every)} systems, {events} events, {sum(not each.agrees for each in every)} differ")
    return int(any(not each.agrees for each in every))


if __name__ == "__main__":
    sys.exit(main())

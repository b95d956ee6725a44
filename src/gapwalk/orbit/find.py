"""Search for one orbit, from static equilibrium, from a given state, or from the end of a transient.

If the end of a transient leads to no orbit (it may be unstable and attract nothing), further starts are tried.
`carry` continues an orbit to other parameter values on its branch, by small steps along the exact tangent.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from gapwalk.ensemble.batch_flow import state_at_rest
from gapwalk.ensemble.lanes import Lanes, prefers_lanes, turn_of
from gapwalk.errors import ConvergenceError, FlowError, ModelError, NumericalError, UnfitError
from gapwalk.flow.contact_events import RestOnJumpError
from gapwalk.flow.equations import magnitude, natural_length
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.flow.motion import check_state
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.modes import dissipation_doubts
from gapwalk.model.static_force import formulas_of
from gapwalk.model.system import System, check_system
from gapwalk.orbit.drifting import brought_back, drifts_of
from gapwalk.orbit.method import Method, chosen
from gapwalk.orbit.orbit import Orbit, sensitivity
from gapwalk.orbit.orbit_equation import Newton, OrbitEquation, solve
from gapwalk.orbit.shooting import Shooting, ShootingEquation

_NEWTON = Newton(iterations=6, halvings=0)  # from a good guess two or three iterations suffice
_ASTRAY = 0.35  # distance of the orbit from the guess, relative to the step, beyond which it may be on another branch
_CLOSE = 1e-7  # distance, relative to the state, below which the guess is the orbit
_SHORTEST = 1.0 / 16384  # smallest step, as a share of the whole change
_STROBES = 64  # number of orbit periods of the settled motion that are sampled
_NEAREST = 4  # number of its states that are tried
_RATIOS = (1.25, 0.8, 1.6, 0.625, 2.5, 0.4)  # of the frequency at which an orbit is sought and followed from there

Starts = Iterator[tuple[str, Callable[[], NDArray[np.float64]]]]
_TRANSIENT = 400  # largest number of forcing periods before Newton's method starts
_EXACTLY = 8  # the same for the end of a transient whose beginning took equal steps
_GROWS = 1e9  # factor from the smallest size of a transient beyond which it diverges
_ASIDE = 1e-3  # of the natural length: beside a place where a formula has no value
_BEYOND_EDGE = [1e-8 * 4.0**power for power in range(8)]  # lengths from where friction still slips to one side
_SETTLED = 1e-4  # relative change over one orbit below which Newton's method starts
_SAME = 0.1  # of the ranges of coordinates: equal steps keep a lightly damped motion moving by some percent


def find_orbit(
    system: System,
    period: int = 1,
    start: str | Sequence[float] | NDArray[np.float64] | Orbit = "settle",
    *,
    method: Method | None = None,
    newton: Newton | None = None,
    at: Mapping[str, float] | None = None,
    **values: float,
) -> Orbit:
    """Find a periodic orbit.

    Parameters
    ----------
    system
        The system.
    period
        m: forcing periods after which the orbit repeats.
    start
        ``"rest"``: Newton's method from the state zero. ``"settle"``: Newton's method from the end of a transient from
        rest. If that finds no orbit, other starts are tried: states of the settled motion that nearly repeat, their
        mean, rest, orbits at other frequencies that are followed to this frequency, and harmonic balance. ``"linear"``:
        the linear response with all gaps open, stable or not. Or an orbit, or a state at theta = 0: positions, then
        velocities, then extensions of Jenkins elements, which are 0 if they are left out. If small changes of the
        motion grow so much that Newton's method fails, the period is divided into more segments.
    method
        Discretisation of the orbit: `Shooting` (the default) or `Balance`.
    newton
        Options of Newton's method.
    at, **values
        Parameter values to change first: ``find_orbit(system, frequency=1.9)``.

    Returns
    -------
    Orbit
        The orbit.

    Raises
    ------
    ModelError
        For an invalid start, period or parameter.
    ConvergenceError
        If no orbit is found; the message lists the starts that were tried.

    Notes
    -----
    Shooting: Padmanabhan and Singh (1995), section 3. Newton's method: Deuflhard (2011), *Newton Methods for Nonlinear
    Problems*.

    Examples
    --------
    >>> import gapwalk as gw
    >>> mass = gw.System(
    ...     ["x"], mass=[1.0], damping=[0.1], stiffness=[1.0], harmonics=[gw.Harmonic(0.1, {"x": 1.0})], frequency=0.5
    ... )
    >>> print(f"{gw.find_orbit(mass).measure('half.x'):.6f}")  # half of the range of x
    0.133038
    """
    check_system(system, "find_orbit")
    system = system.at(at, **values)
    equation = chosen(method).pose(system, None, period)
    if not (isinstance(start, str) and start == "settle"):
        return _near(equation, initial_state(system, start, period), newton)
    return _found(equation, newton)


def orbit_near(system: System, period: int, state: NDArray[np.float64], method: Method | None = None) -> Orbit | None:
    """Return the stable orbit near a state of a motion that has nearly settled; None if there is none."""
    try:
        orbit = find_orbit(system, period, state, method=method, newton=_NEWTON)
    except NumericalError:
        return None
    spans = np.ptp(orbit.extremes[:, :2], axis=1)
    if (turn := turn_of(system.structure)) is not None:
        spans[turn] = np.inf  # the rotation as a whole has no range
    is_near = np.all(np.abs(orbit.state - state)[: len(spans)] <= _SAME * spans)
    return orbit if is_near and orbit.stable else None


def _near(equation: OrbitEquation, state: NDArray[np.float64], newton: Newton | None) -> Orbit:
    """Return the orbit nearest to a state; where small changes of its motion grow too much, by finer equations."""
    try:
        return _solved(equation, equation.start(state), newton)
    except NumericalError:
        for finer, unknowns in equation.divided(state):
            with suppress(NumericalError):
                return _solved(finer, unknowns, newton)
        raise


def _solved(equation: OrbitEquation, guess: NDArray[np.float64], newton: Newton | None) -> Orbit:
    """Return the orbit nearest to a guess, refining the equation as necessary."""
    orbit = _solution(equation, guess, newton)
    inaccuracy = equation.inaccuracy(orbit)
    if not inaccuracy:
        return _off_the_edge(equation, orbit, newton)
    finer = equation.finer()
    if finer is None:
        raise ConvergenceError(inaccuracy)
    return _solved(finer, finer.unknowns(orbit), newton)


def _solution(equation: OrbitEquation, guess: NDArray[np.float64], newton: Newton | None) -> Orbit:
    unknowns, evaluation = solve(equation, guess, 0.0, newton)
    return equation.orbit(unknowns, 0.0, evaluation)


def _off_the_edge(equation: OrbitEquation, orbit: Orbit, newton: Newton | None) -> Orbit:
    """Return an orbit near one in which rigid friction slips to one side only, without that slip."""
    # Such slip is rounding: a motion creeps to the edge of a continuum, ever more slowly, and is no orbit until it is
    # there. At the edge, rounding would decide whether friction sticks. So the position is a little beyond it.
    structure, coefficients, n = orbit.system.structure, coefficients_of(orbit.system), orbit.system.size
    layout = layout_of(structure)
    for contact in [each for each, switch in structure.reactions if switch < 0]:
        slips = [each.slip for each in orbit.slips if each.contact == contact and each.slip]
        slots = layout.contacts[contact]
        if not slips or contact in orbit.stuck or [phase.mode for phase in orbit.friction[contact]] != [0]:
            continue
        vector, state, way = coefficients[slots.deflection], orbit.state.copy(), np.zeros(structure.state_size)
        across = vector / float(vector @ vector)
        state[n : 2 * n] -= (0.0 if slots.sway is not None else vector @ state[n : 2 * n]) * across
        way[:n] = slips[0] * natural_length(layout, coefficients) * across
        for place, other in enumerate(structure.memories):  # springs that stick are extended meanwhile
            way[2 * n + place] = way[:n] @ coefficients[layout.contacts[other].deflection] * (other in orbit.stuck)
        for beyond in _BEYOND_EDGE:
            if contact in _solution(equation, equation.start(state + beyond * way), newton).stuck:
                # as far from the edge as that
                orbit = _solution(equation, equation.start(state + 2.0 * beyond * way), newton)
                break
    return orbit


def initial_state(system: System, start: str | Sequence[float] | NDArray[np.float64] | Orbit, period: int = 1):
    """Return the state at theta = 0 of a start, shape (state_size,)."""
    if not isinstance(start, str):
        return check_state(system, start)
    if start == "rest":
        return _at_rest(system)
    if start == "settle":
        return settle(system, _at_rest(system), period)
    if start == "linear":
        return _linear(system)
    raise ModelError(f'start is {start!r}; write "rest", "settle", "linear" or a state of {system.state_size} numbers')


def _linear(system: System) -> NDArray[np.float64]:
    """Return the state at theta = 0 of the response to all harmonics with all gaps open, about the static position."""
    from gapwalk.orbit.harmonic_balance.linear_part import open_response  # imported late: slow, and rarely needed

    state, n = _at_rest(system), system.size
    try:
        frequencies, amplitudes = open_response(system)
    except np.linalg.LinAlgError:
        raise ModelError(
            'start is "linear", but without damping there is no linear response at resonance; write start = "settle"'
        ) from None
    state[:n] += amplitudes.sum(axis=1).real
    state[n : 2 * n] += (1j * frequencies * amplitudes).sum(axis=1).real
    return state


def _at_rest(system: System) -> NDArray[np.float64]:
    """Return the state at rest, or one beside it where a formula has no finite value or slope there."""
    state, n = state_at_rest(system), system.size
    if any(not each.at(state[:n], state[n : 2 * n]).is_finite for each in formulas_of(system)):
        aside = _ASIDE * natural_length(layout_of(system.structure), coefficients_of(system))
        state[:n] += aside * np.cos(np.arange(n) + 1.0)
    return state


def settle(system: System, state: NDArray[np.float64], period: int = 1) -> NDArray[np.float64]:
    """Integrate the transient from a state until it nearly repeats after `period` forcing periods."""
    # A motion that grows without a bound, as in an unstable linear system, is no start: the first state is returned.
    # One that a jump of a force holds at rest from the start begins in motion instead, as the loads might not set it
    # free.
    flow, coefficients, first = flow_of(system), coefficients_of(system), state
    most, drifts = _TRANSIENT, drifts_of(system)
    if prefers_lanes(system):
        state, most = _by_equal_steps(system, state, period), _EXACTLY
    largest = math.inf
    for _ in range(max(1, most // period)):
        try:
            following = flow.integrate(coefficients, state, 0.0, PERIOD * period).state
            following = brought_back(drifts, following)
        except RestOnJumpError:
            if state is not first or np.any(first[system.size : 2 * system.size]):
                raise
            state = first = first.copy()
            speed = natural_length(layout_of(system.structure), coefficients) * system.frequency
            state[system.size : 2 * system.size] = speed
            continue
        size = magnitude(following, system)
        largest = min(largest, _GROWS * size)
        if size > largest:
            return first
        if np.abs(following - state).max() <= _SETTLED * size:
            return following
        state = following
    return state


def _by_equal_steps(system: System, state: NDArray[np.float64], period: int) -> NDArray[np.float64]:
    """Return the state after most of a transient, less accurately and many times as fast; the same if it diverges."""
    lanes = Lanes(system.structure, coefficients_of(system)[None], state[None], kinds=())
    before = following = state
    for _ in range(max(1, _TRANSIENT // period)):
        for _ in range(period):
            lanes.advance()
        (following,) = lanes.states
        if lanes.diverged.any():
            return state
        if np.abs(following - before).max() <= _SETTLED * magnitude(following, system):
            break
        before = following
    return following


def _found(equation: OrbitEquation, newton: Newton | None) -> Orbit:
    """Return the orbit found from a transient, or else the first found from another start."""
    system, period, settled = equation.system, equation.period, None
    doubts = dissipation_doubts(system)
    try:
        settled = settle(system, _at_rest(system), period)
        return _solved(equation, equation.start(settled), newton)
    except NumericalError as error:
        if isinstance(error, RestOnJumpError) or (settled is None and not doubts):
            raise  # if the transient diverges, other starts do not help
        first = error

    def settled_at(other: System) -> Orbit:
        return _solved(ShootingEquation(other, None, period), settle(other, _at_rest(other), period), newton)

    tried = ["a transient from rest"]
    for words, state in other_starts(system, period, settled, settled_at):
        try:
            return _solved(equation, equation.start(state()), newton)
        except (NumericalError, UnfitError):  # harmonic balance does not include all forces
            if words not in tried:
                tried.append(words)
    name = system.structure.names[0]
    advice = (
        f"Give a state near the orbit (start = [...]), follow it from another value of {name}, or look for another "
        f"period (period = {2 * period}): `gapwalk.settle` shows what the motion settles on"
    )
    doubts = [*doubts, *_overruns(system)]
    if doubts:
        advice = ". ".join(f"{text[0].upper()}{text[1:]}" for text in doubts)
    raise ConvergenceError(
        f"no period-{period} orbit found. Tried as starts: {', '.join(tried)} (the first: {first}). {advice}"
    ) from first


def _overruns(system: System) -> Iterator[str]:
    """Say which contacts on one side, as freewheels, the mean load holds open for ever."""
    from gapwalk.model.equilibria import find_equilibria  # imported late: rarely needed

    free = [
        each.name
        for each in system.structure.contacts
        if each.stages and not each.law.is_dry and len({sign for _, sign in each.sides}) == 1
    ]
    if free and not find_equilibria(system):
        yield (
            f"{' or '.join(free)} acts on one side only, and nothing holds the mean load: it overruns for ever, so "
            "that no motion repeats. Write the other side, a load that it can carry, or a drag in its place"
        )


def other_starts(
    system: System, period: int, settled: NDArray[np.float64] | None, find: Callable[[System], Orbit]
) -> Starts:
    """Yield states near which an orbit may be, the cheapest first: a description of each, and a function for it."""
    # If the orbit is unstable, the motion settles on another one around it, or on chaos. Such motions come near the
    # orbit now and then, and it lies near their mean. Otherwise it is found at a frequency at which it is stable, and
    # followed to this one.
    if settled is not None:
        flow, coefficients, motion = flow_of(system), coefficients_of(system), [settled]
        try:
            for _ in range(_STROBES - 1):
                motion.append(flow.integrate(coefficients, motion[-1], 0.0, PERIOD * period).state)
        except RestOnJumpError:
            raise
        except NumericalError:  # the motion may diverge
            pass
        if len(motion) == _STROBES:
            states = np.array(motion)
            nearest = np.argsort(np.linalg.norm(np.diff(states, axis=0), axis=1))[:_NEAREST]
            yield from (("states that nearly repeat", lambda state=state: state) for state in states[nearest])
            yield "their mean", lambda: states.mean(axis=0)
    yield "rest", lambda: _at_rest(system)
    name = system.structure.names[0]
    for ratio in _RATIOS:
        other = system.at({name: ratio * system[name]})
        yield f"{name} {other[name]:.4g}", lambda other=other: carry(find(other), system, [name]).state
    if system.structure.contacts:
        from gapwalk.orbit.harmonic_balance import Balance  # imported late: slow to import, and rarely needed

        def balanced() -> NDArray[np.float64]:
            equation = Balance(harmonics=10).pose(system, None, period)
            unknowns, evaluation = solve(equation, equation.start(_at_rest(system)), 0.0)
            return equation.orbit(unknowns, 0.0, evaluation).state

        yield "harmonic balance", balanced


def carry(orbit: Orbit, system: System, names: Sequence[str] = ()) -> Orbit:
    """Follow an orbit along a straight line in parameter space, and return the orbit of its branch at the other end."""
    origin = orbit.system
    if system.structure != origin.structure:
        raise ModelError("an orbit can be followed only to other parameter values of its own system")
    known = origin.structure.names
    differing = [known[place] for place in np.flatnonzero(origin.values != system.values).tolist()]
    names = list(names) or differing
    if not set(differing) <= set(names):
        raise ModelError(f"the systems differ by {', '.join(differing)}, but only {', '.join(names)} may change")
    change = np.array([system[name] - origin[name] for name in names])
    share, step = 0.0, 1.0
    while share < 1.0:
        step = min(step, 1.0 - share)
        reached = share + step
        values = (1.0 - reached) * origin.values + reached * system.values
        target = system if reached == 1.0 else System.from_values(origin.structure, values)
        try:
            orbit, share, step = _step(orbit, target, names, change * step), reached, 1.5 * step
        except NumericalError:
            step *= 0.5
        if step < _SHORTEST and share < 1.0:
            where = ", ".join(f"{name} = {orbit.system[name]:.6g}" for name in names)
            raise ConvergenceError(
                f"the orbit was lost on the way: its branch could be followed only up to {where}. Call `follow` along "
                "one of the parameters to see why: there may be a fold, at which it turns back"
            )
    return orbit


def _step(orbit: Orbit, target: System, names: list[str], change) -> Orbit:
    """Take one step along the tangent and correct its end; refuse it if the correction leads elsewhere."""
    moved = sensitivity(orbit, names).state @ change
    equation = Shooting().pose(target, None, orbit.period)
    try:
        state, evaluation = solve(equation, orbit.state + moved, 0.0, _NEWTON)
    except FlowError as error:
        raise ConvergenceError(str(error)) from error
    # positions and velocities have equal weight when measured over theta
    unit = 1.0 / target.state_scales()
    missed = np.linalg.norm(unit * (state - orbit.state - moved))
    if missed > _ASTRAY * np.linalg.norm(unit * moved) + _CLOSE * np.linalg.norm(unit * state):
        raise ConvergenceError("the next orbit lies far from the tangent; the branch bends sharply here, or has a fold")
    return equation.orbit(state, 0.0, evaluation)

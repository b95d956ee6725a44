"""The result of a search as plain JSON values, and back without loss; and its coverage as a table."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from gapwalk.bifurcation.search import Found, SearchResult, Tally, unseen_share
from gapwalk.model.system import System
from gapwalk.motion.motion import switch_names
from gapwalk.motion.switching import ContactEvent
from gapwalk.orbit.orbit import Orbit

Plain = Any
"""What JSON can write."""


def plain_search(result: SearchResult) -> Plain:
    """What a search has met, and what was tried."""
    return {
        "parameter": result.parameter,
        "complete": result.complete,
        "tallies": [plain_tally(tally) for tally in result.tallies],
        "found": [
            {
                "value": found.value,
                "orbit": _plain_orbit(found.orbit),
                "hits_settled": found.hits_settled,
                "hits_newton": found.hits_newton,
                "branch": found.branch,
            }
            for found in result.found
        ],
    }


def search_of(plain: Plain, system: System) -> SearchResult:
    """The same again; any of KeyError, TypeError, ValueError (a ModelError is one) if there is none of this kind.

    Parameters
    ----------
    plain
        As from `plain_search`.
    system
        The system that was searched; its value of the parameter does not matter.
    """
    parameter = str(plain["parameter"])
    tallies = tuple(_tally_of(tally, 2 * system.size) for tally in plain["tallies"])
    found = tuple(
        Found(
            float(each["value"]),
            _orbit_of(each["orbit"], system.at({parameter: float(each["value"])})),
            int(each["hits_settled"]),
            int(each["hits_newton"]),
            None if each["branch"] is None else int(each["branch"]),
        )
        for each in plain["found"]
    )
    return SearchResult(parameter, found, tallies, bool(plain["complete"]))


COVERAGE = ("value", "starts", "settled", "not_periodic", "ran_away", "newton_starts", "orbits", "new", "unseen_share")
"""The headings of `coverage_rows`."""


def coverage_rows(result: SearchResult) -> list[list[float]]:
    """What was tried at each value of the parameter, what was met there, and what may have been missed.

    `orbits` counts those that were met, `new` those on no branch that was known before. With 95 % confidence, a
    periodic attractor that was never met attracts no more than `unseen_share` of the box of starts.
    """
    return [
        [
            tally.value,
            tally.starts,
            tally.settled,
            len(tally.unsettled),
            tally.ran_away,
            tally.newton_starts,
            len(result.at(tally.value)),
            sum(found.is_new for found in result.at(tally.value)),
            unseen_share(tally.settled),
        ]
        for tally in result.tallies
    ]


def plain_tally(tally: Tally) -> Plain:
    """What was tried at one value of the parameter."""
    values = {field.name: getattr(tally, field.name) for field in fields(tally)}
    return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in values.items()}


def _tally_of(plain: Plain, size: int) -> Tally:
    box, unsettled = np.array(plain["box"], dtype=float), np.array(plain["unsettled"], dtype=float)
    if len(box) != size:
        raise ValueError("the box of a search has another size than the state")
    return Tally(**{**plain, "box": box, "unsettled": unsettled.reshape(-1, size)})


def _plain_orbit(orbit: Orbit) -> Plain:
    return {
        "period": orbit.period,
        "state": orbit.state.tolist(),
        "multipliers": [[value.real, value.imag] for value in orbit.multipliers.tolist()],
        "events": [[event.theta, event.switch, event.enters, event.velocity] for event in orbit.events],
        "residual": orbit.residual,
        "steps": orbit.steps,
    }


def _orbit_of(plain: Plain, system: System) -> Orbit:
    state, switches = np.array(plain["state"], dtype=float), len(switch_names(system))
    multipliers = np.array([complex(*parts) for parts in plain["multipliers"]])
    events = tuple(ContactEvent(float(a), int(b), bool(c), float(d)) for a, b, c, d in plain["events"])
    if len(state) != 2 * system.size or len(multipliers) != len(state) or int(plain["period"]) < 1:
        raise ValueError("an orbit that was found has another size than the state")
    if not all(0 <= event.switch < switches for event in events):
        raise ValueError("a contact event belongs to no contact")
    residual, steps = float(plain["residual"]), int(plain["steps"])
    return Orbit(system, int(plain["period"]), state, multipliers, events, residual, steps)

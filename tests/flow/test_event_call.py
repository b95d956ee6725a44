"""Flows in several threads give bitwise what one thread gives, and a flow that nobody needs any more is freed."""

import asyncio
import gc
from concurrent.futures import ThreadPoolExecutor
from weakref import ref

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import FlowError, GapwalkError
from gapwalk.flow.equations import Equations
from gapwalk.flow.flow import PERIOD, Flow
from gapwalk.model.coefficients import coefficients_of, layout_of
from tests.systems import clutch, viscous_stop
from tests.tiers import keeps

FREQUENCIES = np.linspace(0.36, 1.3, 24).tolist()


def seen(frequency: float) -> bytes:
    """What is computed at a frequency, by each kind of flow, bit for bit; the words of an error count too."""
    found = []
    for system in (clutch(frequency=frequency), viscous_stop(frequency)):
        try:
            orbit = gw.find_orbit(system, start="rest")
            motion = gw.integrate(system, orbit.state * 1.01, periods=3)
        except GapwalkError as error:
            found.append(str(error).encode())
            continue
        numbers = (orbit.state, orbit.multipliers, orbit.extremes, motion.q, motion.v)
        found += [*(each.tobytes() for each in numbers), repr(motion.events).encode()]
    return b"".join(found)


@pytest.fixture(scope="module")
def alone() -> list[bytes]:
    return [seen(frequency) for frequency in FREQUENCIES]


@keeps("5")
@pytest.mark.parametrize("threads", [2, 5])
def test_threads_get_bitwise_what_one_thread_gets(alone: list[bytes], threads: int) -> None:
    with ThreadPoolExecutor(threads) as pool:
        assert list(pool.map(seen, FREQUENCIES)) == alone


def test_asyncio_gets_bitwise_what_one_thread_gets(alone: list[bytes]) -> None:
    async def all_at_once() -> list[bytes]:
        return await asyncio.gather(*(asyncio.to_thread(seen, frequency) for frequency in FREQUENCIES))

    with ThreadPoolExecutor(1) as thread:  # this one may have an event loop: that of a browser
        assert thread.submit(asyncio.run, all_at_once()).result() == alone


def test_a_call_that_fails_in_one_thread_leaves_the_others_alone() -> None:
    stable, unstable = gw.System(["x"], [[1.0]], [[0.1]]), gw.System(["x"], [[-1.0]], [[0.1]])

    def end(system: gw.System) -> str:
        try:
            return gw.integrate(system, np.array([1.0, 0.0]), periods=300).q[-1].tobytes().hex()
        except FlowError as error:
            return str(error)

    systems = [stable, unstable] * 30
    expected = [end(system) for system in systems]
    assert "diverges" in expected[1]
    assert "diverges" not in expected[0]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(end, systems)) == expected


@pytest.mark.parametrize("survey", [False, True])
def test_a_flow_that_is_let_go_is_freed(survey: bool) -> None:
    """Its integrators call the switches back, which know them: the garbage collector finds such cycles."""
    system = clutch()
    coefficients = coefficients_of(system)
    flow = Flow(Equations(layout_of(system.structure), coefficients != 0.0), survey=survey)
    assert flow.integrate(coefficients, np.full(4, 0.5), 0.0, PERIOD).contacts
    assert len(flow._idle) == 1
    parts = [ref(flow._idle[0]), ref(flow._idle[0]._switchboard), ref(flow)]
    del flow
    gc.collect()
    assert [part() for part in parts] == [None] * 3

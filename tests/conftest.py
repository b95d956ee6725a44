"""Settings that all tests share."""

import gc
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from gapwalk.parallel.threads import work_in_one_thread

work_in_one_thread()  # before NumPy is loaded: threads that wait for one another take ten times as long

from hypothesis import settings

from gapwalk.errors import Interrupted
from gapwalk.parallel import workers
from gapwalk.parallel.processes import Processes
from tests import computed
from tests.cpu_times import CpuTimes
from tests.tiers import examples, is_quick, leave_to_campaign

# the same examples each time: a check that fails once in a hundred runs says nothing to whoever broke it
settings.register_profile("repeatable", derandomize=True, deadline=None, max_examples=examples(50))
settings.load_profile("repeatable")

# what a shell runs in the background does not see Ctrl-C, which many tests are about
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True, scope="session")
def shared_values(tmp_path_factory) -> None:
    """Let the processes of this run of the tests share what they compute (`tests/computed.py`)."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        computed.shared = tmp_path_factory.getbasetemp().parent / "computed"
        computed.shared.mkdir(exist_ok=True)


@pytest.fixture(autouse=True, scope="session")
def one_core() -> Iterator[None]:
    """Where several processes run the tests, what takes all cores takes one: starting others would cost more."""
    with pytest.MonkeyPatch.context() as patch:
        if "PYTEST_XDIST_WORKER" in os.environ:
            patch.setattr(os, "sched_getaffinity", lambda pid: {0}, raising=False)
        yield


class Kept(Processes):
    """Processes that wait for the next who hires as many, unless they had to be stopped at once."""

    def __init__(self, count: int, idle: list[Processes]) -> None:
        super().__init__(count)
        self.idle = idle

    def close(self, *, at_once: bool) -> None:
        if at_once:
            super().close(at_once=True)
        else:
            self.idle.append(self)


@pytest.fixture(scope="session")
def hire() -> Iterator[Callable[[int], Processes]]:
    """Makes processes, or finds some that another test has done with."""
    idle: list[Processes] = []

    def find(count: int) -> Processes:
        found = next((each for each in idle if each.size == count), None)
        if found is None:
            return Kept(count, idle)
        idle.remove(found)
        return found

    yield find
    for each in idle:
        Processes.close(each, at_once=True)


@pytest.fixture
def kept_processes(hire, monkeypatch) -> None:
    """For tests of work by several processes in which it does not matter that they have worked before."""
    monkeypatch.setattr(workers, "Processes", hire)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let one ask for the tests that cost most."""
    parser.addoption(
        "--costly", type=float, metavar="SECONDS", help="print the tests that take more CPU time than this"
    )


def pytest_configure(config: pytest.Config) -> None:
    """Measure what each test takes, where that is asked for."""
    gc.disable()  # collecting thousands of tests makes no garbage that is worth its search, a fifth of the time
    if config.option.costly is not None:
        config.pluginmanager.register(CpuTimes(config.option.costly))


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Where only quick tests are asked for, leave the other files unread: importing them takes as long."""
    is_other = collection_path.suffix == ".py" and not is_quick(collection_path)
    return True if config.option.markexpr == "quick" and is_other else None


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark the slow and the quick tests."""
    leave_to_campaign(items, whole=not any("::" in each for each in config.args))
    for item in items:
        if is_quick(item.path) and not item.get_closest_marker("slow"):
            item.add_marker(pytest.mark.quick)


def pytest_collection_finish() -> None:
    """Keep the garbage collector from looking at thousands of tests again each time that one asks for it."""
    gc.freeze()
    gc.enable()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call():
    """Let an interruption that a test does not expect fail that test: Ctrl-C itself would end the whole run."""
    try:
        return (yield)
    except Interrupted as error:
        raise AssertionError(f"the test did not expect an interruption: {error!r}") from error

"""Settings that all tests share."""

import os
import signal

import pytest
from hypothesis import settings

# the same examples each time: a check that fails once in a hundred runs says nothing to whoever broke it
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")

# what a shell runs in the background does not see Ctrl-C, which many tests are about
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True, scope="session")
def one_core():
    """What takes all cores takes one: the tests run on all of them, and starting a process costs more than their work."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "sched_getaffinity", lambda pid: {0}, raising=False)
        yield

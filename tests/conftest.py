"""Settings that all tests share."""

import signal

from hypothesis import settings

# the same examples each time: a check that fails once in a hundred runs says nothing to whoever broke it
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")

# what a shell runs in the background does not see Ctrl-C, which many tests are about
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

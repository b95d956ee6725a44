"""Settings that all tests share."""

from hypothesis import settings

# the same examples each time: a check that fails once in a hundred runs says nothing to whoever broke it
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")

"""The errors that gapwalk raises; each message says what was given, what is allowed, and what to write instead."""

from typing import Any


class GapwalkError(Exception):
    """Base class of every error that gapwalk raises on purpose."""


class ModelError(GapwalkError, ValueError):
    """A system, a study or a request that makes no sense: the user can correct it."""


class StoreError(ModelError):
    """A result file that cannot be read or written as asked."""


class NumericalError(GapwalkError, ArithmeticError):
    """A computation that could not be completed; the message says how far it came."""


class FlowError(NumericalError):
    """The integration of a motion failed: it diverged, chattered without end, or missed a contact event."""


class ConvergenceError(NumericalError):
    """Newton's method found no solution from the start it was given."""


class VerificationError(NumericalError):
    """A result that was checked by other means and found wrong.

    Attributes
    ----------
    verification
        The `gapwalk.Verification`: the checks, and the places at which some failed.
    """

    def __init__(self, message: str, verification: object = None) -> None:
        super().__init__(message)
        self.verification = verification


class WorkError(NumericalError):
    """Work that other processes could not do: a process died of one piece each time, or all processes are gone.

    Attributes
    ----------
    pieces
        Indices of the pieces of work that were given up; accepted results of the others are kept.
    """

    def __init__(self, message: str, pieces: tuple[int, ...] = ()) -> None:
        super().__init__(message)
        self.pieces = pieces


class Interrupted(KeyboardInterrupt):
    """Ctrl-C in a call that had found something by then; it is stored, if the call stores results.

    It is raised so that nothing after the call continues with a part of the answer.

    Attributes
    ----------
    found
        Return value of the call, as far as it had come.

    Examples
    --------
    >>> try:
    ...     tree = gw.diagram(system, "frequency", (0.4, 1.4))
    ... except gw.errors.Interrupted as stop:
    ...     tree = stop.found

    In a notebook, in the next cell: ``import sys; tree = sys.last_value.found``.
    """

    def __init__(self, found: Any) -> None:
        super().__init__("what was found until then is `found` of this exception, after it sys.last_value.found")
        self.found = found

    def __reduce__(self) -> tuple[type["Interrupted"], tuple[Any]]:
        return Interrupted, (self.found,)

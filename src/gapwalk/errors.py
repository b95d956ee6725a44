"""The errors that gapwalk raises; each message states the given value, the allowed values, and the correction."""

from typing import Any


class GapwalkError(Exception):
    """Base class of every error that gapwalk raises on purpose."""


class ModelError(GapwalkError, ValueError):
    """A system, a study or a request that makes no sense: the user can correct it."""


class StoreError(ModelError):
    """A result file that cannot be read or written as asked."""


class UnfitError(ModelError):
    """A system that a method cannot include; the message says why, and which method can."""


class NumericalError(GapwalkError, ArithmeticError):
    """A computation that could not be completed; the message says how far it came."""


class FlowError(NumericalError):
    """The integration of a motion failed: it diverged, chattered without end, or missed a contact event."""


class ConvergenceError(NumericalError):
    """Newton's method found no solution from the start it was given."""


class OutsideError(ModelError, NumericalError):
    """A value of a parameter at which the system is not known, as beyond a measured table over the speed."""


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
    """Failure of work in other processes: a piece killed its process at each try, or all processes are lost.

    Attributes
    ----------
    pieces
        Indices of the pieces of work that were given up; accepted results of the others are kept.
    """

    def __init__(self, message: str, pieces: tuple[int, ...] = ()) -> None:
        super().__init__(message)
        self.pieces = pieces


class Interrupted(KeyboardInterrupt):
    """Interruption by Ctrl-C of a call that has partial results; they are stored if the call stores results.

    It is raised so that nothing after the call continues with a part of the answer.

    Attributes
    ----------
    found
        Return value of the call so far.

    Examples
    --------
    >>> try:
    ...     tree = gw.diagram(system, "frequency", (0.4, 1.4))
    ... except gw.errors.Interrupted as stop:
    ...     tree = stop.found

    In a notebook, in the next cell: ``import sys; tree = sys.last_value.found``.
    """

    def __init__(self, found: Any) -> None:
        super().__init__("the results so far are `found` of this exception, or afterwards sys.last_value.found")
        self.found = found

    def __reduce__(self) -> tuple[type["Interrupted"], tuple[Any]]:
        return Interrupted, (self.found,)

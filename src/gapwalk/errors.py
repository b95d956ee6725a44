"""The errors that gapwalk raises; each message states the given value, the allowed values, and the correction."""

from typing import Any


class GapwalkError(Exception):
    """Base class of every error that gapwalk raises on purpose.

    Examples
    --------
    >>> try:
    ...     gw.stop("wall", {"x": 1.0}, -1.0, 20.0)
    ... except gw.errors.GapwalkError as error:
    ...     print(error)
    contact 'wall': clearance is -1.0; it must be a number >= 0...
    """


class ModelError(GapwalkError, ValueError):
    """A system, a study or a request that makes no sense: the user can correct it.

    Examples
    --------
    >>> try:
    ...     system.at(speed=1.0)
    ... except gw.errors.ModelError as error:
    ...     print(type(error).__name__)
    ModelError
    """


class StoreError(ModelError):
    """A result file that cannot be read or written as asked.

    Examples
    --------
    >>> try:
    ...     gw.open_result("nothing.gapwalk")
    ... except gw.errors.StoreError as error:
    ...     print("there is no such file")
    there is no such file
    """


class UnfitError(ModelError):
    """A system that a method cannot include; the message says why, and which method can.

    Examples
    --------
    >>> try:
    ...     gw.parallel.batch_flow_of(rubbing).run(np.zeros((1, 2)), 1)
    ... except gw.errors.UnfitError as error:
    ...     print("the batch integrator does not include friction that sticks rigidly")
    the batch integrator does not include friction that sticks rigidly
    """


class NumericalError(GapwalkError, ArithmeticError):
    """A computation that could not be completed; the message says how far it came.

    Examples
    --------
    >>> issubclass(gw.errors.ConvergenceError, gw.errors.NumericalError)
    True
    """


class FlowError(NumericalError):
    """The integration of a motion failed: it diverged, chattered without end, or missed a contact event.

    Examples
    --------
    >>> unstable = gw.System(["x"], [[1.0]], [[-9.0]], harmonics=[gw.Harmonic(0.5, {"x": 1.0})])
    >>> try:
    ...     gw.settle(unstable)
    ... except gw.errors.FlowError as error:
    ...     print("the motion diverges")
    the motion diverges
    """


class ConvergenceError(NumericalError):
    """Newton's method found no solution from the start it was given.

    Examples
    --------
    >>> undamped = gw.System(["x"], [[1.0]], harmonics=[gw.Harmonic(0.5, {"x": 1.0})], frequency=1.0)
    >>> try:
    ...     gw.find_orbit(undamped, start="rest")  # at resonance there is none
    ... except gw.errors.ConvergenceError as error:
    ...     print("no orbit from this start")
    no orbit from this start
    """


class OutsideError(ModelError, NumericalError):
    """A value of a parameter at which the system is not known, as beyond a measured table over the speed.

    Examples
    --------
    >>> table = gw.loads.speed_table([1.0, 2.0], [0.5, 0.6])
    >>> try:
    ...     table.value(3.0)
    ... except gw.errors.ModelError as error:
    ...     print(error)
    the table over the speed covers 1 to 2; it has no value at 3. Extend the table, or stay within it
    """


class VerificationError(NumericalError):
    """A result that was checked by other means and found wrong.

    Attributes
    ----------
    verification
        The record of the verification: the checks, and the places at which some failed.

    Examples
    --------
    >>> try:
    ...     checked = gw.follow(orbit, "frequency", 0.62, verify=True)
    ... except gw.errors.VerificationError as error:
    ...     print(error.verification.breaches)
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

    Examples
    --------
    >>> issubclass(gw.errors.WorkError, gw.errors.NumericalError)
    True
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
        The result of the call, as far as it was computed.

    Examples
    --------
    >>> try:
    ...     tree = gw.diagram(system, "frequency", (0.6, 0.68))
    ... except gw.errors.Interrupted as stopped:
    ...     tree = stopped.found  # the part that was done; in the next cell of a notebook: sys.last_value.found
    >>> tree.complete
    True
    """

    def __init__(self, found: Any) -> None:
        super().__init__("the results so far are `found` of this exception, or afterwards sys.last_value.found")
        self.found = found

    def __reduce__(self) -> tuple[type["Interrupted"], tuple[Any]]:
        return Interrupted, (self.found,)

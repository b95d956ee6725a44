"""The system without its excitation, and the refusal of systems whose equations depend on the angle."""

from __future__ import annotations

from gapwalk.errors import ModelError
from gapwalk.model.angle_dependence import loads_act, numbers_vary
from gapwalk.model.coefficients import layout_of
from gapwalk.model.system import System


def without_excitation(system: System) -> System:
    """Return a system without its excitation: its damping and its mean loads remain.

    Parameters
    ----------
    system
        The system.

    Returns
    -------
    System
        The same system with the amplitudes of all harmonics zero.

    Raises
    ------
    ModelError
        If something still depends on the angle of the excitation: a load of another kind, or a number that varies.

    Examples
    --------
    >>> import gapwalk as gw
    >>> free = gw.free.without_excitation(gw.paper.case("13"))
    >>> free["harmonic1.amplitude"], free["damping.q1.q1"] > 0.0
    (0.0, True)
    """
    names = [f"{load.name}.amplitude" for load in system.structure.harmonics]
    free = system.at({name: 0.0 for name in names if name in system.structure.names})
    check_free(free)
    return free


def check_free(system: System) -> None:
    """Raise a ModelError if the equations of a system depend on the angle of its excitation."""
    if loads_act(system):
        names = ", ".join(load.name for load in layout_of(system.structure).structure.harmonics)
        raise ModelError(
            f"a free motion has no excitation, and {names} acts on this system; take it out with "
            "gw.free.without_excitation(system), or set its amplitude to 0"
        )
    if numbers_vary(system):
        raise ModelError(
            "a number of this system varies over the angle of the excitation, and a free motion has no such angle; set "
            "the amplitude of that variation to 0"
        )

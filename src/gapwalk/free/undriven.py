"""The system without its excitation, and the refusal of systems whose equations depend on the angle."""

from __future__ import annotations

from gapwalk.errors import ModelError
from gapwalk.model.angle_dependence import loads_act, numbers_vary
from gapwalk.model.coefficients import layout_of
from gapwalk.model.system import System


def without_excitation(system: System) -> System:
    """Return a system without its excitation: its damping and its constant loads remain.

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
    free = system.at(dict.fromkeys(amplitudes_of(system), 0.0))
    check_free(free)
    return free


def amplitudes_of(system: System) -> list[str]:
    """Return the names of the amplitudes of all loads that depend on the angle."""
    names = [f"{load.name}.amplitude" for load in system.structure.harmonics if load.multiples]
    return [name for name in names if name in system.structure.names]


def check_constant(system: System) -> None:
    """Raise a ModelError if a constant load depends on the frequency, of which a free motion has its own."""
    for load in system.structure.harmonics:
        if not load.multiples and load.depends_on_frequency:
            raise ModelError(
                f"{load.name} is constant over the angle and depends on the frequency of the excitation, but a free "
                f"motion has a frequency of its own; write the value that {load.name} has at this speed as a mean load"
            )


def check_free(system: System) -> None:
    """Raise a ModelError if the equations of a system depend on the angle of its excitation."""
    if loads_act(system):
        names = ", ".join(load.name for load in layout_of(system.structure).structure.harmonics if load.multiples)
        raise ModelError(
            f"a free motion has no excitation, and {names} acts on this system; take it out with "
            "gw.free.without_excitation(system), or set its amplitude to 0"
        )
    if numbers_vary(system):
        raise ModelError(
            "a number of this system varies over the angle of the excitation, and a free motion has no such angle; set "
            "the amplitude of that variation to 0"
        )

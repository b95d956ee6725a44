"""The system without its excitation, and the refusal of systems whose equations depend on the angle."""

from __future__ import annotations

from gapwalk.errors import ModelError
from gapwalk.model.coefficients import coefficients_of, layout_of
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
    layout, coefficients = layout_of(system.structure), coefficients_of(system)
    first = 2 * layout.structure.size + len(layout.structure.contacts) + 1
    if coefficients[layout.accelerations[:, first:]].any() or layout.cycles:
        names = ", ".join(load.name for load in layout.structure.harmonics)
        raise ModelError(
            f"a free motion has no excitation, and {names} acts on this system; take it out with "
            "gw.free.without_excitation(system), or set its amplitude to 0"
        )
    waves = [wave for slots in layout.contacts for wave in slots.waves.values()]
    waves += [wave for slots in layout.contacts for stage in slots.stages for wave in stage.waves.values()]
    if any(coefficients[wave.lines].any() or wave.cycles for wave in waves):
        raise ModelError(
            "a number of this system varies over the angle of the excitation, and a free motion has no such angle; set "
            "the amplitude of that variation to 0"
        )

"""The parameter sets of the paper's figures (Padmanabhan and Singh 1995, tables 1 to 3), each as a system."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TypeVar

from gapwalk.errors import ModelError
from gapwalk.model.contact import Contact, Stage
from gapwalk.model.loads import Harmonic
from gapwalk.model.problems import did_you_mean
from gapwalk.model.system import System

__all__ = ["DampingReading", "SlopeReading", "case", "describe", "frequency_responses", "names", "parameter_set"]


class SlopeReading(StrEnum):
    """Reading of the slope of the second stage; kappa = K11 is the share of the first stage.

    Examples
    --------
    >>> gw.paper.case("13", slope=gw.paper.SlopeReading.REDUCED).parameters["stage2.clearance"]
    1.0
    """

    REDUCED = "reduced"
    """Slope 1: the tables' n1 and n2 contain the factor 1 - kappa already."""
    LITERAL = "literal"
    """Slope 1 - kappa, as the paper prints it."""


class DampingReading(StrEnum):
    """Reading of the impact damping.

    Examples
    --------
    >>> gw.paper.case("13", damping=gw.paper.DampingReading.DISSIPATIVE).coordinates
    ('q1', 'q3')
    """

    DISSIPATIVE = "dissipative"
    """``g + beta |g| v``, Hunt and Crossley's law."""
    AS_PRINTED = "as-printed"
    """``g (1 + beta v)``, which feeds energy in on the negative side."""


@dataclass(frozen=True, slots=True)
class ParameterSet:
    """Numbers of one figure, non-dimensional, in the signs of the equations of motion (paper, section 2).

    Examples
    --------
    >>> gw.paper.parameter_set("13").stiffness
    (0.1, 0.6, 0.06, 1.1)
    """

    #: stiffness, damping: K11, K12, K21, K22 and C11, C12, C21, C22.
    stiffness: tuple[float, float, float, float]
    damping: tuple[float, float, float, float]
    beta: float  #: Coefficient of the impact damping.
    n: tuple[float, float]  #: n1, n2.
    mean: tuple[float, float]  #: Tm1, Tm2.
    excitation: float = 0.25  #: Te1.
    #: Te2, its order p and its phase phi in radians; None where Te2 = 0.
    second: tuple[float, int, float] | None = None
    frequency: float = 1.9  #: W where the figure has one; otherwise where its response begins.
    is_response: bool = True  #: True if the figure shows a frequency response.
    note: str = ""  #: Decisions beyond the printed tables; empty if there are none.


# kappa = K11; K21 = 0.6 kappa, and n2 = 0.6 n1, as K12 = 0.6 demands.
_PURE_BACKLASH = (0.0, 0.6, 0.0, 1.1)
_KAPPA_01 = (0.1, 0.6, 0.06, 1.1)
_KAPPA_04 = (0.4, 0.6, 0.24, 1.1)
_IMPACT = (0.0, 0.04, 0.0, 0.06)
_VISCOUS = (0.04, 0.04, 0.04, 0.06)
_HEAVY, _LIGHT, _SHAFT = (0.5, 0.25), (0.25, 0.25), (0.25, 0.5)

_VARIED = "The figure varies Te1; 0.25 is a value to begin with, which the paper does not give."
_K = "GUESS: K12 is damaged in the scan"

_heavy_backlash = ParameterSet(_PURE_BACKLASH, _IMPACT, 0.075, (1.0, 0.6), _HEAVY)
_heavy_viscous = ParameterSet(_PURE_BACKLASH, _VISCOUS, 0.0, (1.0, 0.6), _HEAVY)
_rattle = ParameterSet(_PURE_BACKLASH, _IMPACT, 0.1, (1.0, 0.6), _LIGHT, frequency=0.17, is_response=False)
_rattle_viscous = replace(_rattle, damping=_VISCOUS, beta=0.0)
_kappa_01 = ParameterSet(_KAPPA_01, _VISCOUS, 0.05, (0.9, 0.54), _HEAVY)
_kappa_04 = ParameterSet(_KAPPA_04, _VISCOUS, 0.05, (0.6, 0.36), _SHAFT)
_light = replace(_kappa_01, mean=_LIGHT, excitation=0.5)
_dual = replace(_kappa_01, second=(0.1, 2, 0.0))
_dual_120 = replace(_dual, second=(0.1, 2, math.radians(120)))
_varied = replace(_dual, mean=_LIGHT, is_response=False, note=_VARIED)

_CASES = {
    "3-impact": replace(_heavy_backlash, frequency=1.5, is_response=False),
    "3-viscous": replace(_heavy_viscous, frequency=1.5, is_response=False),
    "4a": _heavy_backlash,
    "4b": _heavy_viscous,
    "5": _rattle,
    "6": _rattle_viscous,
    "7-impact": _rattle,
    "7-viscous": _rattle_viscous,
    "8a": replace(
        _rattle,
        note=(
            "GUESS: the scan prints beta = 0, but the figure is of the impact model, so beta > 0; 0.1 is beta of "
            "figures 5 and 7. The paper calls the frequency low; 0.17 is that of figures 5 to 7."
        ),
    ),
    "9a": replace(
        _kappa_01, mean=_SHAFT, note="The caption calls the system heavily loaded, but the table has Tm1 = 0.25."
    ),
    "9b": _kappa_04,
    "10a": _heavy_backlash,
    "10b": replace(_heavy_backlash, n=(0.8, 0.48)),
    "11a": ParameterSet(
        (0.0, 0.3, 0.0, 1.1),
        (0.0, 0.02, 0.0, 0.06),
        0.075,
        (0.7, 0.3),
        _SHAFT,
        note=f"{_K}, where it seems to be 0.3. The resonances should be 0.6 apart in frequency, but are 0.39.",
    ),
    "11b": ParameterSet(
        (0.0, 0.06, 0.0, 1.1),
        _IMPACT,
        0.075,
        (0.6, 1.0),
        _SHAFT,
        note=f"{_K}, where it seems to be 0.06. The resonances should be 0.8 apart in frequency, but are 0.39.",
    ),
    "12": replace(
        _kappa_01,
        note="The scan prints K11 = 0.0, but the paper says kappa = K11 = 0.1, and its K21 = 0.06 is 0.6 K11.",
    ),
    "13": replace(_kappa_01, mean=_LIGHT),
    "14": replace(_kappa_01, mean=_SHAFT),
    "15": _light,
    "16": replace(_light, is_response=False),
    "17": replace(_light, frequency=0.63, is_response=False),
    "18": replace(_light, frequency=0.634, is_response=False),
    "19": replace(_light, frequency=0.636, is_response=False),
    "20a": _dual,
    "20b": _dual_120,
    "21-zero-phase": replace(_dual, is_response=False, note="The close-up of figure 20a."),
    "21-120-degrees": replace(_dual_120, is_response=False, note="The close-up of figure 20b."),
    "22": replace(_dual, second=(0.1, 2, math.pi)),
    "23a": _kappa_04,
    "23b": replace(_kappa_04, second=(0.1, 2, 0.0)),
    "24": replace(_kappa_04, excitation=0.5),
    "25": replace(_kappa_04, excitation=0.5, second=(0.1, 2, 0.0)),
    "26a": _kappa_04,
    "26b": replace(_kappa_04, second=(0.1, 3, 0.0)),
    "27": replace(_varied, frequency=0.25),
    "28": replace(_varied, frequency=0.255),
    "29": replace(_heavy_backlash, mean=_LIGHT, second=(0.1, 2, 0.0), frequency=0.35, is_response=False, note=_VARIED),
}


def names() -> tuple[str, ...]:
    """Return the names of all figures with a parameter set, in the order of the paper.

    Returns
    -------
    tuple of str
        Such as ``13`` and ``20a``.

    Examples
    --------
    >>> len(gw.paper.names()) > 20
    True
    """
    return tuple(_CASES)


def frequency_responses() -> tuple[str, ...]:
    """Return the names of the figures that show a frequency response.

    Returns
    -------
    tuple of str
        In the order of the paper.

    Examples
    --------
    >>> gw.paper.frequency_responses()[:3]
    ('4a', '4b', '9a')
    """
    return tuple(name for name, numbers in _CASES.items() if numbers.is_response)


def parameter_set(name: str) -> ParameterSet:
    """Return the numbers of a figure.

    Parameters
    ----------
    name
        One of `names`. ``"20(a)"``, ``"20A"`` and ``"figure 20a"`` are understood as well.

    Returns
    -------
    ParameterSet
        The numbers.

    Raises
    ------
    ModelError
        If there is none of that name; the message lists them.

    Examples
    --------
    >>> gw.paper.parameter_set("figure 13").mean
    (0.25, 0.25)
    """
    plain = re.sub(r"^fig(ure|\.)?|[\s()]", "", str(name).strip().lower())
    if plain not in _CASES:
        near = [known for known in _CASES if plain and re.match(re.escape(plain) + r"(?!\d)", known)]
        hint = f"did you mean {' or '.join(near)}?" if near else did_you_mean(plain, names())
        listed = "" if hint.startswith("they are") else f" All of them: {', '.join(names())}"
        raise ModelError(f"the paper has no figure {name!r} with a parameter set of its own; {hint}{listed}")
    return _CASES[plain]


def describe(name: str) -> str:
    """Return the decisions for a figure that the printed tables leave open; a guess begins with the word GUESS.

    Parameters
    ----------
    name
        One of `names`.

    Returns
    -------
    str
        Sentences; empty if the tables leave nothing open.

    Raises
    ------
    ModelError
        If there is no figure of that name.

    Examples
    --------
    >>> gw.paper.describe("21-zero-phase")
    'The close-up of figure 20a.'
    """
    return parameter_set(name).note


def case(
    name: str,
    *,
    slope: SlopeReading | str = SlopeReading.REDUCED,
    damping: DampingReading | str = DampingReading.DISSIPATIVE,
) -> System:
    """Return the system of a figure: coordinates q1 and q3, contact ``stage2``, loads ``harmonic1`` and so on.

    Parameters
    ----------
    name
        One of `names`.
    slope, damping
        Interpretations of the paper where it is ambiguous.

    Returns
    -------
    System
        The system, non-dimensional.

    Raises
    ------
    ModelError
        If there is no figure or no reading of that name.

    Examples
    --------
    >>> gw.paper.case("13").coordinates
    ('q1', 'q3')
    """
    numbers = parameter_set(name)
    slope = _reading(SlopeReading, "slope", slope)
    damping = _reading(DampingReading, "damping", damping)
    k11, k12, k21, k22 = numbers.stiffness
    c11, c12, c21, c22 = numbers.damping
    n1, n2 = numbers.n
    stage = Stage(clearance=1.0, stiffness=1.0 if slope is SlopeReading.REDUCED else 1.0 - k11)
    # The viscous figures have the same law with beta = 0: systems of one structure share one compiled flow.
    dissipative = damping is DampingReading.DISSIPATIVE
    law = "hunt-crossley" if dissipative else "hunt-crossley-as-printed"
    contact = Contact("stage2", {"q1": 1.0}, (stage,), {"q1": n1, "q3": -n2}, law, impact_damping=numbers.beta)
    harmonics = [Harmonic(numbers.excitation, {"q1": 1.0})]
    if numbers.second:
        amplitude, order, phase = numbers.second
        harmonics.append(Harmonic(amplitude, {"q1": 1.0}, order, phase))
    return System(
        coordinates=["q1", "q3"],
        stiffness=[[k11, -k12], [-k21, k22]],
        damping=[[c11, -c12], [-c21, c22]],
        contacts=[contact],
        mean=dict(zip(["q1", "q3"], numbers.mean, strict=True)),
        harmonics=harmonics,
        frequency=numbers.frequency,
    )


Reading = TypeVar("Reading", bound=StrEnum)


def _reading(kind: type[Reading], what: str, given: object) -> Reading:
    try:
        return kind(given)
    except ValueError:
        raise ModelError(
            f"{what} is {given!r}; it must be {' or '.join(repr(known.value) for known in kind)}"
        ) from None

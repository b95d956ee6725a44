"""Excitation with two frequencies without a common multiple, such as an engine and a second drive.

The second one is a coordinate of its own: the self-excited oscillator

    z'' + w (z^2 + (z'/w)^2 - 1) z' + w^2 z = 0,

whose only stable motion is ``z = cos(w t)``, exactly, and which nothing else acts upon. So the motion of the whole is a
torus of an ordinary system, with the known rotation number ``w / W``, and everything that holds for tori holds for it.

Method: docs/numerics/notes/tori.md
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.lyapunov import birkhoff_weights
from gapwalk.attractors.section import Strobe
from gapwalk.attractors.settle import SettleOptions, settle
from gapwalk.errors import ConvergenceError, ModelError, NumericalError
from gapwalk.flow.equations import natural_length
from gapwalk.model.bounds import Positive, check_fields
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.contact import ContactForm, force
from gapwalk.model.system import System
from gapwalk.tori.torus import CLOCK, TURN, Torus, error_of, in_steps, odd, of_quasi_periodic
from gapwalk.tori.torus_equation import STROBES, TorusOptions, resolved_torus

_MOST = 64  # the largest denominator of a ratio of frequencies that counts as a fraction
_EQUAL = 1e-9  # distance within which a ratio is that fraction
_LEAST = 256  # the fewest strobes on each curve
_AGREES = 10.0  # errors of a torus within which a shorter return to the same curve is one
_ALIKE = 2.0  # distance of strobes from their curves, over the least for any number of curves, that is as good


@dataclass(frozen=True)
class Tone:
    """A second excitation, ``amplitude * s * cos(frequency * t)``, with a frequency of its own.

    Examples
    --------
    >>> gw.tori.Tone(0.2, {"x": 1.0}, frequency=1.37).name
    'tone'
    """

    amplitude: float  #: In units of a force (of a torque).
    acts_on: Mapping[str, float] = field(hash=False)  #: The vector ``s`` by coordinate name.
    frequency: Positive  #: Its angular frequency, > 0; no multiple or simple fraction of that of the excitation.
    #: Name of the coordinate that carries it. Its numbers are the parameters ``tone.frequency`` and
    #: ``tone_load.amplitude`` of the system.
    name: str = "tone"

    def __post_init__(self) -> None:
        check_fields(self)
        if not self.acts_on:
            raise ModelError("a tone acts on nothing; write the coordinates, as in acts_on={'q1': 1.0}")

    def onto(self, system: System) -> System:
        """Return the system with this second excitation: it has one more coordinate, which is the cosine of the tone.

        The coordinate is scaled to the size of the motion. A force with the name ``tone`` drives it, and another,
        ``tone_load``, lets it act on the system. For a drive train, pass its equations of motion, ``system.equations``.

        Examples
        --------
        >>> mass = gw.System(["x"], [[1.0]], [[0.1]], harmonics=[gw.Harmonic(0.5, {"x": 1.0})])
        >>> gw.tori.Tone(0.2, {"x": 1.0}, frequency=1.37).onto(mass).coordinates
        ('x', 'tone')
        """
        old = system.structure
        if old.assembly is not None:
            raise ModelError(
                "a tone cannot act on a drive train itself, but on its equations of motion; write "
                "tone.onto(system.equations)"
            )
        load = f"{self.name}_load"
        taken = {*system.coordinates, *(each.name for each in (*old.contacts, *old.harmonics))} & {self.name, load}
        if taken:
            raise ModelError(f"the name {min(taken)!r} is taken; give the tone another one, as in name='drive'")
        unknown = [each for each in self.acts_on if each not in system.coordinates]
        if unknown:
            raise ModelError(
                f"the tone acts on {unknown[0]!r}, which is no coordinate; they are {', '.join(system.coordinates)}"
            )
        size = self._size(system)
        clock = force(self.name, {self.name: 1.0 / size}, CLOCK, acts_on={self.name: size}, frequency=self.frequency)
        # forces of contacts stand on the left-hand side of the equations of motion, loads on the right
        pushed = {name: -share for name, share in self.acts_on.items()}
        drive = force(load, {self.name: 1.0 / size}, "amplitude*x", acts_on=pushed, amplitude=self.amplitude)
        added = System(
            (*system.coordinates, self.name),
            stiffness=np.zeros((system.size + 1, system.size + 1)),
            contacts=[clock, drive],
        )
        structure = replace(
            old, coordinates=added.coordinates, contacts=(*old.contacts, ContactForm.of(clock), ContactForm.of(drive))
        )
        known = {**added.parameters, **system.parameters}
        return System.from_values(structure, np.array([known.get(name, 0.0) for name in structure.names]))

    @staticmethod
    def _size(system: System) -> float:
        """Return the length that stands for 1 in the coordinate of the tone: that of the motion, as far as is known."""
        return natural_length(layout_of(system.structure), coefficients_of(system))


def two_tones(
    system: System, tone: Tone, *, settling: SettleOptions | None = None, options: TorusOptions | None = None
) -> Torus:
    """Find the motion under two excitations whose frequencies have no common multiple.

    The motion from rest is followed until it has settled, and its torus is found by Newton's method, from averages of
    the motion at the known rotation number. `follow_tori` follows it along any parameter of the system, also those of
    the tone.

    Parameters
    ----------
    system
        A system with its own excitation.
    tone
        The second excitation.
    settling
        Length of the transient.
    options
        Accuracy and number of samples of the torus.

    Returns
    -------
    Torus
        The torus of the system with the tone (`Tone.onto`): one curve with the rotation number ``tone.frequency /
        frequency``, less its integer part. If the period of the motion has doubled, or is another multiple m of the
        forcing period, there are m curves, and the rotation number is multiplied by m. One of its exponents belongs to
        the tone itself.

    Raises
    ------
    ModelError
        If the ratio of both frequencies is a simple fraction, or the tone does not fit the system.
    ConvergenceError
        If the motion settles on no torus.

    Examples
    --------
    >>> import gapwalk as gw
    >>> mass = gw.System(["x"], [[1.0]], [[0.1]], harmonics=[gw.Harmonic(0.5, {"x": 1.0})], frequency=2.0)
    >>> torus = gw.tori.two_tones(mass, gw.tori.Tone(0.2, {"x": 1.0}, frequency=2.0 * 5.0**0.5))
    >>> torus.system.coordinates, torus.curves, round(torus.rotation, 9)
    (('x', 'tone'), 1, 0.236067977)
    """
    both = tone.onto(system)
    ratio = tone.frequency / system.frequency
    near = Fraction(ratio).limit_denominator(_MOST)
    if abs(ratio - near) < _EQUAL:
        raise ModelError(
            f"the frequency of the tone is {near} of that of the excitation: both repeat together after "
            f"{near.denominator} forcing periods, and the motion is an orbit. Take the common fundamental as the "
            f"frequency, with harmonics of the orders {near.denominator} and {near.numerator}: gw.find_orbit"
        )
    start = np.zeros(both.state_size)
    start[system.size] = tone._size(system)
    strobe, options = Strobe(both), options or TorusOptions()
    state = settle(both, start, settling).strobes[-1]
    problem = ""
    for count in STROBES:
        strobes = strobe.run(state, count)
        state = strobes[-1]
        curves, curve = _curve(strobes, ratio, odd(options.samples - 1))
        try:
            torus = _fewest(resolved_torus(both, curve, curves * ratio, curves, options), ratio, options)
        except NumericalError as error:
            problem = str(error)
            continue
        if torus.stable:
            return torus
        problem = f"the torus of {curves} curves next to it is unstable"
    raise ConvergenceError(
        f"the motion under both excitations settles on no torus of up to {STROBES[-1] // _LEAST} curves: {problem}. "
        "gw.classify(tone.onto(system)) tells what kind of motion it is"
    )


def _fewest(torus: Torus, ratio: float, options: TorusOptions) -> Torus:
    """Return a torus with the fewest curves: what repeats after m periods may repeat after a divisor of m too."""
    near = _AGREES * max(torus.error, options.accuracy)
    for curves in range(1, torus.curves):
        if torus.curves % curves == 0 and error_of(torus.system, curves, curves * ratio, torus.states) <= near:
            return resolved_torus(torus.system, torus.states, curves * ratio, curves, options)
    return torus


def _curve(strobes: NDArray[np.float64], ratio: float, count: int) -> tuple[int, NDArray[np.float64]]:
    """Return the fewest curves on which strobes lie as well as on any more of them, and the first curve."""
    # What has not yet decayed is off all of them alike, and nearly vanishes in the averages.
    spread = np.maximum(strobes.std(axis=0), np.finfo(float).tiny)
    found: list[tuple[float, NDArray[np.float64]]] = []
    for curves in range(1, len(strobes) // _LEAST + 1):
        on_one, turns = strobes[::curves], curves * ratio
        weights = birkhoff_weights(len(on_one))
        curve = of_quasi_periodic(on_one, turns, count, weights)
        away = (on_one - in_steps(curve, TURN * turns, 0, len(on_one))) / spread
        found.append((float(np.sqrt(weights @ (away**2).sum(axis=1))), curve))
    near = _ALIKE * min(away for away, _ in found)
    return next((place, curve) for place, (away, curve) in enumerate(found, 1) if away <= near)

"""The non-dimensional form of a drive train with units, exactly, and back; and the numbers of the paper.

Angles, times and torques are divided by scales of an angle, a frequency and an inertia, as in section 2 of Padmanabhan
and Singh (1995); its relative form of three inertias in line (equations 10 to 18) has the twists q1 and q3.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gapwalk.errors import ModelError
from gapwalk.model.bounds import Positive, check_fields
from gapwalk.model.contact import ContactForm, Stage
from gapwalk.model.drivetrain.train import Train
from gapwalk.model.drivetrain.train_assembly import TorqueForm, TrainAssembly, TrainForm, structure_of
from gapwalk.model.drivetrain.train_parts import Inertia, Shaft, scaled
from gapwalk.model.laws import Expression
from gapwalk.model.loads import Harmonic
from gapwalk.model.system import System
from gapwalk.model.units import QuantityKind, Unit, Units

_DISPLACED = (".deflection", ".clearance")  # what varies by an angle

_CONSISTENT = 1e-9  # relative error of numbers of the paper that must fit together


@dataclass(frozen=True, slots=True)
class Scales:
    """The physical values of the number 1 in a non-dimensional drive train."""

    angle: Positive  #: In rad, > 0.
    frequency: Positive  #: In rad/s, > 0: the time 1 is one divided by it.
    inertia: Positive  #: In kg m^2, > 0.

    def __post_init__(self) -> None:
        check_fields(self)
        for name in ("angle", "frequency", "inertia"):
            object.__setattr__(self, name, float(getattr(self, name)))

    @property
    def torque(self) -> float:
        """Scale of torques, in N m."""
        return self.inertia * self.frequency**2 * self.angle

    def of(self, kind: QuantityKind | None) -> float:
        """Return the physical value of the number 1 of a kind, in SI units with rad; 1 for a plain number."""
        if kind is None or kind is QuantityKind.PHASE:
            return 1.0
        return self.angle**kind.angle * self.frequency**-kind.time * self.torque**kind.torque

    @property
    def words(self) -> str:
        """Write the scales in one line."""
        return (
            f"1 means an angle of {math.degrees(self.angle):.6g} deg, a frequency of {self.frequency:.6g} rad/s, "
            f"an inertia of {self.inertia:.6g} kg m^2, a torque of {self.torque:.6g} N m"
        )


@dataclass(frozen=True)
class NonDimensional:
    """A drive train without units, with the physical one that it represents."""

    physical: System  #: The system with units.
    system: System  #: The same without; its parameters have the same names, but ``frequency`` for a ``speed``.
    scales: Scales  #: Physical values of its numbers.

    def name(self, parameter: str) -> str:
        """Return the name in the non-dimensional system of a parameter of the physical one."""
        return "frequency" if parameter == self.physical.structure.pace else parameter

    def value(self, parameter: str, value: float) -> float:
        """Return the non-dimensional value of a parameter (by its physical name) from a value in its unit."""
        return value * self._factor(parameter)

    def physical_value(self, parameter: str, value: float) -> float:
        """Return the value in its unit of a parameter (by its physical name) from the non-dimensional one."""
        return value / self._factor(parameter)

    def state(self, state: ArrayLike) -> NDArray[np.float64]:
        """Make a non-dimensional state from a physical one (angles, angles per second, extensions as angles)."""
        return np.asarray(state, dtype=float) * self._states

    def physical_state(self, state: ArrayLike) -> NDArray[np.float64]:
        """Make a physical state from a non-dimensional one, shape (..., state_size)."""
        return np.asarray(state, dtype=float) / self._states

    def _factor(self, parameter: str) -> float:
        return _factor(_train_of(self.physical)[0], parameter, self.scales)

    @cached_property
    def _states(self) -> NDArray[np.float64]:
        angle = _train_of(self.physical)[0].angle / self.scales.angle
        return self.physical.state_scales(angle, 1.0 / self.scales.frequency)


def nondimensional(system: System, scales: Scales | None = None) -> NonDimensional:
    """Make the non-dimensional form of a drive train with units.

    Parameters
    ----------
    system
        The system of a train with units.
    scales
        Units of the non-dimensional form; by default `scales_of` the system.

    Returns
    -------
    NonDimensional
        The system without units, and the factors for the conversion.

    Raises
    ------
    ModelError
        If the system is no drive train, or has no units.

    Examples
    --------
    >>> plain = gw.train.nondimensional(driveline)
    >>> round(plain.value("mesh.clearance", 0.1), 6)  # 0.1 deg in the scale of angles
    1.0
    """
    units, assembly = _train_of(system)
    scales = scales_of(system) if scales is None else scales
    factors = np.array([_factor(units, name, scales) for name in system.structure.names])
    structure = structure_of(TrainAssembly(_form(assembly.form, units, scales)))
    return NonDimensional(system, System.from_values(structure, system.values * factors), scales)


def _form(form: TrainForm, units: Units, scales: Scales) -> TrainForm:
    """Return the form with formulas and constant frequencies for the scales; parameters of formulas stay in SI."""
    angle = scales.angle / units.angle

    def contact(old: ContactForm) -> ContactForm:
        if not isinstance(old.law, Expression):
            return old
        text = scaled(old.law.text, angle, angle * scales.frequency, scales.torque)
        return replace(old, law=Expression(text, old.law.variables))

    def torque(old: TorqueForm) -> TorqueForm:
        load = old.harmonic
        size = angle if old.displaces or any(name.endswith(_DISPLACED) for name, _ in load.varies) else 1.0
        given = load.kind.rescaled(dict(load.constants), scales.frequency, scales.torque if old.acts_on else size)
        return replace(old, harmonic=replace(load, constants=tuple(given.items())))

    return replace(
        form,
        pace=form.pace / angle,
        over_speed=tuple((name, factor.scaled(scales.frequency)) for name, factor in form.over_speed),
        links=tuple(replace(link, parts=tuple(map(contact, link.parts))) for link in form.links),
        torques=tuple(map(torque, form.torques)),
    )


def scales_of(system: System) -> Scales:
    """Choose scales at which the numbers of a train are about 1, as in the paper, where K11 and n1 add up to 1.

    They are those of the first link with a clearance; without any the first coordinate counts, and 1 deg.
    """
    units, assembly = _train_of(system)
    form, equations = assembly.form, system.equations
    elastic = next((number for number in form.springs if not form.links[number].slides), form.springs[0])
    touching = [(number, contact) for number, contact in form.contacts if number in form.springs and contact.stages]
    number, contact = touching[0] if touching else (elastic, None)
    place = form.springs.index(number)
    stiffness, clearance = assembly.numbers(system.values).stiffness[number], 0.0
    if contact is not None:
        stages = [contact.stage_prefix(stage) for stage in contact.stages]
        if contact.law.has_stage_parameter("stiffness"):
            stiffness += abs(equations[f"{stages[0]}.stiffness"])
        gaps = (equations[f"{stage}.clearance"] for stage in stages)
        clearance = next((gap for gap in gaps if gap > 0.0), 0.0)
    alone = 1.0 / np.linalg.inv(system.matrix("mass"))[place, place]
    inertia = alone / units.angle  # from the unit of angles to rad
    angle = clearance * units.angle or math.radians(1.0)
    return Scales(float(angle), float(np.sqrt(stiffness / alone)) or 1.0, float(inertia))


def _train_of(system: System) -> tuple[Units, TrainAssembly]:
    assembly = system.structure.assembly
    if system.units is None or not isinstance(assembly, TrainAssembly):
        raise ModelError("the system has no units; only a drive train with units has another, non-dimensional form")
    return system.units, assembly


def _factor(units: Units, parameter: str, scales: Scales) -> float:
    kind = units.kind(parameter)
    if kind is None:
        return units.unit(parameter).factor
    unit = units.frequency if kind is QuantityKind.FREQUENCY else units.unit(parameter).factor
    return unit / scales.of(kind)


@dataclass(frozen=True, kw_only=True)
class PaperNumbers:
    """The non-dimensional numbers of the paper's equations 10 to 18, called as there.

    `n1` and `n2` are the second stage alone (the reading "reduced"); `b` is its clearance, `beta` its impact damping.
    """

    #: K11, K12, K21, K22: Stiffness.
    K11: float
    K12: float
    K21: float
    K22: float
    #: C11, C12, C21, C22: Damping.
    C11: float
    C12: float
    C21: float
    C22: float
    #: n1, n2: Slopes of the second stage.
    n1: float
    n2: float
    #: Tm1, Tm2: Mean torques.
    Tm1: float
    Tm2: float
    Te1: float  #: Amplitude of the excitation.
    #: Te2, p, phi: Amplitude, order, and phase in radians of the second excitation.
    Te2: float = 0.0
    p: int = 2
    phi: float = 0.0
    b: float = 1.0  #: Clearance of the second stage.
    beta: float = 0.0  #: Impact damping.
    W: float = 1.0  #: Frequency.

    def length_ratio(self) -> float:
        """Return bc3 / bc1, which follows from the numbers."""
        load = self.Tm1 / self.Tm2
        return (self.n1 / self.n2 + load) / (1.0 + load * self.K22 / self.K12)

    def train(self, scales: Scales) -> Train:
        """Make the physical train of these numbers, in kg m^2, N m, rad and rad/s."""
        if problems := [*self._problems()]:
            raise ModelError("\n".join(problems))
        r, hub, w, angle = self.length_ratio(), scales.inertia, scales.frequency, scales.angle
        flywheel, rest = hub / (self.n1 / self.n2 / r - 1.0), hub / (r * self.K22 / self.K12 - 1.0)
        stiffness, damping = r * hub * w**2, r * hub * w
        torque = flywheel * angle * w**2
        terms = [Harmonic(self.Te1 * torque, {"flywheel": 1.0})]
        if self.Te2:
            terms.append(Harmonic(self.Te2 * torque, {"flywheel": 1.0}, self.p, self.phi))
        clutch = Shaft(
            "clutch",
            ("flywheel", "hub"),
            stiffness=self.K21 * stiffness if self.K21 else None,
            damping=self.C21 * damping,
            stages=(Stage(self.b * angle, self.n2 * stiffness),),
            impact_damping=self.beta / (angle * w),
        )
        shaft = Shaft("shaft", ("hub", "rest"), stiffness=self.K12 / r * hub * w**2, damping=self.C12 / r * hub * w)
        return Train(
            [Inertia(name, size) for name, size in zip(_NAMES, (flywheel, hub, rest), strict=True)],
            [clutch, shaft],
            mean={"flywheel": self.Tm1 * torque, "rest": -self.Tm1 * torque},
            harmonics=terms,
            frequency=self.W * w,
            units=_SI,
        )

    def _problems(self) -> Iterator[str]:
        clutch, shaft = self.n1 / self.n2, self.K22 / self.K12
        for first, second, wanted, why in (
            ("K11", "K21", clutch, "n1 / n2"),
            ("C11", "C21", clutch, "n1 / n2"),
            ("K22", "K12", shaft, "K22 / K12"),
            ("C22", "C12", shaft, "K22 / K12"),
        ):
            a, b = getattr(self, first), getattr(self, second)
            if abs(a - wanted * b) > _CONSISTENT * max(abs(a), abs(wanted * b)):
                yield (
                    f"{first} is {a:g} and {second} is {b:g}, but of three inertias {first} / {second} is {why}; "
                    f"write {first} = {wanted * b:.10g}"
                )
        r = self.length_ratio()
        if not 1.0 / shaft < r < clutch:
            yield f"mean loads and stiffnesses give the ratio of lengths bc3/bc1 = {r:g}: an inertia would be negative"


_SI = Units(
    (
        (QuantityKind.ANGLE, Unit("rad", 1.0)),
        (QuantityKind.FREQUENCY, Unit("rad/s", 1.0)),
        (QuantityKind.PHASE, Unit("rad", 1.0)),
    )
)
_NAMES = ("flywheel", "hub", "rest")


def paper_numbers(system: System, scales: Scales | None = None, length_ratio: float = 1.0) -> PaperNumbers:
    """Compute the paper's non-dimensional numbers of a physical train of three inertias in line.

    Parameters
    ----------
    system
        A train of three inertias in line. Its first shaft joins inertias 1 and 2 and has one clearance; its second
        shaft joins inertias 2 and 3 and has none. Torques act on inertia 1; inertia 3 takes their mean.
    scales
        Units of the non-dimensional form; by default `scales_of` the system.
    length_ratio
        The ratio bc3 / bc1 of the paper's widths.

    Returns
    -------
    PaperNumbers
        The numbers.

    Raises
    ------
    ModelError
        If the system is no such train, or has no units.

    Examples
    --------
    >>> numbers = gw.train.paper_numbers(line)
    >>> round(numbers.K11 + numbers.n1, 9), round(numbers.Tm1, 6)
    (1.0, 0.003527)
    """
    plain = nondimensional(system, scales).system
    assembly = plain.structure.assembly
    assert isinstance(assembly, TrainAssembly)
    form, train = assembly.form, assembly.numbers(plain.values)
    first = form.links[0].contact
    ends = [link.ends for link in form.links]
    laws = ("elastic", "hunt-crossley")
    if ends != [(0, 1), (1, 2)] or not first or len(first.stages) > 1 or form.links[1].parts or form.links[0].beside:
        raise ModelError(
            "paper_numbers needs three inertias in line, the first shaft with one clearance, the second without; "
            "use nondimensional(system) for other trains"
        )
    sizes = [form.numbers(torque.harmonic.parameters, train.values) for torque in form.torques]
    mean, *shapes = train.torques
    torques = [shape * size[0] for shape, size in zip(shapes, sizes, strict=True)]
    loads, phases = [mean, *torques], [size[1] for size in sizes]
    orders = [torque.harmonic.order for torque in form.torques]
    if orders[:1] not in ([], [1]) or len(orders) > 2 or any(phases[:1]):
        raise ModelError("paper_numbers allows one or two terms of the excitation, the first of order 1 and phase 0")
    if first.law.name not in laws or any(load[1] for load in loads) or any(load[2] for load in torques):
        raise ModelError("paper_numbers allows impact damping, and torques on the first and the last inertia only")
    (i1, i2, i3), r = train.inertia, length_ratio
    (k1, k2), (c1, c2) = train.stiffness, train.damping
    ia, ib = i1 * i2 / (i1 + i2), i2 * i3 / (i2 + i3)
    b, kb, _, *law = form.numbers(first.parameters, train.values)
    numbers: dict[str, Any] = {
        "K11": k1 / ia,
        "K12": k2 / i2 * r,
        "K21": k1 / i2 / r,
        "K22": k2 / ib,
        "C11": c1 / ia,
        "C12": c2 / i2 * r,
        "C21": c1 / i2 / r,
        "C22": c2 / ib,
        "n1": kb / ia,
        "n2": kb / i2 / r,
        "Tm1": loads[0][0] / i1,
        "Tm2": -loads[0][2] / i3 / r,
        "Te1": torques[0][0] / i1 if torques else 0.0,
        "b": b,
        "beta": law[0] if law else 0.0,
        "W": plain.frequency,
    }
    if torques[1:]:
        numbers |= {"Te2": torques[1][0] / i1, "phi": phases[1]}
    orders = {"p": orders[1]} if orders[1:] else {}
    return PaperNumbers(**{name: float(value) for name, value in numbers.items()}, **orders)

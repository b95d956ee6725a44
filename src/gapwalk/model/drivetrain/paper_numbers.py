"""Three inertias in line as Padmanabhan and Singh (1995) write them: their non-dimensional numbers, and back.

Flywheel, clutch hub and the rest of the drive train, with a clutch of two stages and a shaft (equations 1 to 3); the
relative form has the twists of clutch and shaft, q1 and q3, in units of bc1 and bc3 (equations 10 to 18).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from gapwalk.errors import ModelError
from gapwalk.model.contact import Stage
from gapwalk.model.drivetrain.train import Train
from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.drivetrain.train_parts import Inertia, Shaft
from gapwalk.model.drivetrain.train_scales import Scales, nondimensional
from gapwalk.model.loads import Harmonic
from gapwalk.model.system import System
from gapwalk.model.units import QuantityKind, Unit, Units

_CONSISTENT = 1e-9


@dataclass(frozen=True, kw_only=True)
class PaperNumbers:
    """The non-dimensional numbers of the paper's equations 10 to 18, called as there.

    `n1` and `n2` are the second stage alone (the reading "reduced"); `b` is its clearance, `beta` its impact damping.
    """

    K11: float
    K12: float
    K21: float
    K22: float
    C11: float
    C12: float
    C21: float
    C22: float
    n1: float
    n2: float
    Tm1: float
    Tm2: float
    Te1: float
    Te2: float = 0.0
    p: int = 2
    phi: float = 0.0
    b: float = 1.0
    beta: float = 0.0
    W: float = 1.0

    def length_ratio(self) -> float:
        """bc3 / bc1, which follows from the numbers."""
        load = self.Tm1 / self.Tm2
        return (self.n1 / self.n2 + load) / (1.0 + load * self.K22 / self.K12)

    def train(self, scales: Scales) -> Train:
        """The physical train of these numbers, in kg m^2, N m, rad and rad/s.

        Parameters
        ----------
        scales
            The angle bc1, the frequency w, and the inertia I2 of the hub.

        Raises
        ------
        ModelError
            If no three inertias have these numbers; it says which numbers do not fit together.
        """
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
            yield f"the mean loads and stiffnesses ask for bc3/bc1 = {r:g}, with which an inertia would be negative"


_SI = Units(
    (
        (QuantityKind.ANGLE, Unit("rad", 1.0)),
        (QuantityKind.FREQUENCY, Unit("rad/s", 1.0)),
        (QuantityKind.PHASE, Unit("rad", 1.0)),
    )
)
_NAMES = ("flywheel", "hub", "rest")


def paper_numbers(system: System, scales: Scales | None = None, length_ratio: float = 1.0) -> PaperNumbers:
    """The paper's non-dimensional numbers of a physical train of three inertias in line.

    Parameters
    ----------
    system
        Its first shaft joins the first two inertias and has one clearance, its second one the last two and has none;
        torques act on the first inertia, and the mean one is taken by the last.
    scales
        Physical values of the numbers; by default `gapwalk.model.drivetrain.train_scales.scales_of` the system.
    length_ratio
        bc3 / bc1.

    Raises
    ------
    ModelError
        If the system is no such train, or has no units.
    """
    plain = nondimensional(system, scales).system
    assembly = plain.structure.assembly
    assert isinstance(assembly, TrainAssembly)
    form, values = assembly.form, assembly.consistent(plain.values)
    first = form.links[0].contact
    ends = [link.ends for link in form.links]
    laws = ("elastic", "hunt-crossley")
    if ends != [(0, 1), (1, 2)] or not first or form.links[1].contact or len(first.stages) > 1:
        raise ModelError(
            "the paper has three inertias in line, the first shaft with one clearance and the second with none; "
            "use nondimensional(system) for other trains"
        )
    torques = [form.shape(values, torque) * form.parameters(values, torque)[0] for torque in form.torques]
    loads = [assembly.mean(plain.values), *torques]
    phases = [form.parameters(values, torque)[1] for torque in form.torques]
    orders = [torque.harmonic.order for torque in form.torques]
    if orders[:1] not in ([], [1]) or len(orders) > 2 or any(phases[:1]):
        raise ModelError("the paper has one or two terms of the excitation, the first of order 1 and phase 0")
    if first.law.name not in laws or any(load[1] for load in loads) or any(load[2] for load in torques):
        raise ModelError("the paper has impact damping, and torques on the first and the last inertia only")
    (i1, i2, i3), r = form.inertia(values), length_ratio
    (k1, k2), (c1, c2) = form.stiffnesses(values), form.dampings(values)
    ia, ib = i1 * i2 / (i1 + i2), i2 * i3 / (i2 + i3)
    b, kb, _, *law = form.springs_and_law(values, first)
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

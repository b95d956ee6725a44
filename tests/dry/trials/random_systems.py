"""Random systems of 1 to 4 degrees of freedom with friction, springs with gaps and rigid stops."""

from __future__ import annotations

import numpy as np

from gapwalk import Harmonic, System
from gapwalk.model.contact import Contact, Side, Stage, friction
from gapwalk.model.laws import Hysteretic, Rigid

LENGTHS = (1.0, 1.0, 1.0, 1e-6, 1e3)
"""Size of the motions, and of the loads, since the stiffness is near 1."""

_NAMES = "abcd"
_PARTS = ("coulomb", "coulomb", "jenkins", "jenkins", "rigid", "rigid", "stages", "normal", "gap")


class _Draw:
    """Draws the parts of one system; what sticks rigidly has deflections that are linearly independent."""

    def __init__(self, seed: int) -> None:
        self.numbers = np.random.default_rng([seed, 18])
        self.names = list(_NAMES[: int(self.numbers.integers(1, 5))])
        self.symmetric = bool(self.numbers.random() < 0.25)
        self.length = float(self.numbers.choice(LENGTHS))
        self._rigid: list[list[float]] = []

    def uniform(self, low: float, high: float) -> float:
        return float(self.numbers.uniform(low, high))

    def one_of(self, *values: float) -> float:
        return float(self.numbers.choice(values))

    def side(self) -> Side:
        return Side.BOTH if self.symmetric else Side(str(self.numbers.choice(["both", "positive", "negative"])))

    def deflection(self) -> dict[str, float]:
        if len(self.names) > 1 and self.numbers.random() < 0.5:
            first, second = self.numbers.choice(len(self.names), 2, replace=False)
            return {self.names[first]: 1.0, self.names[second]: -1.0}
        return {self.names[int(self.numbers.integers(len(self.names)))]: 1.0}

    def independent(self) -> dict[str, float] | None:
        """Return a deflection that no other rigid constraint fixes, if there is one left."""
        for _ in range(20):
            drawn = self.deflection()
            rows = [*self._rigid, [drawn.get(name, 0.0) for name in self.names]]
            if np.linalg.matrix_rank(rows) == len(rows):
                self._rigid = rows
                return drawn
        return None

    def speed(self, most: float) -> float:
        return 0.0 if self.symmetric else self.length * most * self.one_of(0.0, 0.0, 1.0)

    def coulomb(self, name: str) -> list[Contact]:
        on = self.independent()
        limit, static = self.length * self.uniform(0.03, 0.5), self.one_of(1.0, 1.0, 1.3)
        return [] if on is None else [friction(name, on, limit, static=static, speed=self.speed(0.3))]

    def jenkins(self, name: str) -> list[Contact]:
        limit = self.length * self.uniform(0.03, 0.5)
        return [friction(name, self.deflection(), limit, stiffness=self.uniform(0.3, 5.0), speed=self.speed(0.2))]

    def rigid(self, name: str) -> list[Contact]:
        on, clearance = self.independent(), self.length * self.uniform(0.1, 1.2)
        restitution = self.one_of(0.0, 0.3, 0.6, 0.8, 0.95, 1.0)
        stage = Stage(clearance, side=self.side())
        return [] if on is None else [Contact(name, on, [stage], law=Rigid(), restitution=restitution)]

    def stages(self, name: str) -> list[Contact]:
        law = str(self.numbers.choice(["elastic", "hunt-crossley", "viscous"]))
        more = {"hunt-crossley": {"impact_damping": 0.1 / self.length}, "viscous": {"viscous_damping": 0.1}}
        inner, outer = (self.length * self.uniform(*each) for each in ((0.1, 0.3), (0.4, 0.9)))
        hysteresis = [self.length * self.uniform(0.02, 0.2) for _ in range(2)]
        on, limit = self.deflection(), self.length * self.one_of(0.0, 0.05)
        steps = [
            Stage(inner, self.uniform(0.5, 3.0), name="one", numbers={"hysteresis": hysteresis[0]}),
            Stage(outer, self.uniform(0.5, 6.0), name="two", numbers={"hysteresis": hysteresis[1]}),
        ]
        springs = Contact(name, on, steps, law=Hysteretic(law), numbers=more.get(law, {}))
        rigid = self.independent() if self.numbers.random() < 0.5 else None
        where, stiffness = (on, self.uniform(1.0, 8.0)) if rigid is None else (rigid, None)
        return [springs, friction(f"{name}dry", where, limit, stages_of=name, stiffness=stiffness)]

    def normal(self, name: str) -> list[Contact]:
        clearance, stiffness = self.length * self.one_of(0.0, 0.1, 0.4), self.uniform(0.5, 4.0)
        press = Contact(name, self.deflection(), [Stage(clearance, stiffness, side=self.side())])
        rigid = self.independent() if self.numbers.random() < 0.5 else None
        where, spring = (self.deflection(), self.uniform(0.5, 4.0)) if rigid is None else (rigid, None)
        mu = self.uniform(0.05, 0.4)
        return [press, friction(f"{name}dry", where, coefficient=mu, normal=name, stiffness=spring)]

    def gap(self, name: str) -> list[Contact]:
        clearance, stiffness = self.length * self.uniform(0.1, 1.0), 10.0 ** self.uniform(-0.3, 1.5)
        damping = {"impact_damping": self.uniform(0.02, 0.2) / self.length}
        stop = Stage(clearance, stiffness, side=self.side())
        return [Contact(name, self.deflection(), [stop], law="hunt-crossley", numbers=damping)]


def random_system(seed: int) -> System:
    """Make a system of a few such parts, under one load or two."""
    draw = _Draw(seed)
    n, names = len(draw.names), draw.names
    root = draw.numbers.normal(size=(n, n))
    stiffness = root @ root.T / n + 0.5 * np.eye(n)
    contacts: list[Contact] = []
    for number, part in enumerate(draw.numbers.choice(_PARTS, int(draw.numbers.integers(1, 4)), replace=False)):
        contacts += getattr(draw, str(part))(f"{part}{number}")
    loads = [
        Harmonic(draw.length * draw.uniform(0.3, 2.0), {each: draw.uniform(-1.0, 1.0) for each in names}),
        Harmonic(draw.length * 0.4, {names[-1]: 1.0}, 3 if draw.symmetric else 2, draw.uniform(0.0, 6.0)),
    ]
    return System(
        names,
        stiffness,
        draw.uniform(0.02, 0.1) * stiffness + 0.02 * np.eye(n),
        np.diag(draw.numbers.uniform(0.5, 2.0, n)),
        contacts,
        {} if draw.symmetric else {names[0]: draw.length * draw.uniform(-0.3, 0.3)},
        loads[: int(draw.one_of(1, 2))],
        frequency=draw.uniform(0.4, 1.8),
    )

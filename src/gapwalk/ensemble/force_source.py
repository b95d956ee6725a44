"""Parts of the source text of a kernel: lines that evaluate contact forces, and the loops around all lines.

The lines for the force of one contact are written from the closed form of its force law. Straight-line code of
thousands of lines in one loop would compile for seconds and spill registers, so it is cut into several loops. The lines
of a step that belong together form an *atom*. Consecutive atoms share a loop over the lanes until it is full. Values
that one loop computes and a later one needs are stored in rows of scratch memory.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from gapwalk.model.coefficients import ContactSlots, StageSlots

_TINY = "1e-300"  # keeps the inverse of a vanishing speed finite
_Polynomial = dict[tuple[tuple[str, ...], int], float]
"""Factors by the parameters of the stage and the power of the penetration."""
LANES = 64
"""Trajectories per block: all of them execute the same instructions (SIMD)."""

# S: states, force history (and survey), one row of lanes after the other.  C: numbers of the scheme.  T: the excitation
# step by step.  If the state of a lane exceeds the limit, the period and its last state are recorded; it becomes NaN.
FRAME = """\
def advance(S, C, T, first, periods, steps, every, record, left, last, limit, stop):
{outside}
    for p in range(first, first + periods):
        if stop[0] != 0:
            return False
        for i in range(steps):
{times}
{loops}
        alive = 0
        for l in range({lanes}):
            if left[l] < 0:
                within = True
                for j in range({size}):
                    within = within and abs(S[j * {lanes} + l]) <= limit
                if within:
                    alive += 1
                    for j in range({size}):
                        last[j, l] = S[j * {lanes} + l]
                else:
                    left[l] = p
                    for j in range({size}):
                        S[j * {lanes} + l] = np.nan
        if every > 0 and (p + 1) % every == 0:
            row = (p + 1) // every - 1
            for j in range({size}):
                for l in range({lanes}):
                    record[row, j, l] = S[j * {lanes} + l]
        if alive == 0:
            return True
    return True
"""
Atom = Sequence[str]

_FULL = 64  # largest number of products in a loop
_NAME = re.compile(r"\b(?:[zufy]\d+|[hjp]\d+_\d+|c\d+)\b")
_TARGET = re.compile(r"^([zufy]\d+|[hj]\d+_\d+) = ")


@dataclass
class Chunk:
    """Atoms that share a loop over the lanes."""

    lines: list[str] = field(default_factory=list)  #: Lines of the atoms.
    #: Names that the lines use and do not define, in order of appearance.
    needs: dict[str, None] = field(default_factory=dict)
    gives: dict[str, None] = field(default_factory=dict)  #: Names that the lines define.
    keeps: list[str] = field(default_factory=list)  #: Defined names that later chunks need.

    def add(self, atom: Atom) -> None:
        """Append an atom."""
        for line in atom:
            target = _TARGET.match(line)
            for name in _NAME.findall(line[target.end() :] if target else line):
                if name not in self.gives:
                    self.needs[name] = None
            if target:
                self.gives[target[1]] = None
        self.lines += atom

    @property
    def numbers(self) -> list[str]:
        """Names of the scheme's numbers that the lines use."""
        return [name for name in self.needs if name.startswith("c")]

    def loads(self, rows: Mapping[str, int]) -> list[str]:
        """Return source lines that read the variables of earlier chunks from their rows of the storage."""
        return [f"{name} = S[{rows[name] * LANES} + l]" for name in self.needs if not name.startswith("c")]

    def stores(self, rows: Mapping[str, int]) -> list[str]:
        """Return the source lines that store variables for later chunks of the code."""
        return [f"S[{rows[name] * LANES} + l] = {name}" for name in self.keeps]


class ForceSource:
    """Writer of the lines for the force of one contact."""

    def __init__(self, slots: ContactSlots, name: Callable[[int], str], active: Callable[[int], bool]) -> None:
        self._slots, self._name, self._active = slots, name, active

    def lines(self, span: str, result: str) -> list[str]:
        """Write the lines for the force at the deflection ``x`` and its rate ``r``.

        A kink of the force between two steps leaves an error of second order in the sum over steps, ``B2(s) / 2`` times
        the jump of the slope (Euler and Maclaurin), where ``s`` is its position in the step. The bump
        ``(1 - a)(1 - 3a) / 12``, ``a`` the distance from the breakpoint in steps, adds up to that over the steps next
        to the kink. A force that jumps is averaged over the step.
        """
        lines = [f"w = abs(r) * {span} + {_TINY}", "inverse = 1.0 / w", "bump = w * (1.0 / 12.0)"]
        sums: dict[_Factor, list[str]] = {}
        for number, piece in enumerate(self._pieces()):
            lines += self._penetration(piece, f"on{number}")
            written: dict[str, str] = {}
            for factor, polynomial in piece.polynomials.items():
                sign = "-" if max(polynomial.values()) < 0.0 else ""
                text = self._text(polynomial, piece.stage, -1.0 if sign else 1.0, f"on{number}")
                if text not in written:  # damping in proportion to the force has the same text
                    written[text] = f"g{number}_{len(written)}"
                    lines.append(f"{written[text]} = {text}")
                name = sign + written[text]
                # the bump may be negative, so the sign of the deflection is a factor
                sums.setdefault(factor, []).append(f"np.copysign(1.0, x) * {name}" if factor in piece.odd else name)
        terms = []
        for factor, each in sums.items():
            numbers = [self._name(self._slots.numbers[name]) for name in factor.numbers]
            terms.append(" * ".join([*numbers, *["r"] * factor.rate, f"({total(each)})"]))
        return [*lines, f"{result} = {total(terms)}"]

    def _pieces(self) -> Iterator[_Piece]:
        stages, polynomials = iter(self._slots.stages), iter(self._polynomials())
        for form in self._slots.form.stages:
            mine = [(next(stages), next(polynomials)) for _ in form.side.signs]
            (stage, first), (_, second) = mine[0], mine[-1]
            mirrored = {
                factor: {term: -value for term, value in polynomial.items()} for factor, polynomial in first.items()
            }
            even = {factor for factor in first if second.get(factor) == first[factor]}
            odd = frozenset(factor for factor in first if second.get(factor) == mirrored[factor])
            if len(mine) == 2 and self._active(stage.clearance) and {*even, *odd} == {*first, *second}:
                yield _Piece(stage, True, first, odd)
            else:
                yield from (_Piece(each, False, those) for each, those in mine)

    def _polynomials(self) -> list[dict[_Factor, _Polynomial]]:
        """Return the force of each stage on each side as polynomials of its penetration."""
        found: list[dict[_Factor, _Polynomial]] = [{} for _ in self._slots.stages]
        for term in self._slots.form.closed_form("the batch integrator"):
            stage = self._slots.stages[term.stage]
            slots = [*(self._slots.numbers[name] for name in term.numbers), *map(stage.numbers.get, term.stage_numbers)]
            if all(slot is not None and self._active(slot) for slot in slots):
                of_factor = found[term.stage].setdefault(_Factor(term.numbers, term.rate), {})
                of_factor[term.stage_numbers, term.power] = term.factor * stage.sign**term.power
        return found

    def _penetration(self, piece: _Piece, on: str) -> list[str]:
        stage = piece.stage
        x = "abs(x)" if piece.folded else "x" if stage.sign > 0 else "-x"
        clearance = f" - {self._name(stage.clearance)}" if self._active(stage.clearance) else ""
        lines = [f"d = {x}{clearance}", "a = min(abs(d) * inverse, 1.0)", "deep = max(d, 0.0)"]
        if any(power == 0 for polynomial in piece.polynomials.values() for _, power in polynomial):
            lines.append(f"{on} = min(max(d * inverse + 0.5, 0.0), 1.0)")
        return lines

    def _text(self, polynomial: _Polynomial, stage: StageSlots, sign: float, on: str) -> str:
        powers = {0: on, 1: "(deep + bump * ((1.0 - a) * (1.0 - 3.0 * a)))"}
        terms = []
        for (names, power), factor in polynomial.items():
            number = [] if factor * sign == 1.0 else [repr(factor * sign)]
            depth = powers.get(power) or f"({' * '.join(['deep'] * power)})"
            terms.append(" * ".join([*number, *(self._name(stage.numbers[name]) for name in names), depth]))
        return total(terms)


class _Factor(NamedTuple):
    """Factor of a polynomial of the penetration: parameters of the contact, and a power of the rate."""

    numbers: tuple[str, ...]
    rate: int


def total(terms: Sequence[str]) -> str:
    """Write a sum."""
    text = " + ".join(term for term in terms if term != "0.0")
    return text.replace("+ -", "- ") or "0.0"


@dataclass(frozen=True)
class _Piece:
    """A stage on one side; or on both sides, folded into one, where its force is even or odd."""

    stage: StageSlots  #: Positions of its coefficients.
    folded: bool  #: True if it represents both sides.
    polynomials: dict[_Factor, _Polynomial]  #: Polynomials of the penetration, by their factors.
    odd: frozenset[_Factor] = frozenset()  #: Factors of a folded stage that change sign with the deflection.


def chunks_of(atoms: Sequence[Atom]) -> list[Chunk]:
    """Group consecutive atoms in chunks of limited size."""
    chunks, size = [Chunk()], 0
    for atom in atoms:
        cost = sum(line.count("*") for line in atom)
        if chunks[-1].lines and size + cost > _FULL:
            chunks.append(Chunk())
            size = 0
        chunks[-1].add(atom)
        size += cost
    later: set[str] = set()
    for chunk in reversed(chunks):
        chunk.keeps = [name for name in chunk.gives if name in later]
        later |= set(chunk.needs)
    return chunks

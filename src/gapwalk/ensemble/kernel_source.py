"""Source text of a kernel for one structure: straight-line code over lanes that a compiler vectorises (SIMD).

The text depends on the form of the kernel alone (`Form`). Coefficients that are always zero are omitted, loops over
coordinates, contacts and stages are unrolled, and there are no branches. Values that differ from lane to lane are
arrays; values that all lanes share are scalars.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gapwalk.ensemble.force_source import FRAME, LANES, Chunk, ForceSource, chunks_of, total
from gapwalk.ensemble.scheme import HISTORY, Linear, Scheme
from gapwalk.model.coefficients import layout_of
from gapwalk.model.structure import Structure


@dataclass(frozen=True)
class Form:
    """The data on which the source text of a kernel depends.

    Parameters
    ----------
    structure
        Structure of the system.
    pattern
        Coefficients of the flow that may differ from zero: bytes of an array of bool.
    modal
        True if the lanes hold modal coordinates, in pairs.
    shared
        True if all lanes have the same coefficients.
    survey
        True if extremes, contacts and largest forces are recorded.
    """

    structure: Structure
    pattern: bytes
    modal: bool
    shared: bool
    survey: bool


class Source:
    """The source text of one kernel, and the contents of its arrays."""

    def __init__(self, form: Form) -> None:
        self.form, self.layout = form, layout_of(form.structure)
        self.n, self.contacts = form.structure.size, len(form.structure.contacts)
        self._slots: dict[tuple[str, tuple[int, ...]], int] = {}
        self._patterns = patterns_of(form)

    @cached_property
    def text(self) -> str:
        """The text of the kernel, a function `advance`."""
        times = [f"t{column} = T[i * {self.columns} + {column}]" for column in range(self.columns)]
        loops, outside = [], []
        for chunk in self._chunks:
            fetch = [f"{name} = C[{name[1:]}]" for name in chunk.numbers]
            inside = []
            if not self.form.shared:
                fetch, inside = [], [f"{name} = C[{int(name[1:]) * LANES} + l]" for name in chunk.numbers]
            elif len(self._chunks) == 1:
                fetch, outside = [], fetch
            lines = [*inside, *chunk.loads(self._rows), *chunk.lines, *chunk.stores(self._rows)]
            loops += [*fetch, f"for l in range({LANES}):", *_indented(lines, 1).splitlines()]
        return FRAME.format(
            lanes=LANES,
            size=2 * self.n,
            outside=_indented(outside, 1),
            times=_indented(times, 3),
            loops=_indented(loops, 3),
        )

    @cached_property
    def _chunks(self) -> list[Chunk]:
        return chunks_of(list(self._atoms()))

    @cached_property
    def _rows(self) -> dict[str, int]:
        """Row of each name that outlives a loop: states, force history, then (after the survey) stored values."""
        names = [f"z{i}" for i in range(2 * self.n)]
        names += [f"h{j}_{k}" for j in range(HISTORY) for k in range(self.contacts)]
        rows = {name: row for row, name in enumerate(names)}
        for name in (name for chunk in self._chunks for name in chunk.keeps):
            rows[name] = len(rows) + self._tallies
        return rows

    @cached_property
    def columns(self) -> int:
        """Numbers per step in the table of the excitation."""
        if self.form.shared:
            return int(self._patterns["loads"].any(axis=1).sum())
        return 1 + 2 * len(self.layout.orders)

    @cached_property
    def tally_rows(self) -> dict[str, int]:
        """First row of each quantity of a survey, after states and history, and the row after all of them."""
        if not self.form.survey:
            return {}
        first, rows = 2 * self.n + HISTORY * self.contacts, {}
        for kind, count in (
            ("low", self.n), ("high", self.n), ("peak", self.contacts), ("contacts", 2 * self.contacts),
        ):  # fmt: skip
            rows[kind], first = first, first + count
        return {**rows, "end": first}

    @property
    def _tallies(self) -> int:
        return self.form.survey * (2 * self.n + 3 * self.contacts)

    @cached_property
    def height(self) -> int:
        """Number of rows of a block."""
        return len(self._rows) + self._tallies

    def numbers(self, scheme: Scheme, linear: Linear) -> NDArray[np.float64]:
        """Return the numbers for the kernel's array ``C``, shape (numbers, lanes of the scheme)."""
        assert self._chunks  # the slots are assigned while the chunks are written
        parts = {
            "transition": scheme.transition,
            "loads": scheme.loads,
            "weights": scheme.weights,
            "rows": scheme.rows,
            "forecast": scheme.forecast,
            "span": scheme.span,
            "coefficient": linear.coefficients,
            "basis": linear.basis if linear.basis is not None else np.zeros((len(scheme.span), 0, 0)),
        }
        numbers = [parts[kind][(slice(None), *place)] for kind, place in self._slots]
        return np.array(numbers).reshape(len(numbers), len(scheme.span))

    def times(self, scheme: Scheme, steps: int) -> NDArray[np.float64]:
        """Return the table ``T`` of the excitation over one forcing period, shape (steps, columns)."""
        theta = 2.0 * np.pi * np.arange(steps) / steps
        angles = np.multiply.outer(theta, np.array(self.layout.orders, dtype=float))
        basis = np.ones((steps, 1 + 2 * angles.shape[1]))
        basis[:, 1::2], basis[:, 2::2] = np.cos(angles), np.sin(angles)
        if not self.form.shared:
            return basis
        return basis @ scheme.loads[0, self._patterns["loads"].any(axis=1)].T

    def _atoms(self) -> Iterable[list[str]]:
        """Yield the lines of one step of one lane, in groups of dependent lines."""
        size = 2 * self.n
        yield from ([f"u{i} = {self._drift(i)}"] for i in range(size))
        yield from ([*self._forecast(k), *self._force(k)] for k in range(self.contacts))
        kicks = [f"y{i} = {total([f'u{i}', *self._kick(i)])}" for i in range(size)]
        stores = [f"S[{i * LANES} + l] = y{i}" for i in range(size)]
        if self.form.survey:  # it needs both the old and the new states
            yield from ([kick] for kick in kicks)
            yield from self._survey()
            yield stores
        else:
            yield from map(list, zip(kicks, stores, strict=True))
        for k in range(self.contacts):
            first = (size + k) * LANES
            yield [
                f"S[{first + j * self.contacts * LANES} + l] = {f'h{j - 1}_{k}' if j else f'f{k}'}"
                for j in range(HISTORY)
            ]

    def _drift(self, i: int) -> str:
        terms = [f"{self._slot('transition', i, j)} * z{j}" for j in self._present("transition", i)]
        present = self._present("loads", i)
        if self.form.shared and present:
            terms.append(f"t{int(self._patterns['loads'][:i].any(axis=1).sum())}")
        elif present:
            terms += [f"{self._slot('loads', i, b)} * t{b}" for b in present]
        return total(terms)

    def _kick(self, i: int) -> Iterable[str]:
        for k in self._present("weights", i):
            for j in range(1 + HISTORY):
                yield f"{self._slot('weights', j, i, k)} * {'f' if j == 0 else f'h{j - 1}_'}{k}"

    def _row(self, which: int, k: int, symbol: str) -> str:
        present = np.flatnonzero(self._patterns["rows"][which, k]).tolist()
        return total([f"{self._slot('rows', which, k, i)} * {symbol}{i}" for i in present])

    def _forecast(self, k: int) -> list[str]:
        """Write the lines that predict deflection and rate of a contact at the end of the step."""
        lines = []
        for which, name in enumerate(("x", "r")):
            known = [
                f"{self._slot('forecast', j, which, k, m)} * h{j}_{m}"
                for j in range(HISTORY)
                for m in np.flatnonzero(self._patterns["forecast"][which, k]).tolist()
            ]
            lines.append(f"{name} = {total([self._row(which, k, 'u'), *known])}")
        return lines

    def _force(self, k: int) -> list[str]:
        """Write the lines for the contact force at the end of the step."""
        source = ForceSource(self.layout.contacts[k], lambda slot: self._slot("coefficient", slot), self._active)
        return source.lines(self._slot("span"), f"f{k}")

    def _survey(self) -> Iterable[list[str]]:
        """Yield the lines for extremes of the coordinates, largest contact forces, and entries on each side."""
        rows = self.tally_rows

        def keep(row: int, value: str, which: str) -> str:
            return f"S[{row * LANES} + l] = {which}(S[{row * LANES} + l], {value})"

        for i in range(self.n):
            lines = []
            for symbol in "zy":
                lines += [
                    f"q{symbol} = {self._physical(i, symbol)}",
                    f"v{symbol} = {self._physical(self.n + i, symbol)}",
                ]
            # if the velocity changes sign, it is assumed linear over the step
            lines += [
                "turn = vz * vy < 0.0",
                "fall = (vz - vy) if turn else 1.0",
                f"tip = (qz + {self._slot('span')} * vz * vz / (2.0 * fall)) if turn else qy",
                keep(rows["low"] + i, "min(qy, tip)", "min"),
                keep(rows["high"] + i, "max(qy, tip)", "max"),
            ]
            yield lines
        for k, slots in enumerate(self.layout.contacts):
            # vertex of the parabola through three values
            lines = [
                f"middle, before, after = abs(h0_{k}), abs(h1_{k}), abs(f{k})",
                "over = middle > before and middle > after",
                "bend = (2.0 * middle - before - after) if over else 1.0",
                "tip = (middle + (after - before) ** 2 / (8.0 * bend)) if over else after",
                keep(rows["peak"] + k, "max(after, tip)", "max"),
                f"xz = {self._row(0, k, 'z')}",
                f"xy = {self._row(0, k, 'y')}",
            ]
            for stage in (each for each in slots.stages if each.innermost):
                sign = stage.sign
                clearance = self._slot("coefficient", stage.clearance) if self._active(stage.clearance) else "0.0"
                row, dash = rows["contacts"] + 2 * k + (sign < 0), "" if sign > 0 else "-"
                lines.append(
                    f"S[{row * LANES} + l] += 1.0 if ({dash}xz <= {clearance} and {dash}xy > {clearance}) else 0.0"
                )
            yield lines

    def _physical(self, i: int, symbol: str) -> str:
        """Write a component of the state in the user's coordinates."""
        if not self.form.modal:
            return f"{symbol}{i}"
        return total([f"{self._slot('basis', i, j)} * {symbol}{j}" for j in range(2 * self.n)])

    def _slot(self, kind: str, *place: int) -> str:
        return f"c{self._slots.setdefault((kind, place), len(self._slots))}"

    def _present(self, kind: str, i: int) -> Sequence[int]:
        return np.flatnonzero(self._patterns[kind][i]).tolist()

    def _active(self, slot: int) -> bool:
        return bool(np.frombuffer(self.form.pattern, dtype=bool)[slot])


def patterns_of(form: Form) -> dict[str, NDArray[np.bool_]]:
    """Mark the entries of a scheme's arrays that may differ from zero."""
    layout, n = layout_of(form.structure), form.structure.size
    linear = Linear(layout, np.frombuffer(form.pattern, dtype=bool).astype(float)[None])
    push, loads, rows = linear.push[0] != 0, linear.loads[0] != 0, linear.deflections[0] != 0
    loads[:, 1:] |= loads[:, 1:].reshape(2 * n, -1, 2)[:, :, ::-1].reshape(2 * n, -1)  # cosine and sine mix over a step
    reach = np.eye(2 * n, dtype=bool) | (linear.matrix[0] != 0)
    for _ in range(2 * n):
        reach = reach @ reach
    patterns = {"transition": reach, "loads": reach @ loads, "weights": reach @ push, "rows": rows}
    patterns["forecast"] = rows @ patterns["weights"]
    if form.modal:
        patterns["transition"] = np.kron(np.eye(n, dtype=bool), np.ones((2, 2), dtype=bool))
        patterns["loads"] = np.broadcast_to(loads.any(axis=0), loads.shape)
        patterns["weights"] = np.broadcast_to(push.any(axis=0), push.shape)
        patterns["rows"] = np.broadcast_to(rows.any(axis=2, keepdims=True), rows.shape)
    return patterns


def _indented(lines: Iterable[str], depth: int) -> str:
    return "\n".join("    " * depth + line for line in lines)

"""Source text of a kernel for one structure: straight-line code over lanes that a compiler vectorises (SIMD).

The text depends on the form of the kernel alone (`Form`). Coefficients that are always zero are omitted, loops over
coordinates, contacts and stages are unrolled, and there are no branches. Values that differ from lane to lane are
arrays; values that all lanes share are scalars.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache, partial
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.cache_folder import cache_folder, is_private, write_whole
from gapwalk.ensemble.force_source import (
    FRAME,
    LANES,
    Chunk,
    Excitation,
    ForceSource,
    FormulaSource,
    HostTerms,
    JenkinsSource,
    RigidSource,
    Sheet,
    Term,
    chunks_of,
    past_of,
    polynomial,
    refuse,
    total,
)
from gapwalk.late_scipy import linalg
from gapwalk.model.coefficients import CoefficientLayout, layout_of
from gapwalk.model.structure import Structure

# The step of the batch integrator in numbers: exact linear propagation, and weights for the contact forces.
#
# Over one step the linear part (stiffness, damping, mean load, harmonics) is propagated exactly by a matrix
# exponential. The contact forces enter by Duhamel's integral over a polynomial through their values at the end of the
# step and at three earlier times: an exponential Adams-Moulton method (Hochbruck and Ostermann 2010, Acta Numerica 19,
# 209-286), with the polynomial through the three earlier values as its predictor, and one evaluation of each force per
# step.
#
# Method: docs/numerics/notes/ensembles.md

HISTORY = 3
"""Number of earlier values of each contact force that a step uses."""

DEGREE = 4
"""Degree of the polynomial, of the rest of a step, that gives the change of the state by an impulse before that."""

_MODAL_FROM = 3  # degrees of freedom from which the two numbers per mode are fewer than those of a full matrix
_LARGEST_CONDITION = 1e9  # of the modal basis: nine of sixteen digits may be lost; the others exceed the accuracy


_NODES = 0.5 - 0.5 * np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)  # of Chebyshev, in steps


def rigid_stops(layout: CoefficientLayout) -> list[int]:
    """Return the numbers of the contacts that are rigid stops."""
    return [k for k, slots in enumerate(layout.contacts) if slots.form.law.rebounds]


def deflections_of(layout: CoefficientLayout) -> list[tuple[int, int]]:
    """Return the contact, and the argument of its law, of every deflection."""
    return [(k, place) for k, slots in enumerate(layout.contacts) for place, _ in enumerate(slots.deflections)]


@dataclass(frozen=True, eq=False)
class Linear:
    """The linear part of one or many systems of equal structure, in matrices over time (not theta)."""

    layout: CoefficientLayout  #: Positions of the coefficients in an array.
    coefficients: NDArray[np.float64]  #: shape (lanes, number of coefficients): Coefficients of each system.

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return self.layout.structure.size

    @property
    def rate(self) -> NDArray[np.float64]:
        """Time per angle theta, ``1/W``, shape (lanes,)."""
        return self.coefficients[:, 0]

    @cached_property
    def table(self) -> NDArray[np.float64]:
        """The coefficients ``[A | B | D_1 ... | m | a_1 ... | b_1 ...]``, shape (lanes, n, columns)."""
        return self.coefficients[:, self.layout.accelerations]

    @cached_property
    def matrix(self) -> NDArray[np.float64]:
        """``L`` of ``z' = L z`` without contacts and loads, shape (lanes, 2n, 2n)."""
        n = self.n
        matrix = np.zeros((len(self.coefficients), 2 * n, 2 * n))
        matrix[:, :n, n:] = np.eye(n)
        matrix[:, n:, :] = -self.table[:, :, : 2 * n]
        return matrix

    @cached_property
    def push(self) -> NDArray[np.float64]:
        """Acceleration of the state by a unit of each contact force, shape (lanes, 2n, contacts)."""
        n, count = self.n, len(self.layout.contacts)
        push = np.zeros((len(self.coefficients), 2 * n, count))
        push[:, n:] = -self.table[:, :, 2 * n : 2 * n + count]
        return push

    @cached_property
    def loads(self) -> NDArray[np.float64]:
        """Acceleration of the state by ``1, cos h theta, sin h theta, ...``, shape (lanes, 2n, 1 + 2 orders)."""
        n, first, count = self.n, 2 * self.n + len(self.layout.contacts), len(self.layout.orders)
        loads = np.zeros((len(self.coefficients), 2 * n, 1 + 2 * count))
        loads[:, n:, 0] = self.table[:, :, first]
        loads[:, n:, 1::2] = self.table[:, :, first + 1 : first + 1 + count]
        loads[:, n:, 2::2] = self.table[:, :, first + 1 + count :]
        return loads

    @cached_property
    def deflections(self) -> NDArray[np.float64]:
        """Rows that map a state to each deflection, then to its rate, shape (lanes, 2, deflections, 2n)."""
        n, places = self.n, deflections_of(self.layout)
        rows = np.zeros((len(self.coefficients), 2, len(places), 2 * n))
        for index, (contact, argument) in enumerate(places):
            vector = self.layout.contacts[contact].deflections[argument]
            rows[:, 0, index, :n] = rows[:, 1, index, n:] = self.coefficients[:, vector]
        return rows

    @cached_property
    def impulses(self) -> NDArray[np.float64]:
        """Change of the state by impacts that change the rate of each rigid stop by 1, shape (lanes, 2n, stops)."""
        places, stops = [contact for contact, _ in deflections_of(self.layout)], rigid_stops(self.layout)
        found = -self.push[:, :, stops]
        rows = self.deflections[:, 1, [places.index(stop) for stop in stops]]
        rates = np.einsum("lkz,lzk->lk", rows, found)
        return found / rates[:, None]

    @cached_property
    def basis(self) -> NDArray[np.float64] | None:
        """Real modal basis, shape (lanes, 2n, 2n), in pairs of adjacent columns; None if it does not save work."""
        if self.n < _MODAL_FROM:
            return None
        values: NDArray[np.complex128]
        vectors: NDArray[np.complex128]
        values, vectors = (part.astype(complex) for part in np.linalg.eig(self.matrix))
        order = np.argsort(values.imag != 0, axis=1, kind="stable")  # real ones first: complex pairs stay adjacent
        values = np.take_along_axis(values, order, axis=1)
        vectors = np.take_along_axis(vectors, order[:, None, :], axis=2)
        columns = np.where(values.imag[:, None, :] < 0, vectors.imag, vectors.real)
        columns = columns / np.maximum(np.linalg.norm(columns, axis=1, keepdims=True), np.finfo(float).tiny)
        good = np.all(np.isfinite(columns)) and np.linalg.cond(columns).max() <= _LARGEST_CONDITION
        return columns if good else None

    def some(self, lanes: NDArray[np.intp]) -> Linear:
        """Select some of the systems, in the same basis."""
        part = Linear(self.layout, self.coefficients[lanes])
        part.__dict__["basis"] = None if self.basis is None else self.basis[lanes]
        return part


@dataclass(frozen=True, eq=False)
class Scheme:
    """The matrices of one step of a given length, for each lane."""

    transition: NDArray[np.float64]  #: shape (lanes, 2n, 2n): Propagates the state over the step.
    #: shape (lanes, 2n, 1 + 2 orders): Contribution of ``1, cos h theta, sin h theta, ...`` at the start of the step.
    loads: NDArray[np.float64]
    #: shape (lanes, 1 + HISTORY, 2n, contacts): Contribution of the contact forces: at the end of the step, at its
    #: start, and at earlier steps.
    weights: NDArray[np.float64]
    rows: NDArray[np.float64]  #: shape (lanes, 2, deflections, 2n): Maps the state to deflections and their rates.
    #: shape (lanes, HISTORY, 2, deflections, contacts): Contribution of earlier contact forces to the deflections and
    #: rates at the end of the step.
    forecast: NDArray[np.float64]
    span: NDArray[np.float64]  #: shape (lanes,): Length of the step, in time.
    #: shape (lanes, degree + 1, 2n, stops): Contribution of an impact that changes the rate of a rigid stop by 1: a
    #: polynomial of the rest of the step.
    impulse: NDArray[np.float64]
    #: shape (lanes, degree + 1, 2, stops): That polynomial for the deflection of the stop itself, and for its rate.
    echo: NDArray[np.float64]
    #: shape (lanes, 2, 2n, stops): Contribution of the reaction, linear over the step, that changes the deflection at
    #: its end by 1 and not the rate; and of the one that changes the rate by 1 and not the deflection.
    hold: NDArray[np.float64]

    def some(self, lanes: NDArray[np.intp]) -> Scheme:
        """Select some of the lanes."""
        return Scheme(*(getattr(self, field.name)[lanes] for field in fields(self)))


def scheme_of(linear: Linear, steps: int) -> Scheme:
    """Compute the scheme of `steps` steps per forcing period, in the basis of `linear`."""
    span = linear.rate * (2.0 * math.pi / steps)
    n2, n_loads, n_contacts = 2 * linear.n, linear.loads.shape[2], linear.push.shape[2]
    carried = linalg.expm(_augmented(linear, span))
    moments = [
        carried[:, :n2, n2 + n_loads + n_contacts * j : n2 + n_loads + n_contacts * (j + 1)] * math.factorial(j)
        for j in range(1 + HISTORY)
    ]
    transition, loads = carried[:, :n2, :n2], carried[:, :n2, n2 : n2 + n_loads]
    weights: NDArray[Any] = _interpolating(moments, np.arange(1.0, -HISTORY, -1.0))
    before = _interpolating(moments[:HISTORY], np.arange(0.0, -HISTORY, -1.0))
    rows = linear.deflections
    forecast = np.einsum("lakz,ljzm->ljakm", rows, before)
    impulse: NDArray[Any]
    hold: NDArray[Any]
    impulse, echo, hold = _of_stops(linear, span)
    if linear.basis is not None:
        impulse, hold = (np.linalg.solve(linear.basis[:, None], each) for each in (impulse, hold))
        transition = np.linalg.solve(linear.basis, transition @ linear.basis)
        loads = np.linalg.solve(linear.basis, loads)
        weights = np.linalg.solve(linear.basis[:, None], weights)
        rows = rows @ linear.basis[:, None]
    return Scheme(transition, loads, weights, rows, forecast, span, impulse, echo, hold)


def _of_stops(linear: Linear, span: NDArray[np.float64]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Compute the contributions of impulses and reactions of rigid stops: `Scheme.impulse`, `echo` and `hold`."""
    stops = rigid_stops(linear.layout)
    if not stops:
        lanes, n2 = len(span), 2 * linear.n
        return np.zeros((lanes, DEGREE + 1, n2, 0)), np.zeros((lanes, DEGREE + 1, 2, 0)), np.zeros((lanes, 2, n2, 0))
    carried = (
        linalg.expm(linear.matrix[:, None] * (span[:, None] * _NODES)[:, :, None, None]) @ linear.impulses[:, None]
    )
    impulse = np.einsum("pj,ljzk->lpzk", np.linalg.inv(np.vander(_NODES, increasing=True)), carried)
    places = [contact for contact, _ in deflections_of(linear.layout)]
    rows = linear.deflections[:, :, [places.index(stop) for stop in stops]]
    powers = np.arange(DEGREE + 1)
    reactions = np.stack(  # constant over the step, and growing with the rest of it
        [np.einsum("p,lpzk->lzk", 1.0 / (powers + more), impulse) for more in (1.0, 2.0)], axis=1
    )
    effect = np.einsum("lakz,lrzk->lkar", rows, reactions)
    hold = np.einsum("lrzk,lkra->lazk", reactions, np.linalg.inv(effect))
    return impulse, np.einsum("lakz,lpzk->lpak", rows, impulse), hold


def _augmented(linear: Linear, span: NDArray[np.float64]) -> NDArray[np.float64]:
    """Build the matrix of the linear part over one step, augmented by the loads and by polynomial contact forces."""
    lanes, n2, n_contacts = len(span), 2 * linear.n, linear.push.shape[2]
    first = n2 + linear.loads.shape[2]
    matrix = np.zeros((lanes, first + n_contacts * (1 + HISTORY), first + n_contacts * (1 + HISTORY)))
    over = span[:, None, None]
    matrix[:, :n2, :n2] = linear.matrix * over
    matrix[:, :n2, n2:first] = linear.loads * over
    matrix[:, :n2, first : first + n_contacts] = linear.push * over
    angle = span / linear.rate
    for index, order in enumerate(linear.layout.orders):
        cosine, sine = n2 + 1 + 2 * index, n2 + 2 + 2 * index
        matrix[:, cosine, sine], matrix[:, sine, cosine] = -order * angle, order * angle
    for index in range(n_contacts * HISTORY):
        matrix[:, first + index, first + n_contacts + index] = 1.0
    return matrix


def _interpolating(moments: list[NDArray[np.float64]], nodes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute weights of values at nodes (in steps) from integrals of powers, shape (lanes, nodes, 2n, contacts)."""
    powers = np.linalg.inv(np.vander(nodes, increasing=True))
    return np.einsum("jlzk,ji->lizk", np.array(moments), powers)


_SWEEPS = 2  # over the reactions of several stops
_DRIVING = re.compile(r"\bt\d+\b")


@dataclass(frozen=True)
class Form:
    """The data on which the source text of a kernel depends."""

    structure: Structure  #: Structure of the system.
    pattern: bytes  #: Coefficients of the flow that may differ from zero: bytes of an array of bool.
    modal: bool  #: True if the lanes hold modal coordinates, in pairs.
    shared: bool  #: True if all lanes have the same coefficients.
    survey: bool  #: True if extremes, contacts and largest forces are recorded.
    #: True if the table of the excitation holds what the loads contribute to the state of each lane over each step,
    #: because the lanes run at different speeds. Then nothing else may vary over the angle.
    driven: bool = False


class Source:
    """The source text of one kernel, and the contents of its arrays."""

    def __init__(self, form: Form) -> None:
        self.form, self.layout = form, layout_of(form.structure)
        refuse(form.structure)
        self.n, self.contacts, self._size = form.structure.size, len(form.structure.contacts), form.structure.state_size
        self._stops = rigid_stops(self.layout)
        self._slots: dict[tuple[str, tuple[int, ...]], int] = {}
        self._patterns = patterns_of(form)
        loaded = np.asarray(self._patterns["loads"].any(axis=1))
        self._excitation = Excitation(self.layout, form.shared, loaded, self._coefficient, self._active)
        deflections = deflections_of(self.layout)
        self._moves = [
            [place for place, (k, _) in enumerate(deflections) if k == each] for each in range(self.contacts)
        ]
        self._past = [
            f"p{number}_{k}" for k in range(self.contacts) for number, _ in enumerate(past_of(form.structure, k))
        ]

    @cached_property
    def text(self) -> str:
        """The text of the kernel, a function `advance`."""
        loops, outside = [], []
        for chunk in self._chunks:
            fetch = [f"{name} = C[{name[1:]}]" for name in chunk.numbers]
            inside = []
            if not self.form.shared:
                fetch, inside = [], [f"{name} = C[{int(name[1:]) * LANES} + l]" for name in chunk.numbers]
            elif len(self._chunks) == 1:
                fetch, outside = [], fetch
            inside += self._driving(chunk) if self.form.driven else []
            lines = [*inside, *chunk.loads(self._rows), *chunk.lines, *chunk.stores(self._rows)]
            loops += [*fetch, f"for l in range({LANES}):", *_indented(lines, 1).splitlines()]
        columns = 0 if self.form.driven else self._excitation.columns
        times = [f"t{column} = T[i * {columns} + {column}]" for column in range(columns)]
        return FRAME.format(
            lanes=LANES,
            size=self._size,
            outside=_indented(outside, 1),
            times=_indented(times, 3),
            loops=_indented(loops, 3),
        )

    @cached_property
    def _chunks(self) -> list[Chunk]:
        return chunks_of(list(self._atoms()))

    @cached_property
    def _rows(self) -> dict[str, int]:
        """Row of each name that outlives a loop: states, forces, past numbers; after a survey, stored values."""
        names = [f"z{i}" for i in range(self._size)]
        names += [f"h{j}_{k}" for j in range(HISTORY) for k in range(self.contacts)]
        names += self._past
        rows = {name: row for row, name in enumerate(names)}
        for name in (name for chunk in self._chunks for name in chunk.keeps):
            rows.setdefault(name, len(rows) + self._tallies)  # a stop changes what was kept before
        return rows

    @cached_property
    def tally_rows(self) -> dict[str, int]:
        """First row of each quantity of a survey, after states and history, and the row after all of them."""
        if not self.form.survey:
            return {}
        first, rows = self._size + HISTORY * self.contacts + len(self._past), {}
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
            "impulse": scheme.impulse,
            "echo": scheme.echo,
            "hold": scheme.hold,
            "coefficient": linear.coefficients,
            "basis": linear.basis if linear.basis is not None else np.zeros((len(scheme.span), 0, 0)),
        }
        numbers = [parts[kind][(slice(None), *place)] for kind, place in self._slots]
        return np.array(numbers).reshape(len(numbers), len(scheme.span))

    def times(self, scheme: Scheme, linear: Linear, steps: int) -> NDArray[np.float64]:
        """Return the table ``T`` of the excitation over one forcing period, shape (steps, columns)."""
        assert self._chunks
        return self._excitation.table(linear.coefficients[0], scheme.loads[0], steps)

    def _atoms(self) -> Iterable[list[str]]:
        """Yield the lines of one step of one lane, in groups of dependent lines."""
        size = 2 * self.n
        yield from ([f"u{i} = {self._drift(i)}"] for i in range(size))
        yield from self._impacts()
        dry = [slots.form.law.is_dry for slots in self.layout.contacts]
        for k in sorted(range(self.contacts), key=dry.__getitem__):  # the force of a host comes before its friction
            yield [*self._forecast(k), *self._force(k)] if k not in self._stops else [f"f{k} = 0.0"]
        kicks = [f"y{i} = {total([f'u{i}', *self._kick(i)])}" for i in range(size)]
        stores = [f"S[{i * LANES} + l] = y{i}" for i in range(size)]
        if self.form.survey:  # it needs both the old and the new states
            yield from ([kick] for kick in kicks)
            yield from self._survey()
            yield stores
        else:
            yield from map(list, zip(kicks, stores, strict=True))
        for k in range(self.contacts):
            first = (self._size + k) * LANES
            yield [
                f"S[{first + j * self.contacts * LANES} + l] = {f'h{j - 1}_{k}' if j else f'f{k}'}"
                for j in range(HISTORY)
            ]

    def _drift(self, i: int) -> str:
        terms = [f"{self._slot('transition', i, j)} * z{j}" for j in self._present("transition", i)]
        present = self._present("loads", i)
        if self.form.driven and present:
            terms.append(f"t{i}")
        elif self.form.shared and present:
            terms.append(self._excitation.load(i))
        elif present:
            terms += [f"{self._slot('loads', i, b)} * t{b}" for b in present]
        return total(terms)

    def _driving(self, chunk: Chunk) -> list[str]:
        """Write the lines that read what the loads contribute to a lane."""
        used = sorted({int(name[1:]) for line in chunk.lines for name in _DRIVING.findall(line)})
        return [f"t{i} = T[(i * {2 * self.n} + {i}) * {LANES} + l]" for i in used]

    def _kick(self, i: int) -> Iterable[str]:
        for k in self._present("weights", i):
            for j in range(1 + HISTORY):
                yield f"{self._slot('weights', j, i, k)} * {'f' if j == 0 else f'h{j - 1}_'}{k}"

    def _row(self, which: int, k: int, symbol: str) -> str:
        present = np.flatnonzero(self._patterns["rows"][which, k]).tolist()
        return total([f"{self._slot('rows', which, k, i)} * {symbol}{i}" for i in present])

    def _forecast(self, k: int, called: Sequence[tuple[str, str]] | None = None) -> list[str]:
        """Write the lines that predict the deflections and rates of a contact at the end of the step."""
        sheet, lines = Sheet("s"), []
        for argument, (move, names) in enumerate(zip(self._moves[k], called or self._names(k), strict=True)):
            for which, name in enumerate(names):
                known = [
                    f"{self._slot('forecast', j, which, move, m)} * h{j}_{m}"
                    for j in range(HISTORY)
                    for m in np.flatnonzero(self._patterns["forecast"][which, move]).tolist()
                ]
                sway = self._excitation.sway(sheet, k, argument, which)
                lines += [*sheet.lines(sway), f"{name} = {total([self._row(which, move, 'u'), *known, _text(sway)])}"]
        return lines

    def _names(self, k: int) -> list[tuple[str, str]]:
        """Return the names of the deflections and rates of a contact."""
        return (
            [(f"x{place}", f"r{place}") for place, _ in enumerate(self._moves[k])]
            if self._moves[k][1:]
            else [("x", "r")]
        )

    def _numbers(self, k: int, sheet: Sheet) -> Callable[[int], Term]:
        """Return a function that writes a coefficient of a contact, with what it varies by."""
        slots = self.layout.contacts[k]
        waves = {stage.numbers[name]: wave for stage in slots.stages for name, wave in stage.waves.items()}
        waves |= {slots.numbers[name]: wave for name, wave in slots.waves.items() if name in slots.numbers}

        def number(slot: int) -> Term:
            return (
                self._excitation.varied(sheet, slot, waves[slot])
                if slot in waves
                else sheet.name(self._coefficient(slot))
            )

        return number

    def _force(self, k: int) -> list[str]:
        """Write the lines for the contact force at the end of the step."""
        slots, sheet, span, result = self.layout.contacts[k], Sheet(), self._slot("span"), f"f{k}"
        if slots.form.law.is_dry:
            return self._friction(k)
        number = self._numbers(k, sheet)
        if not slots.form.has_closed_form:
            past = [f"p{mode}_{k}" for mode in range(slots.form.law.mode_count)]
            lines, guards = FormulaSource(slots, number).lines(sheet, self._names(k), span, past, result)
            return [*lines, *self._stored(guards)]
        used: list[Term] = []

        def name(slot: int) -> str:
            used.append(number(slot))
            return used[-1].text

        lines = ForceSource(slots, name, self._active).lines(span, result)
        return [*sheet.lines(*used), *lines]

    def _stored(self, past: Mapping[str, str]) -> list[str]:
        """Write the lines that store numbers for the next step."""
        first = self._size + HISTORY * self.contacts
        rows = {name: first + self._past.index(name) for name in past}
        return [f"S[{row * LANES} + l] = {past[name]}" for name, row in rows.items()]

    def _friction(self, k: int) -> list[str]:
        """Write the lines for the extension and the force of a Jenkins element at the end of the step."""
        slots, sheet, lines, host = self.layout.contacts[k], Sheet(), [], self.form.structure.host(k)
        own, state = self._numbers(k, sheet), 2 * self.n + self.form.structure.memories.index(k)
        past = [sheet.name(f"p{number}_{k}") for number, _ in enumerate(past_of(self.form.structure, k))]
        hosts = None
        if host is not None:
            lines = self._forecast(host, [("hx", "hr")])
            move = sheet.name("hx"), sheet.name("hr")
            hosts = HostTerms(
                self.layout.contacts[host], self._numbers(host, sheet), move, past[-1], sheet.name(f"f{host}")
            )
        source = JenkinsSource(slots, own, self._active, sheet, sheet.name(self._slot("span")))
        x, rate = map(sheet.name, self._names(k)[0])
        found = source.terms((x, rate), sheet.name(f"z{state}"), past, hosts)
        kept = {name.text: term.text for name, term in zip(past, found.past, strict=True)}
        return [
            *lines,
            *sheet.lines(found.force, found.extension, found.most, *found.past),
            f"f{k} = {found.force.text}",
            f"j0_{k} = {found.most.text}",
            f"S[{state * LANES} + l] = {found.extension.text}",
            *self._stored(kept),
        ]

    def _impacts(self) -> Iterable[list[str]]:
        """Yield the lines by which rigid stops change the states at the end of the step."""
        for stop, k in enumerate(self._stops):
            sheet, source = self._stop(k)
            move, names = self._moves[k][0], [("bx", "br"), ("x", "r")]
            lines = []
            for which, name in enumerate(names[0]):
                sway = self._excitation.sway(sheet, k, 0, which, start=True)
                lines += [*sheet.lines(sway), f"{name} = {total([self._row(which, move, 'z'), _text(sway)])}"]

            def echo(which: int, rest: Any, stop: int = stop, sheet: Sheet = sheet) -> Any:
                return polynomial([sheet.name(self._slot("echo", j, which, stop)) for j in range(DEGREE + 1)], rest)

            start, end = ((sheet.name(x), sheet.name(rate)) for x, rate in names)
            slots = self.layout.contacts[k]
            numbers = {name: sheet.name(self._coefficient(slot)) for name, slot in slots.numbers.items()}
            rebound = partial(slots.form.law.rebound, numbers=numbers)
            found = source.impact(start, end, sheet.name(f"p0_{k}"), rebound, echo)
            lines += [*self._forecast(k), *sheet.lines(*found)]
            lines += [f"j{number}_{k} = {_text(term)}" for number, term in enumerate(found)]
            yield lines
        if self._stops[1:]:
            yield self._earliest()
        for stop, k in enumerate(self._stops):
            for i in np.flatnonzero(self._patterns["impulse"][:, stop]).tolist():
                sheet = Sheet()
                gone = polynomial(
                    [sheet.name(self._slot("impulse", j, i, stop)) for j in range(DEGREE + 1)], sheet.name(f"j1_{k}")
                )
                yield [*sheet.lines(gone), f"u{i} = u{i} - j0_{k} * {gone.text} - {self._held(i, stop, k)}"]
        for _ in range(_SWEEPS if self._stops[1:] else 0):  # each reaction moves the other stops
            for stop, k in enumerate(self._stops):
                sheet, source = self._stop(k)
                removed = sheet.name(f"j2_{k}"), sheet.name(f"j3_{k}")
                struck = sheet.name(
                    total([f"(abs(j0_{other}) if j2_{other} == 0.0 else 0.0)" for other in self._stops if other != k])
                )
                found = source.again((sheet.name("x"), sheet.name("r")), removed, sheet.name(f"j4_{k}"), struck)
                lines = [*self._forecast(k), *sheet.lines(*found)]
                names = (f"j{number}_{k}" for number in (2, 3, 5, 6, 4))
                yield [*lines, *(f"{name} = {_text(term)}" for name, term in zip(names, found, strict=True))]
                for i in np.flatnonzero(self._patterns["impulse"][:, stop]).tolist():
                    yield [f"u{i} = u{i} - {self._held(i, stop, k, 5)}"]
        yield from ([*self._stored({f"p0_{k}": f"j4_{k}"})] for k in self._stops)

    def _earliest(self) -> list[str]:
        """Write the lines that leave the earliest impact of a step; it changes whether the others occur, and how."""
        # Another one that still occurs does so at the beginning of the next step.
        lines = [f"rest{k} = j1_{k} if j0_{k} != 0.0 else -1.0" for k in self._stops]
        for k in self._stops:
            earlier = " | ".join(f"(rest{k} < rest{other})" for other in self._stops if other != k)
            lines.append(f"late = (rest{k} >= 0.0) & ({earlier})")
            lines += [f"j{number}_{k} = 0.0 if late else j{number}_{k}" for number in (0, 2, 3, 4)]
        return lines

    def _held(self, i: int, stop: int, k: int, first: int = 2) -> str:
        """Write the change of a component of the state by a reaction."""
        deflection, rate = (self._slot("hold", which, i, stop) for which in (0, 1))
        return f"({deflection} * j{first}_{k} + {rate} * j{first + 1}_{k})"

    def _stop(self, k: int) -> tuple[Sheet, RigidSource]:
        """Return the writer of the lines for a rigid stop, and its sheet."""
        sheet, slots = Sheet(), self.layout.contacts[k]
        clearances = {
            stage.sign: sheet.name(self._coefficient(stage.clearance)) for stage in slots.stages if stage.innermost
        }
        return sheet, RigidSource(sheet, clearances, sheet.name(self._slot("span")))

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
                # at an impact it turns at once
                *(
                    f"tip = (qz + {self._slot('span')} * vz * (1.0 - j1_{k})) if j0_{k} != 0.0 else tip"
                    for k in self._stops
                ),
                keep(rows["low"] + i, "min(qy, tip)", "min"),
                keep(rows["high"] + i, "max(qy, tip)", "max"),
            ]
            yield lines
        for k, slots in enumerate(self.layout.contacts):
            if slots.form.law.is_dry:
                yield [keep(rows["peak"] + k, f"j0_{k}", "max")]
                continue
            # vertex of the parabola through three values
            lines = [
                f"middle, before, after = abs(h0_{k}), abs(h1_{k}), abs(f{k})",
                "over = middle > before and middle > after",
                "bend = (2.0 * middle - before - after) if over else 1.0",
                "tip = (middle + (after - before) ** 2 / (8.0 * bend)) if over else after",
                keep(rows["peak"] + k, "max(after, tip)", "max"),
            ]
            sheet, move = Sheet("s"), self._moves[k][0]
            for symbol, start in (("z", True), ("y", False)):
                sway = self._excitation.sway(sheet, k, 0, start=start)
                lines += [*sheet.lines(sway), f"x{symbol} = {total([self._row(0, move, symbol), _text(sway)])}"]
            for stage in (each for each in slots.stages if each.innermost):
                sign = stage.sign
                if k in self._stops:
                    row = rows["contacts"] + 2 * k + (sign < 0)
                    lines.append(f"S[{row * LANES} + l] += 1.0 if j0_{k} {'>' if sign > 0 else '<'} 0.0 else 0.0")
                    continue
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

    def _coefficient(self, slot: int) -> str:
        return self._slot("coefficient", slot)

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
    stops = rigid_stops(layout)
    patterns = {"transition": reach, "loads": reach @ loads, "impulse": reach @ push[:, stops], "rows": rows}
    push[:, stops] = False  # impulses and reactions instead of a force
    patterns["weights"] = reach @ push
    patterns["forecast"] = rows @ patterns["weights"]
    if form.modal:
        patterns["transition"] = np.kron(np.eye(n, dtype=bool), np.ones((2, 2), dtype=bool))
        patterns["loads"] = np.broadcast_to(loads.any(axis=0), loads.shape)
        patterns["weights"] = np.broadcast_to(push.any(axis=0), push.shape)
        patterns["impulse"] = np.ones((2 * n, len(stops)), dtype=bool)
        patterns["rows"] = np.broadcast_to(rows.any(axis=2, keepdims=True), rows.shape)
    return patterns


def _text(part: Term | float) -> str:
    return part.text if isinstance(part, Term) else repr(part)


def _indented(lines: Iterable[str], depth: int) -> str:
    return "\n".join("    " * depth + line for line in lines)


# Kernels: source text compiled to machine code once for each form, and cached in this process and on disk.
#
# On disk, numba stores the machine code next to a file with the kernel's text; it checks the processor and its own
# version. The cache is loaded as code. So only a folder that nobody else can write to is trusted, and only files that
# are unchanged.

_MOST = 200
"""Largest number of kernels in the cache; above it the oldest ones are removed."""
# NaN must be respected, because it marks a diverged motion. Apart from that, terms may be reordered and fused.
_FAST = {"contract", "reassoc", "nsz", "arcp"}
_SIGNATURE = "boolean(f8[::1], f8[::1], f8[::1], i8, i8, i8, i8, f8[:, :, ::1], i8[::1], f8[:, ::1], f8, i8[::1])"
_compiling = Lock()


@dataclass(frozen=True)
class Kernel:
    """Compiled code that advances a block of lanes over forcing periods; see `Source` for its arrays."""

    source: Source  #: Its source text, and the layout of its arrays.
    #: ``advance(S, C, T, first, periods, steps, every, record, left, last, limit, stop)``; it releases the interpreter
    #: lock. It returns False if it was stopped.
    advance: Callable[..., bool]


def kernel_of(form: Form) -> Kernel:
    """Return the kernel of a form: compiled on first use (about a second), later loaded from the cache."""
    with _compiling:
        return _compile(form)


@lru_cache(maxsize=64)
def _compile(form: Form) -> Kernel:
    source = Source(form)
    file = kernel_file(source.text)
    if file is None:
        return Kernel(source, _machine_code(source.text))
    try:
        code = _machine_code(source.text, file)
        seal(file)
        return Kernel(source, code)
    except Exception:  # damaged files may raise anything; the next request writes them again
        forget(file)
        return Kernel(source, _machine_code(source.text))


def kernel_file(text: str, *, folder: Path | None = None) -> Path | None:
    """Return a file with the text of a kernel in the user's cache; None if no folder can be trusted or written to."""
    try:
        folder = cache_folder("kernels") if folder is None else folder
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not all(is_private(each) for each in (folder, folder / "__pycache__") if each.exists()):
            return None
        file = folder / f"k{hashlib.sha256(text.encode()).hexdigest()[:32]}.py"
        if not file.exists() or file.read_text(encoding="utf-8") != text:  # new, or damaged
            write_whole(file, text.encode())
            _forget_oldest(folder)
        elif not _is_sealed(file):
            forget(file)
            write_whole(file, text.encode())
        return file
    except (OSError, RuntimeError, UnicodeDecodeError):  # RuntimeError: there is no home
        return None


def _forget_oldest(folder: Path) -> None:
    files = sorted(folder.glob("k*.py"), key=lambda file: file.stat().st_mtime, reverse=True)
    for file in files[_MOST:]:
        forget(file)


def forget(file: Path) -> None:
    """Remove a kernel and all its machine code."""
    with suppress(OSError):
        for each in (_seal_of(file), file, *_stored_code(file)):
            each.unlink(missing_ok=True)


def _seal_of(file: Path) -> Path:
    return file.with_suffix(".sha256")


def _stored_code(file: Path) -> list[Path]:
    return sorted((file.parent / "__pycache__").glob(f"{file.stem}.*"))


def _is_sealed(file: Path) -> bool:
    seal = _seal_of(file)
    return seal.exists() and seal.read_text(encoding="ascii") == _checksum(file)


def seal(file: Path) -> None:
    """Store the checksum of a kernel's machine code; without it, or after a change, the code is not loaded again."""
    with suppress(OSError):  # then it will be compiled again
        if not _is_sealed(file):
            write_whole(_seal_of(file), _checksum(file).encode())


def _checksum(file: Path) -> str:
    """Compute the checksum of all machine code of a kernel, for every processor if several machines share a home."""
    digest = hashlib.sha256()
    for each in _stored_code(file):
        digest.update(each.name.encode() + each.read_bytes())
    return digest.hexdigest()


def _machine_code(text: str, file: Path | None = None) -> Callable[..., bool]:
    """Compile a kernel, or load its machine code if that is stored next to a file with its text."""
    import numba  # imported late: it takes longer to load than all other packages

    names: dict[str, Any] = {"np": np, "__name__": __name__}
    exec(compile(text, "<batch integrator>" if file is None else str(file), "exec"), names)
    # NumPy's rules for division: a check for zero in every lane would forbid SIMD
    keep = file is not None
    compiler = numba.njit(_SIGNATURE, nogil=True, error_model="numpy", fastmath=_FAST, cache=keep)
    return compiler(names["advance"])

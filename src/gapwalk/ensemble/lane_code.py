"""Machine code that advances eight motions at once by equal steps: LLVM compiles it from the equations of a structure.

The equations are straight-line code on vectors of eight lanes, one motion in each. It is written by arithmetic: the
laws of the contacts are evaluated with terms that write instructions. All numbers of a system are run-time data, so
that the code serves every value of every parameter; a fraction of a second compiles it, thousands of lines at once.
"""

from __future__ import annotations

import ctypes
import re
import struct
from collections.abc import Callable, Sequence
from functools import cached_property, lru_cache
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from gapwalk.ensemble.force_source import FUNCTIONS, Sheet, Switch, Term, either, floor, greatest, least, size
from gapwalk.errors import UnfitError
from gapwalk.flow.forces import stages_of
from gapwalk.machine_code import engine_of
from gapwalk.model.coefficients import ContactSlots, Wave, layout_of
from gapwalk.model.laws import Friction, Host, Stages
from gapwalk.model.structure import Structure

WIDTH = 8
"""Motions that are advanced together."""
# of them in a register; LLVM tells it too, but takes long to load
_PART = WIDTH if getattr(import_module("numpy._core._multiarray_umath"), "__cpu_features__", {}).get("AVX512F") else 4
_PARTS = range(WIDTH // _PART)
_VECTOR, _MASK = f"<{_PART} x double>", f"<{_PART} x i1>"
_WIDE = '"prefer-vector-width"="512" "min-legal-vector-width"="512"'  # one register where there are such
_FAST = "nsz arcp contract reassoc"  # not-a-number and infinity stay what they are: they tell a motion that diverged
_OPERATIONS = {"{} + {}": "fadd", "{} - {}": "fsub", "{} * {}": "fmul", "{} / {}": "fdiv"}
_CALLED = ("sin", "cos", "exp", "log", "tanh", "power")  # of the C library, lane by lane


class VectorSheet(Sheet):
    """Instructions of LLVM on vectors of lanes, written by the arithmetic of terms."""

    def __init__(self) -> None:
        super().__init__("%e")

    def write(self, pattern: str, *parts: Any) -> Term:
        """See `Sheet.write`."""
        if pattern in ("min({}, {})", "max({}, {})"):
            less = "olt" if pattern.startswith("min") else "ogt"
            return self._select(self._line(f"fcmp {less} {_VECTOR} {{}}, {{}}", *parts), *parts)
        if pattern == "np.copysign(1.0, {})":
            return self._line(
                f"call {_VECTOR} @llvm.copysign.v{_PART}f64({_VECTOR} {_splat(1.0)}, {_VECTOR} {{}})", *parts
            )
        if pattern in ("{} and {}", "{} < {}"):
            return self._line(
                f"and {_MASK} {{}}, {{}}" if "and" in pattern else f"fcmp olt {_VECTOR} {{}}, {{}}", *parts
            )
        if pattern == "not {}":
            return self._line(f"xor {_MASK} {{}}, {_splat('true', 'i1')}", *parts)
        if pattern.endswith("{} > 0.0"):
            return self._line(f"fcmp ogt {_VECTOR} {{}}, zeroinitializer", *parts)
        if pattern.startswith("1.0 if"):
            return self._select(parts[0], 1.0, 0.0)
        if " if " in pattern:  # one if condition else other
            return self._select(parts[1], parts[0], parts[2] if parts[2:] else 0.0)
        if pattern in _OPERATIONS:
            return self._line(f"{_OPERATIONS[pattern]} {_FAST} {_VECTOR} {{}}, {{}}", *parts)
        if pattern == "-{}":
            return self._line(f"fneg {_FAST} {_VECTOR} {{}}", *parts)
        name = pattern.removeprefix("np.").partition("(")[0]
        if name in _CALLED:
            given = ", ".join(f"{_VECTOR} {{}}" for _ in parts)
            return self._line(f"call {_VECTOR} @lanes.{name}({given})", *parts)
        intrinsic = {"abs": "fabs"}.get(name, name)  # floor and sqrt are instructions
        return self._line(f"call {_VECTOR} @llvm.{intrinsic}.v{_PART}f64({_VECTOR} {{}})", *parts)

    def read(self, pointer: str, row: int) -> Term:
        """Read a row of all lanes."""
        place = self._line(f"getelementptr {_VECTOR}, ptr %{pointer}, i64 {row * len(_PARTS)}")
        return self._line(f"load {_VECTOR}, ptr {{}}, align {8 * _PART}", place)

    def read_one(self, pointer: str, place: int) -> Term:
        """Read a number that all lanes share."""
        where = self._line(f"getelementptr double, ptr %{pointer}, i64 {place}")
        return self.spread(self._line("load double, ptr {}, align 8", where))

    def spread(self, number: Term | str) -> Term:
        """Give a number to all lanes."""
        given = number if isinstance(number, Term) else Term(self, number)
        first = self._line(f"insertelement {_VECTOR} poison, double {{}}, i64 0", given)
        return self._line(f"shufflevector {_VECTOR} {{}}, {_VECTOR} poison, <{_PART} x i32> zeroinitializer", first)

    def _select(self, condition: Any, one: Any, other: Any) -> Term:
        return self._line(f"select {_MASK} {{}}, {_VECTOR} {{}}, {_VECTOR} {{}}", condition, one, other)

    def _line(self, pattern: str, *parts: Any) -> Term:
        return super().write(pattern, *(each if isinstance(each, Term) else Term(self, _splat(each)) for each in parts))

    def function(self, head: str, stores: Sequence[tuple[str, int, Any]]) -> str:
        """Return the text of a function that stores terms in rows of pointers, each once it and its row are read.

        Terms that wait for the end of the function do not fit into the registers. What one pointer of a head reads and
        another stores has to be read before the terms that are stored.
        """
        values = [value if isinstance(value, Term) else Term(self, _splat(value)) for *_, value in stores]
        lines = self.lines(*values)
        at = {line.partition(" = ")[0]: number for number, line in enumerate(lines)}
        then: list[list[str]] = [[] for _ in range(len(lines) + 1)]
        for number, ((pointer, row, _), value) in enumerate(zip(stores, values, strict=True)):
            last = max(at.get(value.text, -1), at.get(self.read(pointer, row).text, -1)) + 1
            then[last].append(f"%s{number} = getelementptr {_VECTOR}, ptr %{pointer}, i64 {row * len(_PARTS)}")
            # volatile: else a largest value becomes a masked store, which takes 20 times as long on some processors
            then[last].append(f"store volatile {_VECTOR} {value.text}, ptr %s{number}, align {8 * _PART}")
        lines = [*then[0], *(each for line, more in zip(lines, then[1:], strict=True) for each in (line, *more))]
        return "\n".join([f"define internal void {head} noinline nounwind {_WIDE} {{", *lines, "ret void", "}"])


def _splat(value: Any, kind: str = "double") -> str:
    text = value if isinstance(value, str) else f"0x{struct.pack('>d', float(value)).hex().upper()}"
    return f"<{', '.join([f'{kind} {text}'] * _PART)}>"


class Form(NamedTuple):
    """The properties of a system on which its code depends."""

    structure: Structure
    pattern: bytes  #: What each coefficient is: 0 if it is always 0, `ONE` if it is always 1, 1 if it may vary.
    #: The entries of each row of signals that may differ from 0, as masks: by what `_noted` has, then earlier signals.
    signals: tuple[bytes, ...] = ()
    #: Kinds of notes that are taken, of `OF_CONTACT`, `OF_COORDINATE`, `OF_SIGNAL`, `GRIP`.
    notes: tuple[str, ...] = ()
    apart: bool = False  #: True if each lane is at its own angle.
    sampled: bool = False  #: True for code that writes down states, see `CodeWriter.sample_rows`.


ONE = 2
"""Mark of a coefficient that is always 1."""
#: Notes of each contact with stages: closings of the innermost stage on both sides; least and largest deflection;
#: largest size of the force; sum of the power that it takes; fastest approach; side at the end.
OF_CONTACT = ("up", "down", "low", "high", "peak", "power", "approach", "side")
#: Notes of each coordinate: least and largest value, sums of the values and of the velocities.
OF_COORDINATE = ("least", "most", "total", "drift")
#: Notes of each signal: sums of its square and of its fourth power, largest size.
OF_SIGNAL = ("energy", "fourth", "summit")
#: Note of each contact that is friction: largest size of its force.
GRIP = "grip"
#: The notes that tell whether a gap rattles.
LABELS = ("up", "down", "low", "high", "side")
_BEGIN = {"low": np.inf, "high": -np.inf, "least": np.inf, "most": -np.inf, "side": np.nan}


class _Motion:
    """Terms of the equations of motion of a state, or of that half a step later."""

    def __init__(self, writer: CodeWriter, *, moves: bool = False) -> None:
        self.sheet, self.writer, n = VectorSheet(), writer, writer.size
        self.q, self.v = ([self.sheet.read("Y", first + row) for row in range(n)] for first in (0, n))
        self.a, self.before = ([self.sheet.read(pointer, row) for row in range(n)] for pointer in "AB")
        self.zero = Term(self.sheet, _splat(0.0))
        if moves:
            # 2a - b, 3a - b and 4a - b by sums alone: products of all rows take longer than anything else
            half = 0.5 * self.sheet.read("C", 0)
            self.ahead = [a + (a - b) for a, b in zip(self.a, self.before, strict=True)]
            triple = [a + twice for a, twice in zip(self.a, self.ahead, strict=True)]
            means = [v + half * (1.0 / 6.0) * (a + each) for v, a, each in zip(self.v, self.a, triple, strict=True)]
            self.q = [q + half * v for q, v in zip(self.q, means, strict=True)]
            self.v = [v + half * 0.5 * each for v, each in zip(self.v, triple, strict=True)]
            self.share = half * (5.0 / 12.0)  # in the velocity, of what the acceleration is beside `ahead`

    def number(self, slot: int) -> Any:
        """Return a coefficient; a plain number if it is always 0 or 1."""
        active = self.writer.active[slot]
        return self.sheet.read("C", self.writer.row(slot)) if active == 1 else 1.0 if active else 0.0

    def dot(self, slots: Sequence[int], terms: Sequence[Any]) -> Any:
        """Return the sum of some terms, each with a coefficient."""
        total: Any = 0.0
        for slot, term in zip(slots, terms, strict=True):
            if self.writer.active[slot]:
                total = total + self.number(slot) * term
        return total

    @property
    def lines(self) -> list[Term]:
        """Cosines, then sines, of all orders at this angle."""
        return [self.angular(place) for place in range(2 * len(self.writer.layout.orders))]

    def angular(self, place: int) -> Term:
        """Read a number of the table over the angle."""
        return self.sheet.read("T", place) if self.writer.form.apart else self.sheet.read_one("T", place)

    def wave(self, wave: Wave, derivative: int = 0) -> Any:
        """Return the variation of a number over the angle, or its derivative by it."""
        layout, lines = self.writer.layout, self.lines
        count = len(layout.orders)
        if derivative:
            orders = [float(order) for order in layout.orders]
            lines = [-lines[count + k] * orders[k] for k in range(count)] + [lines[k] * orders[k] for k in range(count)]
            return self.dot(wave.lines.tolist(), lines)
        total = self.dot(wave.lines.tolist(), lines)
        for number, factor in wave.cycles:
            cycle = layout.cycles[number]
            low, high, up, down = (self.number(slot) for slot in cycle[1:])
            length = 2.0 * np.pi / cycle.order
            turned = self.angular(2 * count) - up
            turned = turned - length * floor(turned * (1.0 / length))
            total = total + factor * (low + (high - low) * Switch.of((down - up) - turned))
        return total

    def named(self, numbers: Any, waves: Any) -> dict[str, Any]:
        """Return parameters by name."""
        found = {name: self.number(slot) for name, slot in numbers.items()}
        return found | {name: found[name] * (1.0 + self.wave(wave)) for name, wave in waves.items() if name in found}

    def moves(self, slots: ContactSlots) -> list[tuple[Any, Any]]:
        """Return each deflection of a contact, with its rate."""
        found = []
        for argument, vector in zip(slots.form.law.arguments, slots.deflections, strict=True):
            x, rate = self.dot(vector.tolist(), self.q), self.dot(vector.tolist(), self.v)
            if (wave := slots.waves.get(argument)) is not None:
                x, rate = x + self.wave(wave), rate + self.wave(wave, 1) / self.number(0)
            found.append((x + self.zero, rate + self.zero) if _is_zero(x) else (x, rate))
        return found

    def stages(self, slots: ContactSlots, moves: Sequence[tuple[Any, Any]]) -> Stages:
        """Return the arguments of the law of a contact."""

        def within(depth: Any, sign: float) -> tuple[Any, Any]:
            limited = (greatest if sign > 0 else least)(depth, 0.0)
            return limited, Switch.of(depth if sign > 0 else -depth)

        return stages_of(
            slots, self, moves, decide=lambda _, guard: Switch.of(guard), within=within, functions=FUNCTIONS
        )

    def forces(self) -> tuple[list[Any], list[Any]]:
        """Return the forces of all contacts, and the extensions of Jenkins elements with their deflections."""
        layout = self.writer.layout
        self.moved = moved = [self.moves(slots) for slots in layout.contacts]
        forces: list[Any] = [0.0] * len(moved)
        held: list[Any] = []
        # a host's force comes before that of the friction that it presses
        for index in sorted(range(len(moved)), key=lambda k: layout.contacts[k].form.law.is_dry):
            slots = layout.contacts[index]
            law, numbers = slots.form.law, self.named(slots.numbers, slots.waves)
            if not law.is_dry:
                forces[index] = law.force(moved[index][0][1], self.stages(slots, moved[index]), numbers)
                continue
            assert isinstance(law, Friction)
            terms = Stages([])
            if (host := layout.structure.host(index)) is not None:
                terms.host = Host(self.stages(layout.contacts[host], moved[host]), forces[host])
            limit = greatest(law.limit(terms, numbers) + self.zero, 0.0)
            place, count = self.writer.dry.index(index), len(self.writer.dry)
            z, begun = (self.sheet.read("Y", 2 * self.writer.size + row) for row in (place, count + place))
            (x, rate), free = moved[index][0], z + (moved[index][0][0] - begun)
            if not _is_zero(numbers["speed"]):
                rate = rate - numbers["speed"]
                free = free - self.sheet.spread("%since") * self.sheet.read("C", 0) * numbers["speed"]
            spring = numbers["stiffness"] if law.has_memory else self.writer.held(self.sheet, index, "spring")
            width = limit / spring
            z = least(greatest(free, -width), width)
            forces[index] = spring * z
            if not law.has_memory:  # a stiff spring with a damper in place of stick
                damped = forces[index] + self.writer.held(self.sheet, index, "damper") * rate
                forces[index] = least(greatest(damped, -limit), limit)
            held.append((place, z, x))
        return forces, [each for _, *pair in sorted(held, key=lambda each: each[0]) for each in pair]

    def accelerations(self, forces: Sequence[Any]) -> list[Any]:
        """Return the accelerations of the coordinates."""
        n, count = self.writer.size, len(forces)
        found = []
        for slots in self.writer.layout.accelerations.tolist():
            mean, waves = slots[2 * n + count], slots[2 * n + count + 1 :]
            driven = self.number(mean) + self.dot(waves, self.lines)
            pulled = self.dot(slots[: 2 * n + count], [*self.q, *self.v, *forces])
            found.append(driven - pulled)
        return found


def _is_zero(value: Any) -> bool:
    return not isinstance(value, Term) and value == 0.0


class CodeWriter:
    """Writer of the code for a form."""

    def __init__(self, form: Form) -> None:
        self.form, self.layout = form, layout_of(form.structure)
        self.size = self.layout.structure.size
        self.active = np.frombuffer(form.pattern, dtype=np.uint8)
        self.signals = [np.frombuffer(row, dtype=bool) for row in form.signals]
        self.dry = [k for k, slots in enumerate(self.layout.contacts) if slots.form.law.is_dry]
        #: Rows of the numbers, after the length of a step: entries of signals, coefficients, springs for friction.
        keys = [(k, column) for k, row in enumerate(self.signals) for column in np.flatnonzero(row).tolist()]
        self.rows: dict[Any, int] = {key: 1 + row for row, key in enumerate(keys)}
        refuse(self.layout.structure)

    def row(self, key: Any) -> int:
        """Return the row of a number: of a coefficient by its slot, of others by what they are."""
        return self.rows.setdefault(key, 1 + len(self.rows))

    def held(self, sheet: VectorSheet, contact: int, what: str) -> Term:
        """Read the spring or the damper that stands for stick of friction that sticks rigidly."""
        return sheet.read("C", self.row((what, contact)))

    @property
    def columns(self) -> int:
        """Numbers in each row of the table over the angle."""
        return 2 * len(self.layout.orders) + 1

    @cached_property
    def alike(self) -> dict[tuple[str, int], tuple[str, int]]:
        """Notes that are others: the least and largest deflection of a contact that is a coordinate."""
        found = {}
        for k, slots in enumerate(self.layout.contacts):
            places = np.flatnonzero(self.active[slots.deflection]).tolist()
            if (
                slots.stages
                and [self.active[slots.deflection[place]] for place in places] == [ONE]
                and slots.sway is None
            ):
                found |= {("low", k): ("least", places[0]), ("high", k): ("most", places[0])}
        return {one: other for one, other in found.items() if {one, other} <= self.notes.keys()}

    @cached_property
    def notes(self) -> dict[tuple[str, int], int]:
        """The row of each note, by its kind and the number of the contact, coordinate or signal; the sides are last."""
        staged = [k for k, slots in enumerate(self.layout.contacts) if slots.stages]
        asked = {*self.form.notes, *(("side",) if {*self.form.notes} & {*OF_CONTACT} else ())}  # closings need it
        kinds: list[tuple[Sequence[str], Sequence[int]]] = [((GRIP,), self.dry), (OF_COORDINATE, range(self.size))]
        kinds += [(OF_SIGNAL, range(len(self.signals))), (OF_CONTACT, staged)]
        keys = [(kind, k) for names, places in kinds for kind in names if kind in asked for k in places]
        return {key: row for row, key in enumerate(keys)}

    def text(self) -> str:
        """Return the module."""
        parts = ["half", "noted"] if self.notes else ["half"]
        text = [self._begin(), *map(self._half, parts)]
        sizes: dict[str, Any] = {"columns": self.columns, "height": self.sample_rows, "size": self.size}
        sizes |= {"width": WIDTH, "number": f"[{WIDTH} x double]" if self.form.apart else "double"}
        begin, steps = self._in_parts(_BEGIN_STEPS), self._in_parts(_STEP.format(last=parts[-1]))
        text += [_ADVANCE.format(begin=begin, steps=steps, **sizes)]
        if self.form.sampled:
            text += [self._sample(), _SAMPLED.format(sample=self._in_parts(_SAMPLE), **sizes)]
        text += [_called(name) for name in _CALLED if any(f"@lanes.{name}(" in each for each in text)]
        names = [
            name for name in ("fabs", "floor", "sqrt") if any(f"@llvm.{name}.v{_PART}f64" in each for each in text)
        ]
        text += [f"declare {_VECTOR} @llvm.{name}.v{_PART}f64({_VECTOR})" for name in names]
        text.append(f"declare {_VECTOR} @llvm.copysign.v{_PART}f64({_VECTOR}, {_VECTOR})")
        return "\n\n".join(text)

    def _in_parts(self, calls: str) -> str:
        """Return calls for the lanes of one register after the other, which needs fewer registers than for all."""
        lines = []
        for part in _PARTS:
            for name in dict.fromkeys(re.findall(r"ptr %(\w+)", calls)):
                row = 0 if name.startswith("T") and not self.form.apart else part
                lines.append(f"%{name}.{part} = getelementptr {_VECTOR}, ptr %{name}, i64 {row}")
            lines.append(re.sub(r"ptr %(\w+)", rf"ptr %\1.{part}", calls))
        return "\n".join(lines)

    def _begin(self) -> str:
        motion = _Motion(self)
        stores = []
        for row, new in enumerate(motion.accelerations(motion.forces()[0])):
            is_known = motion.sheet.write("{} < {}", motion.a[row], np.inf)
            stores += [(pointer, row, either(is_known, motion.sheet.read(pointer, row), new)) for pointer in "AB"]
        return motion.sheet.function(f"@begin({_POINTERS})", stores)

    def _half(self, name: str) -> str:
        motion, n = _Motion(self, moves=True), self.size
        forces, held = motion.forces()
        a = motion.accelerations(forces)
        stores = [("Y", row, each) for row, each in enumerate(motion.q)]
        for row, (new, v) in enumerate(zip(a, motion.v, strict=True)):
            stores += [("Y", n + row, v + motion.share * (new - motion.ahead[row])), ("B", row, new)]
        count = len(held) // 2
        stores += [("Y", 2 * n + k // 2 + (k % 2) * count, each) for k, each in enumerate(held)]
        if name == "noted":
            stores += self._noted(motion, forces, a)
        return motion.sheet.function(f"@{name}({_POINTERS})", stores)

    @property
    def sample_rows(self) -> int:
        """Rows of a sample: of the state with the extensions of all friction, then the forces of that friction."""
        return 2 * self.size + 2 * len(self.dry)

    def _sample(self) -> str:
        motion = _Motion(self)
        forces, held = motion.forces()
        values = [*motion.q, *motion.v, *held[::2], *(forces[index] for index in self.dry)]
        stores = [("R", row, each) for row, each in enumerate(values)]
        return motion.sheet.function(f"@sample({_POINTERS}, ptr %R)", stores)

    def _noted(self, motion: _Motion, forces: Sequence[Any], a: Sequence[Any]) -> list[tuple[str, int, Any]]:
        rows, sheet = self.notes, motion.sheet
        found: list[tuple[str, int, Any]] = []

        def note(kind: str, place: int, change: Callable[[Any], Any]) -> None:
            if (row := rows.get((kind, place))) is not None and (kind, place) not in self.alike:
                found.append(("S", row, change(sheet.read("S", row))))

        for k, slots in enumerate(self.layout.contacts):
            if ("side", k) not in rows:
                continue
            (x, rate), force = motion.moved[k][0], forces[k]
            before, side = sheet.read("S", rows["side", k]), Term(sheet, _splat(0.0))
            closes = {1.0: side, -1.0: side}
            for stage in (stage for stage in slots.stages if stage.innermost):
                depth = x - stage.sign * motion.named(stage.numbers, stage.waves)["clearance"]
                is_closed = sheet.write("{} > 0.0", depth if stage.sign > 0 else -depth)
                side = either(is_closed, float(stage.sign), side)
                # a side that is not known yet is no number, and compares with nothing
                fresh = sheet.write("{} < {}", before if stage.sign > 0 else -before, 0.5)
                closes[stage.sign] = sheet.write("1.0 if {}", sheet.write("{} and {}", is_closed, fresh))
            note("up", k, lambda old, closes=closes: old + closes[1])
            note("down", k, lambda old, closes=closes: old + closes[-1])
            struck = closes[1] + closes[-1]
            note("approach", k, lambda old, rate=rate, struck=struck: greatest(old, struck * size(rate)))
            note("low", k, lambda old, x=x: least(old, x))
            note("high", k, lambda old, x=x: greatest(old, x))
            note("peak", k, lambda old, force=force: greatest(old, size(force)))
            note("power", k, lambda old, force=force, rate=rate: old + force * rate)
            note("side", k, lambda _, side=side: side)
        for k in self.dry:
            note(GRIP, k, lambda old, force=forces[k]: greatest(old, size(force)))
        for k, (q, v) in enumerate(zip(motion.q, motion.v, strict=True)):
            note("least", k, lambda old, q=q: least(old, q))
            note("most", k, lambda old, q=q: greatest(old, q))
            note("total", k, lambda old, q=q: old + q)
            note("drift", k, lambda old, v=v: old + v)
        columns = [*a, 1.0, *motion.lines]
        for k, active in enumerate(self.signals):
            signal: Any = 0.0
            for column in np.flatnonzero(active).tolist():
                signal = signal + sheet.read("C", self.row((k, column))) * columns[column]
            columns.append(signal)
            square = signal * signal
            note("energy", k, lambda old, square=square: old + square)
            note("fourth", k, lambda old, square=square: old + square * square)
            note("summit", k, lambda old, signal=signal: greatest(old, size(signal)))
        return found


_POINTERS = "ptr %C, ptr %T, ptr %Y, ptr %A, ptr %B, ptr %S, double %since"
_BEGIN_STEPS = "call void @begin(ptr %C, ptr %T, ptr %Y, ptr %A, ptr %B, ptr %S, double 0.0)"
_STEP = """\
call void @half(ptr %C, ptr %T1, ptr %Y, ptr %A, ptr %B, ptr %S, double 0.5)
call void @{last}(ptr %C, ptr %T2, ptr %Y, ptr %B, ptr %A, ptr %S, double 0.5)"""
_SAMPLE = "call void @sample(ptr %C, ptr %T1, ptr %Y, ptr %A, ptr %B, ptr %S, double 0.0, ptr %row)"
_ADVANCE = """\
define internal void @begins(ptr %C, ptr %T, ptr %Y, ptr %A, ptr %S) {{
%B = getelementptr [{width} x double], ptr %A, i64 {size}
{begin}
ret void
}}

define internal void @steps(ptr %C, ptr %T, ptr %Y, ptr %A, ptr %S, i64 %steps) {{
entry:
%B = getelementptr [{width} x double], ptr %A, i64 {size}
br label %loop
loop:
%i = phi i64 [ 0, %entry ], [ %next, %loop ]
%twice = shl i64 %i, 1
%T0 = getelementptr [{columns} x {number}], ptr %T, i64 %twice
%T1 = getelementptr [{columns} x {number}], ptr %T0, i64 1
%T2 = getelementptr [{columns} x {number}], ptr %T0, i64 2
{steps}
%next = add i64 %i, 1
%more = icmp ult i64 %next, %steps
br i1 %more, label %loop, label %end
end:
ret void
}}

define void @advance(ptr %C, ptr %T, ptr %Y, ptr %A, ptr %S, i64 %steps) {{
call void @begins(ptr %C, ptr %T, ptr %Y, ptr %A, ptr %S)
call void @steps(ptr %C, ptr %T, ptr %Y, ptr %A, ptr %S, i64 %steps)
ret void
}}
"""

_SAMPLED = """\
define void @sampled(ptr %C, ptr %T, ptr %Y, ptr %A, ptr %S, i64 %steps, i64 %samples, ptr %R) {{
entry:
%halves = shl i64 %steps, 1
%B = getelementptr [{width} x double], ptr %A, i64 {size}
call void @begins(ptr %C, ptr %T, ptr %Y, ptr %A, ptr %S)
br label %loop
loop:
%i = phi i64 [ 0, %entry ], [ %next, %loop ]
%first = mul i64 %i, %halves
%T0 = getelementptr [{columns} x {number}], ptr %T, i64 %first
%T1 = getelementptr [{columns} x {number}], ptr %T0, i64 %halves
%row = getelementptr [{height} x [{width} x double]], ptr %R, i64 %i
call void @steps(ptr %C, ptr %T0, ptr %Y, ptr %A, ptr %S, i64 %steps)
{sample}
%next = add i64 %i, 1
%more = icmp ult i64 %next, %samples
br i1 %more, label %loop, label %end
end:
ret void
}}
"""


def _called(name: str) -> str:
    """Return the text of a function of the C library, lane by lane."""
    count, plain = (2, "pow") if name == "power" else (1, name)
    heads = ", ".join(f"{_VECTOR} %{'xy'[k]}" for k in range(count))
    lines, last = (
        [
            f"declare double @{plain}({', '.join(['double'] * count)})",
            f"define internal {_VECTOR} @lanes.{name}({heads}) {{",
        ],
        "poison",
    )
    for lane in range(_PART):
        given = []
        for k in range(count):
            lines.append(f"%{'xy'[k]}{lane} = extractelement {_VECTOR} %{'xy'[k]}, i64 {lane}")
            given.append(f"double %{'xy'[k]}{lane}")
        lines.append(f"%r{lane} = call double @{plain}({', '.join(given)})")
        lines.append(f"%v{lane} = insertelement {_VECTOR} {last}, double %r{lane}, i64 {lane}")
        last = f"%v{lane}"
    return "\n".join([*lines, f"ret {_VECTOR} {last}", "}"])


def refuse(structure: Structure) -> None:
    """Refuse what equal steps without events cannot carry."""
    for contact in structure.contacts:
        law, cannot = contact.law, f"equal steps cannot include {contact.name!r}: "
        if law.rebounds:
            raise UnfitError(f'{cannot}it is a rigid stop; give it a stiffness, as in law = "hunt-crossley"')


class Code:
    """Compiled code for a form."""

    def __init__(self, form: Form) -> None:
        writer = CodeWriter(form)
        text = writer.text()
        self.layout, self.dry, self.rows = writer.layout, writer.dry, writer.rows
        self.columns, self.notes = writer.columns, writer.notes
        pairs = [(writer.notes[one], writer.notes[other]) for one, other in writer.alike.items()]
        self.alike = np.array(pairs, dtype=int).reshape(-1, 2).T  # rows of notes that are others, and those
        self.begin = np.array([_BEGIN.get(kind, 0.0) for kind, _ in self.notes])
        self._engine = engine_of(text)
        self.advance = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 5, ctypes.c_int64)(
            self._engine.get_function_address("advance")
        )
        self.sample_rows, self.apart = writer.sample_rows if form.sampled else 0, form.apart
        if form.sampled:
            place = self._engine.get_function_address("sampled")
            self.sampled = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 5, *[ctypes.c_int64] * 2, ctypes.c_void_p)(place)


@lru_cache(maxsize=32)
def code_of(form: Form) -> Code:
    """Return the compiled code for a form."""
    return Code(form)

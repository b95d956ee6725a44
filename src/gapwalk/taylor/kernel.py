"""The integrator by Taylor series for which equations are data, compiled once for all systems.

A program (`gapwalk.taylor.program`) lists operations on Taylor series: linear combinations, products, functions.
The kernel computes the series of all *slots* order by order, chooses the step, finds the first event in it, and carries
the state over. Columns of derivatives run eight at a time through a second list of operations, which is linear in them:
its factors are series of the first list.

Steps: Jorba and Zou (2005), A software package for the numerical integration of ODEs, Exp. Mathematics 14, 99-117.
"""

from __future__ import annotations

import math
import re
from typing import Any

import numba
import numba.extending
from llvmlite import ir
from numba import types
from numba.core import cgutils

from gapwalk.taylor import header
from gapwalk.taylor.header import LANES, LENGTH, ORDER, WIDE

_MOST_ZEROS = 4  # of a turning point's function in one step
_WHOLE = '"prefer-vector-width"="512" "min-legal-vector-width"="512"'
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract"}}
_inner = numba.njit(**_OPTIONS)
intrinsic: Any = numba.extending.intrinsic
_VECTOR = ir.VectorType(ir.DoubleType(), LANES)


@intrinsic
def _floats(typing: Any, address: Any) -> Any:
    """Pointer to numbers from an address."""

    def make(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

    return types.CPointer(types.float64)(types.int64), make


@intrinsic
def _integers(typing: Any, address: Any) -> Any:
    """Pointer to integers from an address."""

    def make(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

    return types.CPointer(types.int64)(types.int64), make


def _at(builder: Any, base: Any, offset: Any) -> Any:
    """Pointer to eight numbers."""
    return builder.bitcast(builder.gep(base, [offset], source_etype=ir.DoubleType()), ir.PointerType(_VECTOR))


def _load(builder: Any, pointer: Any) -> Any:
    return builder.load(pointer, align=8, typ=_VECTOR)


def _splat(builder: Any, value: Any) -> Any:
    one = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    mask = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(one, ir.Constant(_VECTOR, ir.Undefined), mask)


def _accumulate(builder: Any, sums: Any, a: Any, b: Any) -> None:
    """Add a product to eight sums."""
    flags = ("contract",)
    builder.store(builder.fadd(builder.fmul(a, b, flags=flags), builder.load(sums), flags=flags), sums)


_ZEROS = ir.Constant(_VECTOR, [0.0] * LANES)


def _number(builder: Any, w: Any, place: Any) -> Any:
    pointer = builder.gep(w, [place], source_etype=ir.DoubleType())
    return builder.load(pointer, typ=ir.DoubleType())


def _begins(builder: Any, place: Any, base: Any, aside: Any) -> Any:
    """Where a series of columns begins: of the state from `base` on, of others, whose places are negative, aside."""
    other = builder.add(aside, builder.not_(place))
    return builder.select(builder.icmp_signed("<", place, place.type(0)), other, builder.add(base, place))


@intrinsic
def _lane_row(typing: Any, w: Any, ip: Any, out: Any, values: Any, places: Any, begin: Any, end: Any, base: Any,
              aside: Any) -> Any:  # fmt: skip
    """Linear combination of eight columns: ``w[out] = sum of w[values + k] * lanes at ip[places + k]``."""

    def make(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        w, ip, out, values, places, begin, end, base, aside = given
        sums, whole = cgutils.alloca_once_value(builder, _ZEROS), ir.IntType(64)
        with cgutils.for_range_slice(builder, begin, end, whole(1), whole) as (k, _):
            place = builder.load(builder.gep(ip, [builder.add(places, k)], source_etype=whole), typ=whole)
            value = _number(builder, w, builder.add(values, k))
            lanes = _load(builder, _at(builder, w, _begins(builder, place, base, aside)))
            _accumulate(builder, sums, _splat(builder, value), lanes)
        builder.store(builder.load(sums), _at(builder, w, out), align=8)
        return context.get_dummy_value()

    i = types.int64
    return types.void(w, ip, i, i, i, i, i, i, i), make


@intrinsic
def _lane_product(typing: Any, w: Any, out: Any, factor: Any, place: Any, base: Any, aside: Any, count: Any) -> Any:
    """Product of a series and eight columns at one order: ``sum of w[factor + k] * lanes k orders earlier``."""

    def make(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        w, out, factor, place, base, aside, count = given
        sums, whole = cgutils.alloca_once_value(builder, _ZEROS), ir.IntType(64)
        lanes = _begins(builder, place, base, aside)
        with cgutils.for_range(builder, count) as loop:
            value = _number(builder, w, builder.add(factor, loop.index))
            offset = builder.sub(lanes, builder.mul(loop.index, whole(LANES)))
            _accumulate(builder, sums, _splat(builder, value), _load(builder, _at(builder, w, offset)))
        builder.store(builder.load(sums), _at(builder, w, out), align=8)
        return context.get_dummy_value()

    i = types.int64
    return types.void(w, i, i, i, i, i, i), make


@intrinsic
def _lane_rate(typing: Any, w: Any, out: Any, factor: Any, place: Any, base: Any, aside: Any) -> Any:
    """Eight columns times a number."""

    def make(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        w, out, factor, place, base, aside = given
        lanes = _load(builder, _at(builder, w, _begins(builder, place, base, aside)))
        builder.store(builder.fmul(_splat(builder, factor), lanes), _at(builder, w, out), align=8)
        return context.get_dummy_value()

    i = types.int64
    return types.void(w, i, types.float64, i, i, i), make


@intrinsic
def _lane_sum(typing: Any, w: Any, out: Any, at: Any, time: Any) -> Any:
    """Values of the polynomials of eight columns."""

    def make(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        w, out, at, time = given
        whole, time = ir.IntType(64), _splat(builder, time)
        value = _load(builder, _at(builder, w, builder.add(at, whole(ORDER * LANES))))
        for k in range(ORDER - 1, -1, -1):
            known = _load(builder, _at(builder, w, builder.add(at, whole(k * LANES))))
            value = builder.fadd(builder.fmul(value, time, flags=("contract",)), known, flags=("contract",))
        builder.store(value, _at(builder, w, out), align=8)
        return context.get_dummy_value()

    i = types.int64
    return types.void(w, i, i, types.float64), make


@intrinsic
def _lane_size(typing: Any, w: Any, at: Any, count: Any) -> Any:
    """Largest absolute value of one order of several columns, or more if one is not finite."""

    def make(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        w, at, count = given
        most, whole = cgutils.alloca_once_value(builder, _ZEROS), ir.IntType(64)
        with cgutils.for_range(builder, count) as loop:
            offset = builder.add(at, builder.mul(loop.index, whole(WIDE)))
            value = _load(builder, _at(builder, w, offset))
            opposite = builder.fsub(_ZEROS, value)
            value = builder.select(builder.fcmp_ordered("<", value, _ZEROS), opposite, value)
            known = builder.load(most)
            # unordered: what is not a number stays
            builder.store(builder.select(builder.fcmp_unordered(">", value, known), value, known), most)
        found = builder.load(most)
        result = builder.extract_element(found, ir.IntType(32)(0))
        for k in range(1, LANES):
            other = builder.extract_element(found, ir.IntType(32)(k))
            result = builder.select(builder.fcmp_unordered(">", other, result), other, result)
        return result

    return types.float64(w, types.int64, types.int64), make


@_inner
def _constants(ip, fp, w, pars):
    """Compute what depends on parameters only, and the factors of linear combinations."""
    parameters, numbers = ip[header.PARAMETERS], ip[header.NUMBERS]
    for k in range(parameters):
        w[k] = pars[k]
    for k in range(numbers):
        w[parameters + k] = fp[k]
    at = ip[header.STEPS]
    for _ in range(ip[header.STEP_COUNT]):
        kind, out, a, b = ip[at], ip[at + 1], w[ip[at + 2]], w[ip[at + 3]]
        at += 4
        if kind == header.PRODUCT:
            value = a * b
        elif kind == header.SUM:
            value = a + b
        elif kind == header.QUOTIENT:
            value = a / b
        elif kind == header.POWER:
            value = a**b
        elif kind == header.SQRT:
            value = math.sqrt(a)
        elif kind == header.EXP:
            value = math.exp(a)
        elif kind == header.LOG:
            value = math.log(a)
        elif kind == header.SIN:
            value = math.sin(a)
        elif kind == header.COS:
            value = math.cos(a)
        else:
            value = math.tanh(a)
        w[out] = value
    entries, values = ip[header.PLACES] + ip[header.ENTRIES], ip[header.VALUES]
    for k in range(ip[header.ENTRIES]):
        w[values + k] = fp[numbers + k] * w[ip[entries + k]]


@_inner
def _function(w, kind, out, a, b, m):  # noqa: PLR0912
    """Compute one order of a function of a series."""
    if kind == header.POWER:
        c = w[b]
        if m == 0:
            w[out] = w[a] ** c
        else:
            t = 0.0
            for i in range(1, m + 1):
                t += (i * c - (m - i)) * w[a + i] * w[out + m - i]
            w[out + m] = t / (m * w[a])
    elif kind == header.SQRT:
        if m == 0:
            w[out] = math.sqrt(w[a])
        else:
            t = w[a + m]
            for i in range(1, m):
                t -= w[out + i] * w[out + m - i]
            w[out + m] = t / (2.0 * w[out])
    elif kind == header.EXP:
        if m == 0:
            w[out] = math.exp(w[a])
        else:
            t = 0.0
            for i in range(1, m + 1):
                t += i * w[a + i] * w[out + m - i]
            w[out + m] = t / m
    elif kind == header.LOG:
        if m == 0:
            w[out] = math.log(w[a])
        else:
            t = 0.0
            for i in range(1, m):
                t += i * w[out + i] * w[a + m - i]
            w[out + m] = (w[a + m] - t / m) / w[a]
    elif kind == header.SIN:
        if m == 0:
            w[out], w[out + LENGTH] = math.sin(w[a]), math.cos(w[a])
        else:
            t, u = 0.0, 0.0
            for i in range(1, m + 1):
                t += i * w[a + i] * w[out + LENGTH + m - i]
                u -= i * w[a + i] * w[out + m - i]
            w[out + m], w[out + LENGTH + m] = t / m, u / m
    else:
        if m == 0:
            w[out] = math.tanh(w[a])
        else:
            t = 0.0
            for i in range(1, m + 1):
                t += i * w[a + i] * w[out + LENGTH + m - i]
            w[out + m] = t / m
        t = 1.0 if m == 0 else 0.0
        for i in range(m + 1):
            t -= w[out + i] * w[out + m - i]
        w[out + LENGTH + m] = t


@_inner
def _operate(ip, w, s, begin, end, m):
    """Compute one order of the operations other than linear combinations."""
    for at in range(begin, end, 4):
        kind, out, a, b = ip[at], s + ip[at + 1], s + ip[at + 2], ip[at + 3]
        if kind == header.PRODUCT:
            b = s + b + m
            t = 0.0
            for i in range(m + 1):
                t += w[a + i] * w[b - i]
            w[out + m] = t
        elif kind == header.QUOTIENT:
            b = s + b
            t = w[a + m]
            for i in range(1, m + 1):
                t -= w[b + i] * w[out + m - i]
            w[out + m] = t / w[b]
        else:
            _function(w, kind, out, a, b, m)


@_inner
def _order(ip, w, m):
    """Compute one order of all slots but the state, the angle and the waves."""
    s, values, places = ip[header.SERIES], ip[header.VALUES], ip[header.PLACES]
    for block in range(ip[header.BLOCKS], ip[header.BLOCKS] + 3 * ip[header.BLOCK_COUNT], 3):
        begin, end = ip[block + 1], ip[block + 2]
        if ip[block]:
            _operate(ip, w, s, begin, end, m)
            continue
        for row in range(begin, end, 4):
            k, end, t = ip[row + 1], ip[row + 2], 0.0
            if k < end:  # most have one entry only
                t = w[values + k] * w[s + ip[places + k] + m]
                k += 1
            while k < end:
                t += w[values + k] * w[s + ip[places + k] + m]
                k += 1
            if m == 0:
                for k in range(ip[row + 2], ip[row + 3]):
                    t += w[values + k]
            w[s + ip[row] + m] = t


@_inner
def _series(ip, fp, w, state, time):
    """Compute the series of all slots from a state."""
    size, states, columns = ip[header.SIZE], ip[header.STATES], ip[header.COLUMNS]
    s = ip[header.SERIES]
    for i in range(size):
        w[s + i * LENGTH] = state[i]
    for i in range(size, states):
        w[s + i * LENGTH] = state[i + columns * size]
    if ip[header.ANGLE] >= 0:
        at = s + ip[header.ANGLE]
        for m in range(LENGTH):
            w[at + m] = 0.0
        w[at], w[at + 1] = time, 1.0
    orders = ip[header.NUMBERS] + ip[header.ENTRIES]
    for k in range(ip[header.WAVE_COUNT]):  # each cosine, with its sine in the next slot
        at, order = s + ip[ip[header.WAVES] + k], fp[orders + k]
        cosine, sine = math.cos(order * time), math.sin(order * time)
        for m in range(LENGTH):
            w[at + m], w[at + LENGTH + m] = cosine, sine
            cosine, sine = -sine * order / (m + 1), cosine * order / (m + 1)
    rates = ip[header.RATES]
    for m in range(ORDER):
        _order(ip, w, m)
        share = 1.0 / (m + 1)
        for i in range(states):
            w[s + i * LENGTH + m + 1] = w[ip[rates + 2 * i + 1]] * w[s + ip[rates + 2 * i] + m] * share
    if ip[header.EVENT_COUNT]:  # their functions are needed as accurately as the state
        _order(ip, w, ORDER)


@_inner
def _lane_blocks(ip, w, state, block):
    """Compute the series of eight columns."""
    size, columns, slots = ip[header.SIZE], ip[header.COLUMNS], ip[header.SERIES]
    base, aside = ip[header.LANE_STATES] + block * size * WIDE, ip[header.LANE_SERIES]
    values, places, rates, counts = ip[header.VALUES], ip[header.PLACES], ip[header.LANE_RATES], ip[header.COUNTS]
    first = LANES * block
    for i in range(size):
        for p in range(LANES):
            column = first + p
            w[base + i * WIDE + p] = state[size * (1 + column) + i] if column < columns else 0.0
    forced, last = ip[ip[header.FORCED] + block], ip[ip[header.FORCED] + block + 1]
    for m in range(ORDER):
        order = m * LANES
        share = 1.0 / (m + 1)
        for at in range(ip[header.LANE_BLOCKS], ip[header.LANE_BLOCKS] + 3 * ip[header.LANE_BLOCK_COUNT], 3):
            begin, end = ip[at + 1], ip[at + 2]
            if ip[at]:
                for row in range(begin, end, 4):
                    factor = ip[row + 2]
                    count, series = min(int(w[counts + factor]), m + 1), slots + ip[ip[header.FACTORS] + factor]
                    out = aside + ip[row + 1] + order
                    _lane_product(w, out, series, ip[row + 3], base + order, aside + order, count)
            else:
                for row in range(begin, end, 4):
                    out = aside + ip[row] + order
                    _lane_row(w, ip, out, values, places, ip[row + 1], ip[row + 2], base + order, aside + order)
        for i in range(size):
            factor, out = w[ip[rates + 2 * i + 1]] * share, base + i * WIDE + order + LANES
            _lane_rate(w, out, factor, ip[rates + 2 * i], base + order, aside + order)
        for at in range(forced, last, 2):
            w[base + ip[at] + order + LANES] += w[slots + ip[at + 1] + m] * share


@_inner
def _step(size, before, last):
    """Length of a step, from the size of a motion and those of its last two orders."""
    size, growth = math.log(max(size, 1.0)), -1e300
    if before > 0.0:
        growth = (math.log(before) - size) / (ORDER - 1)
    if last > 0.0:
        growth = max(growth, (math.log(last) - size) / ORDER)
    if growth == -1e300:
        return math.inf
    return math.exp(-growth - 2.0 - 0.7 / (ORDER - 1))


@_inner
def _scalar_step(ip, w):
    """Length of the step of the state and its events; not finite if a series is not."""
    s, size, before, last = ip[header.SERIES], 0.0, 0.0, 0.0
    wrong = False
    for i in range(ip[header.STATES]):
        at = s + i * LENGTH
        wrong |= not math.isfinite(w[at + ORDER])
        size, before, last = max(size, abs(w[at])), max(before, abs(w[at + ORDER - 1])), max(last, abs(w[at + ORDER]))
    for k in range(ip[header.EVENT_COUNT]):
        at = s + ip[ip[header.EVENTS] + k]
        wrong |= not math.isfinite(w[at + ORDER])
        size, before, last = max(size, abs(w[at])), max(before, abs(w[at + ORDER - 1])), max(last, abs(w[at + ORDER]))
    return math.nan if wrong else _step(size, before, last)


@_inner
def _lane_step(ip, w, block):
    """Length of the step of eight columns."""
    base, count = ip[header.LANE_STATES] + block * ip[header.SIZE] * WIDE, ip[header.SIZE]
    size, before = _lane_size(w, base, count), _lane_size(w, base + (ORDER - 1) * LANES, count)
    last = _lane_size(w, base + ORDER * LANES, count)
    if not (math.isfinite(size) and math.isfinite(before) and math.isfinite(last)):
        return math.nan
    return _step(size, before, last)


@_inner
def _value(w, c, x):
    """Value of a polynomial."""
    p = w[c + ORDER]
    for k in range(ORDER - 1, -1, -1):
        p = p * x + w[c + k]
    return p


@_inner
def _zero_in(w, c, low, high, sign, end):
    """Zero of a polynomial between places where it has a sign and the other one, by Newton's method."""
    x = 0.5 * (low + high)
    for _ in range(80):
        p, d = w[c + ORDER], 0.0
        for k in range(ORDER - 1, -1, -1):
            d = d * x + p
            p = p * x + w[c + k]
        if p != 0.0 and (p > 0.0) == (sign > 0.0):
            low = x
        else:
            high = x
        found = x - (p / d if d != 0.0 else math.inf)
        if not (low <= found <= high):
            found = 0.5 * (low + high)
        near = abs(found - x) <= 2e-16 * end
        x = found
        if near:
            break
    return x


@_inner
def _first_zero(w, c, begin, end):
    """First place in [begin, end] where a polynomial vanishes, and its sign from there on; -1 if there is none."""
    reach = 0.0
    for k in range(ORDER, 0, -1):
        reach = (reach + abs(w[c + k])) * end
    if abs(w[c]) > reach:
        return -1.0, 0.0
    sign = _value(w, c, begin) if begin > 0.0 else w[c]
    k = 1
    while sign == 0.0 and k <= ORDER:
        sign = w[c + k]
        k += 1
    if sign == 0.0:
        return -1.0, 0.0
    if begin == 0.0 and w[c] == 0.0:
        return 0.0, 1.0 if sign > 0.0 else -1.0
    a, width, depth = begin, end - begin, 0
    while True:
        radius = 0.5 * width
        middle = a + radius
        # the bound of the second derivative is that of this interval: near a zero of high order it is small
        p, d, bend, b = w[c + ORDER], 0.0, 0.0, a + width
        for k in range(ORDER - 1, -1, -1):
            d = d * middle + p
            p = p * middle + w[c + k]
        for k in range(ORDER, 1, -1):
            bend = bend * b + k * (k - 1) * abs(w[c + k])
        if abs(p) <= abs(d) * radius + 0.5 * bend * radius * radius:
            if abs(d) <= bend * radius and depth < 44:
                width = radius
                depth += 1
                continue
            y = _value(w, c, b)
            if (y > 0.0) != (sign > 0.0) if y != 0.0 else b >= end:
                return _zero_in(w, c, a, b, sign, end), -1.0 if sign > 0.0 else 1.0
        # the next interval of the same width, or wider ones again
        a += width
        if a >= end:
            return -1.0, 0.0
        if depth > 0:
            width *= 2.0
            depth -= 1
        width = min(width, end - a)


@_inner
def _carry(ip, w, h, out):
    """State after a time since the step began."""
    size, states, columns, s = ip[header.SIZE], ip[header.STATES], ip[header.COLUMNS], ip[header.SERIES]
    for i in range(states):
        at = s + i * LENGTH
        x = w[at + ORDER]
        for k in range(ORDER - 1, -1, -1):
            x = x * h + w[at + k]
        out[i if i < size else i + columns * size] = x
    for block in range((columns + LANES - 1) // LANES):
        base = ip[header.LANE_STATES] + block * size * WIDE
        count = min(LANES, columns - block * LANES)
        for i in range(size):
            at = base + i * WIDE
            _lane_sum(w, ip[header.LANE_SERIES], at, h)
            for p in range(count):
                out[size * (1 + block * LANES + p) + i] = w[ip[header.LANE_SERIES] + p]


@_inner
def _shifted(pointer, count):
    """Pointer some numbers further on."""
    return _floats(_address(pointer) + 8 * count)


@intrinsic
def _address(typing: Any, pointer: Any) -> Any:
    """Address of a pointer."""

    def make(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.ptrtoint(arguments[0], ir.IntType(64))

    return types.int64(pointer), make


@_inner
def _first_event(ip, w, time, h):
    """Time to the first event of a step, which ends it; its number, and the sign of its function from there on."""
    s, cool, event, direction = ip[header.SERIES], ip[header.COOL], -1, 0.0
    for k in range(ip[header.EVENT_COUNT]):
        begin = max(0.0, w[cool + k] - time)
        if begin < h:
            found, sign = _first_zero(w, s + ip[ip[header.EVENTS] + k], begin, h)
            if found >= 0.0 and (event < 0 or found < h):
                h, event, direction = found, k, sign
    return h, event, direction


@_inner
def _turns(ip, w, io, turns, time, h):
    """Note the zeros of the functions that do not stop the motion, with the positions there."""
    size, s = ip[header.SIZE], ip[header.SERIES]
    for k in range(ip[header.TURN_COUNT]):
        at, begin = s + ip[ip[header.TURNS] + k], 0.0
        for _ in range(_MOST_ZEROS):
            found, _ = _first_zero(w, at, begin, h)
            if found < 0.0:
                break
            place = int(io[header.IO_TURNS]) * (2 + size)
            turns[place], turns[place + 1] = float(k), time + found
            for i in range(size):
                x = w[s + i * LENGTH + ORDER]
                for j in range(ORDER - 1, -1, -1):
                    x = x * found + w[s + i * LENGTH + j]
                turns[place + 2 + i] = x
            io[header.IO_TURNS] += 1.0
            begin = found + 1e-9 * h
            if begin >= h:
                break


@_inner
def _lengths(ip, w):
    """Count the orders of the factors of columns that are not zero."""
    s, counts = ip[header.SERIES], ip[header.COUNTS]
    for k in range(ip[header.FACTOR_COUNT]):
        at, count = s + ip[ip[header.FACTORS] + k], ORDER
        while count > 0 and w[at + count - 1] == 0.0:
            count -= 1
        w[counts + k] = float(count)


def advance(table: Any) -> None:
    """Integrate from event to event; `table` has the addresses of all arrays."""
    ip, fp, w = _integers(table[0]), _floats(table[1]), _floats(table[2])
    state, pars, io = _floats(table[3]), _floats(table[4]), _floats(table[5])
    grid, rows, turns = _floats(table[6]), _floats(table[7]), _floats(table[8])
    size, states, columns = ip[header.SIZE], ip[header.STATES], ip[header.COLUMNS]
    blocks, whole = (columns + LANES - 1) // LANES, states + columns * size
    time, rest, stop = io[header.IO_TIME], io[header.IO_REST], io[header.IO_STOP]
    _constants(ip, fp, w, pars)
    status, io[header.IO_TAKEN] = header.REACHED, 0.0
    while True:
        _series(ip, fp, w, state, time)
        h = _scalar_step(ip, w)
        if not (h > 0.0):
            status = header.NOT_FINITE
            break
        if io[header.IO_ONLY] > 0.0:
            break
        if columns:
            _lengths(ip, w)
            for block in range(blocks):
                _lane_blocks(ip, w, state, block)
                h = min(h, _lane_step(ip, w, block))
            if not (h > 0.0):
                status = header.NOT_FINITE
                break
        h = min(h, io[header.IO_LONGEST])
        left = (stop - time) - rest
        ends = h >= left
        if ends:
            h = left
        if h <= 0.0:
            break
        h, event, direction = _first_event(ip, w, time, h)
        ends = ends and event < 0
        # not before the next call, so that all of a step fit
        if (
            ip[header.TURN_COUNT]
            and io[header.IO_TURNS] + _MOST_ZEROS * ip[header.TURN_COUNT] > io[header.IO_MOST_TURNS]
        ):
            status = header.MANY_TURNS
            break
        _turns(ip, w, io, turns, time, h)
        now = stop if ends else time + (h + rest)
        while io[header.IO_GRID] < io[header.IO_GRID_COUNT] and grid[int(io[header.IO_GRID])] <= now:
            place = int(io[header.IO_GRID])
            _carry(ip, w, (grid[place] - time) - rest, _shifted(rows, place * whole))
            io[header.IO_GRID] += 1.0
        _carry(ip, w, h, state)
        if ends:
            time, rest = stop, 0.0
        else:
            rest = (h + rest) - (now - time)
            time = now
        io[header.IO_TAKEN] += 1.0
        io[header.IO_STEPS] -= 1.0
        if event >= 0:
            w[ip[header.COOL] + event] = time + 1e-9
            status, io[header.IO_EVENT], io[header.IO_DIRECTION] = header.EVENT, float(event), direction
            break
        if ends:
            break
        if io[header.IO_STEPS] <= 0.0:
            status = header.MANY_STEPS
            break
    io[header.IO_TIME], io[header.IO_REST], io[header.IO_STATUS] = time, rest, float(status)


def evaluate(table: Any) -> None:
    """Compute outputs for many states, whose numbers are in rows."""
    ip, fp, w = _integers(table[0]), _floats(table[1]), _floats(table[2])
    given, pars, io, found = _floats(table[3]), _floats(table[4]), _floats(table[5]), _floats(table[7])
    count, s = int(io[header.IO_GRID_COUNT]), ip[header.SERIES]
    _constants(ip, fp, w, pars)
    for k in range(count):
        for i in range(ip[header.STATES]):
            w[s + i * LENGTH] = given[i * count + k]
        _order(ip, w, 0)
        for i in range(ip[header.OUTPUT_COUNT]):
            found[i * count + k] = w[s + ip[ip[header.OUTPUTS] + i]]


def compiled() -> dict[str, tuple[str, str]]:
    """Return the names of both functions in LLVM's language, and the text of their modules."""
    found = {}
    for function in (advance, evaluate):
        options = {**_OPTIONS, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        made = numba.njit(types.void(types.CPointer(types.int64)), **options)(function)
        (result,) = made.overloads.values()
        # eight columns in one register where there are such
        text = re.sub(r"(attributes #\d+ = \{)", rf"\1 {_WHOLE}", result.library.get_llvm_str())
        found[function.__name__] = result.fndesc.llvm_func_name, text
    return found

"""Sizes and places on which the compiled kernel and its programs agree: plain numbers, which Numba knows."""

from __future__ import annotations

ORDER = 20
"""Order of all series."""
LENGTH = ORDER + 1
"""Numbers of a series."""
LANES = 8
"""Columns that run together."""
WIDE = LENGTH * LANES
"""Numbers of a series of columns."""

# Places in the header of a program, which is followed by its lists within the same array.
#
# Numbers of the state (SIZE), and of what else is integrated with it without columns (STATES); constants are
# parameters, numbers, and what is computed from them by STEPS. A linear combination is a row of entries.
(
    SIZE,
    STATES,
    COLUMNS,
    PARAMETERS,
    NUMBERS,
    ENTRIES,
    BLOCKS,
    BLOCK_COUNT,
    ROWS,
    PLACES,
    RATES,
    STEPS,
    STEP_COUNT,
    LANE_BLOCKS,
    LANE_BLOCK_COUNT,
    LANE_RATES,
    FORCED,
    FACTORS,
    FACTOR_COUNT,
    EVENTS,
    EVENT_COUNT,
    TURNS,
    TURN_COUNT,
    WAVES,
    WAVE_COUNT,
    ANGLE,  # the series of the angle, or -1
    OUTPUTS,
    OUTPUT_COUNT,
    # where parts of the memory begin
    VALUES,
    SERIES,
    LANE_SERIES,
    LANE_STATES,
    COOL,
    COUNTS,
) = range(34)
HEAD = 34
"""Numbers of the header."""

# What a call is given, and what it returns.
(
    IO_TIME,
    IO_REST,  # of the time, below its rounding
    IO_STOP,
    IO_LONGEST,
    IO_STEPS,  # that are left
    IO_STATUS,
    IO_EVENT,
    IO_DIRECTION,
    IO_GRID,  # number of the next angle
    IO_GRID_COUNT,
    IO_TURNS,
    IO_MOST_TURNS,
    IO_TAKEN,
    IO_ONLY,  # 1: series only
) = range(14)
IO = 14
"""Numbers of these."""

# Why a call returned.
REACHED, EVENT, MANY_STEPS, NOT_FINITE, MANY_TURNS = range(5)

# Operations on series, and on constants. The slot after a sine is its cosine, that after tanh is 1 - tanh^2.
PRODUCT, QUOTIENT, POWER, SQRT, EXP, LOG, SIN, TANH, SUM, COS = range(10)

"""The frame of a kernel: the loops around the lines for one step of one lane."""

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
                size = 0.0
                for j in range({size}):
                    size = size if abs(S[j * {lanes} + l]) < size else abs(S[j * {lanes} + l])
                if size <= limit:
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

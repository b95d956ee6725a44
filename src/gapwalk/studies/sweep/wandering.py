"""What the motions of a sweep are that do not repeat: quasi-periodic, chaotic, or locked to a long period."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.batch_motions import BatchMotions, motions_of
from gapwalk.attractors.exact_recheck import settle_doubts
from gapwalk.attractors.regime import regime_word
from gapwalk.attractors.regime_judge import RegimeOptions, judge
from gapwalk.model.system import System
from gapwalk.studies.sweep.regime import NOT_PERIODIC

_RETURNS = 64  # forcing periods in which a motion may still become periodic: it has settled already


def wandering_words(
    system: System, parameter: str, values: NDArray[np.float64], states: NDArray[np.float64], max_period: int
) -> Sequence[str]:
    """What motions are, in words, all of them judged side by side as those of a regime map are.

    Parameters
    ----------
    system
        The system; its own value of the parameter plays no role.
    parameter
        Name of the parameter.
    values : shape (count,)
        Its values, one for each motion.
    states : shape (count, 2n)
        Where the motions are, at theta = 0.
    max_period
        Longest period, in forcing periods, that was looked for.

    Returns
    -------
    list of str
        ``quasi-periodic``, ``chaotic``, ``period 18``, ...; ``not periodic``, which says less, where the batch
        integrator cannot follow the system: the exact flow would take minutes for each motion of a large one.
    """
    if not len(values):
        return []
    motions = motions_of(system, states, {parameter: values})
    if not isinstance(motions, BatchMotions):
        return [NOT_PERIODIC] * len(values)
    systems = [partial(system.at, {parameter: value}) for value in values.tolist()]
    frequencies = np.array([system().frequency for system in systems])
    options = RegimeOptions(longest=_RETURNS, max_period=max_period, forces=False)
    found = settle_doubts(judge(motions, states, frequencies, options), systems)
    return [regime_word(*pair) for pair in zip(found.regimes.tolist(), found.periods.tolist(), strict=True)]

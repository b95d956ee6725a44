"""Blocks of trajectories: the data of the kernel, advanced over forcing periods by several threads."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gapwalk.ensemble.batch_run import BatchSurvey
from gapwalk.ensemble.first_steps import history_of
from gapwalk.ensemble.kernel import Kernel, kernel_of
from gapwalk.ensemble.kernel_form import Form
from gapwalk.ensemble.kernel_frame import LANES
from gapwalk.ensemble.scheme import Linear, Scheme, scheme_of

LIMIT = 1e12
"""Size of a state above which a motion has diverged, as in the exact flow."""


@dataclass(frozen=True)
class BlockPlan:
    """Systems of equal structure and the number of steps for their trajectories: the input of a kernel.

    Parameters
    ----------
    linear
        The systems: one for each trajectory, or one for all.
    pattern
        Coefficients that may differ from zero.
    steps
        Number of steps per forcing period.
    """

    linear: Linear
    pattern: bytes
    steps: int

    @property
    def shared(self) -> bool:
        """True if all trajectories have the same coefficients."""
        return len(self.linear.coefficients) == 1

    def kernel(self, survey: bool) -> Kernel:
        """Return the kernel for these systems."""
        structure = self.linear.layout.structure
        return kernel_of(Form(structure, self.pattern, self.linear.basis is not None, self.shared, survey))

    @cached_property
    def scheme(self) -> Scheme:
        """The matrices and weights of one step."""
        return scheme_of(self.linear, self.steps)

    def some(self, lanes: NDArray[np.intp]) -> BlockPlan:
        """Select the systems of some trajectories; the steps are reused, not computed again."""
        part = BlockPlan(self.linear.some(lanes), self.pattern, self.steps)
        part.__dict__["scheme"] = self.scheme.some(lanes)
        return part


class Blocks:
    """Trajectories in blocks of lanes; the last block is padded with copies.

    Parameters
    ----------
    block_plan
        The systems and the steps.
    states : shape (N, 2n)
        States of the trajectories at theta = 0.
    noted, every
        Number of times at which the states are recorded, and forcing periods between them.
    survey
        True if a survey will be requested.
    threads
        Number of blocks that are processed at the same time.
    """

    def __init__(
        self, block_plan: BlockPlan, states: NDArray[np.float64], noted: int, every: int, survey: bool, threads: int
    ) -> None:
        self.block_plan, self.count, self.threads = block_plan, len(states), threads
        self._size, self._every, self._first, self._surveys = states.shape[1], every, 0, False
        self._lanes = np.minimum(np.arange(-(-self.count // LANES) * LANES), self.count - 1)
        number = len(self._lanes) // LANES
        height = max(block_plan.kernel(kind).source.height for kind in {False, survey})
        self._data = np.zeros((number, height, LANES))
        basis = block_plan.linear.basis
        modal = states if basis is None else np.linalg.solve(basis, states[:, :, None])[:, :, 0]
        forces = history_of(block_plan.linear, states, block_plan.steps)
        self._data[:, : self._size] = self._in_blocks(modal.T)
        self._data[:, self._size : self._size + forces[:, :, 0].size] = self._in_blocks(forces.reshape(-1, self.count))
        self._record = np.full((number, noted, self._size, LANES), np.nan)
        self._left = np.full((number, LANES), -1, dtype=np.int64)
        self._last = self._data[:, : self._size].copy()
        self._stop = np.zeros(1, dtype=np.int64)

    @property
    def states(self) -> NDArray[np.float64]:
        """The present states of the trajectories, shape (N, 2n); NaN for those that diverged."""
        return self._physical(self._data[:, : self._size])

    @property
    def strobes(self) -> NDArray[np.float64] | None:
        """The recorded states, shape (noted, N, 2n)."""
        if not self._every:
            return None
        noted = [self._physical(self._record[:, row]) for row in range(self._record.shape[1])]
        return np.array(noted).reshape(len(noted), self.count, self._size)

    @property
    def left(self) -> NDArray[np.int64]:
        """The forcing period in which each trajectory diverged, or -1."""
        return self._left.reshape(-1)[: self.count]

    @property
    def last(self) -> NDArray[np.float64]:
        """State of each trajectory at the start of the last forcing period in which it had not diverged."""
        return self._physical(self._last)

    def begin_survey(self) -> None:
        """Start recording extremes, contacts and largest forces."""
        self._surveys = True
        rows = self.block_plan.kernel(True).source.tally_rows
        self._data[:, rows["low"] : rows["end"]] = 0.0
        self._data[:, rows["low"] : rows["high"]] = np.inf
        self._data[:, rows["high"] : rows["peak"]] = -np.inf

    def survey(self, periods: int) -> BatchSurvey:
        """Return the record of the survey, which began that many forcing periods ago."""
        source = self.block_plan.kernel(True).source
        values = self._data.transpose(0, 2, 1).reshape(-1, source.height)[: self.count].copy()
        values[self.left >= 0] = np.nan
        rows = source.tally_rows
        low, high, peak, contacts = (values[:, first:stop] for first, stop in pairwise(rows.values()))
        return BatchSurvey(periods, low, high, peak, contacts.reshape(self.count, -1, 2) / periods)

    def advance(self, periods: int) -> None:
        """Advance all trajectories over some forcing periods."""
        kernel = self.block_plan.kernel(self._surveys)
        numbers = kernel.source.numbers(self.block_plan.scheme, self.block_plan.linear)
        times = kernel.source.times(self.block_plan.scheme, self.block_plan.steps).ravel()

        def work(block: int) -> None:
            lanes = slice(None) if self.block_plan.shared else self._lanes[block * LANES : (block + 1) * LANES]
            own = np.ascontiguousarray(numbers[:, lanes]).ravel()
            kernel.advance(
                self._data[block].reshape(-1), own, times, self._first, periods, self.block_plan.steps, self._every,
                self._record[block], self._left[block], self._last[block], LIMIT, self._stop,
            )  # fmt: skip

        self._share_out(work)
        self._first += periods

    def _share_out(self, work: Callable[[int], None]) -> None:
        """Process all blocks, several at a time. Ctrl-C stops them within a forcing period."""
        with ThreadPoolExecutor(min(self.threads, len(self._data))) as pool:
            try:
                list(pool.map(work, range(len(self._data))))
            except BaseException:
                self._stop[0] = 1
                raise

    def _in_blocks(self, rows: NDArray) -> NDArray[np.float64]:
        """Arrange rows of N numbers in blocks, shape (blocks, rows, LANES)."""
        return rows[:, self._lanes].reshape(len(rows), len(self._lanes) // LANES, LANES).transpose(1, 0, 2)

    def _physical(self, blocks: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the states in the user's coordinates, shape (N, 2n), from blocks of shape (blocks, 2n, LANES)."""
        states = blocks.transpose(0, 2, 1).reshape(-1, self._size)[: self.count]
        basis = self.block_plan.linear.basis
        return states.copy() if basis is None else (basis @ states[:, :, None])[:, :, 0]

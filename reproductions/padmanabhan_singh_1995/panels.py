"""The kinds of panels: what each shows of the results of jobs, and how it is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.jobs import MEASURE
from reproductions.padmanabhan_singh_1995.quantities import LOOPS, aligned_with_record, attractor_of, orbit_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Picture

Shown = Sequence[Sequence[gw.Result]]
"""For each panel of a figure the results of its jobs."""


@dataclass(frozen=True, kw_only=True)
class Panel:
    """A panel of a figure; the panels of one figure fill a sheet together.

    Parameters
    ----------
    title
        What it shows, in a few words.
    jobs
        Keys of the jobs whose results it shows.
    letter
        Its letter in the paper; empty for a panel that the paper does not have.
    within
        Range of the parameter; None for all of it.
    """

    title: str
    jobs: tuple[str, ...]
    letter: str = ""
    within: tuple[float, float] | None = None

    view: ClassVar[str]
    """What documents call the kind of panel."""

    @staticmethod
    def size(count: int, columns: int) -> tuple[float, float]:
        """Return width and height in inches of a sheet with so many panels."""
        raise NotImplementedError

    @staticmethod
    def fill(picture: Picture, panels: Sequence[Panel], shown: Shown, columns: int) -> None:
        """Draw all panels of a figure."""
        raise NotImplementedError


_TWO_ROWS, _ROW = 8, 11.0  # entries in two rows of a legend; points by which a third one raises the title


class AxesPanel(Panel):
    """A panel that is one pair of axes; such panels stand in rows and columns."""

    above: ClassVar[float | None] = 31.0
    """Height of its title above the axes in points: the legend is between them. None: the legend is inside."""

    @staticmethod
    def size(count: int, columns: int) -> tuple[float, float]:
        """Return width and height in inches of a sheet with so many panels."""
        return {1: 8.0, 2: 7.2}[columns] * columns, 4.3 * -(-count // columns)

    @staticmethod
    def fill(picture: Picture, panels: Sequence[Panel], shown: Shown, columns: int) -> None:
        """Draw the panels row by row."""
        grid = picture.subplots(-(-len(panels) // columns), columns, squeeze=False)
        for ax, panel, results in zip(grid.flat, panels, shown, strict=False):
            assert isinstance(panel, AxesPanel)
            panel.draw(ax, results)
            title = f"{panel.letter}  {panel.title}".strip()
            ax.set_title(title, fontsize="small", weight="bold", pad=panel._height(ax))

    def _height(self, ax: Axes) -> float | None:
        """Height of the title in points: above a legend of two rows, or of three."""
        legend = ax.get_legend()
        has_three = self.above is not None and legend is not None and len(legend.get_texts()) > _TWO_ROWS
        return self.above + _ROW if has_three and self.above is not None else self.above

    def draw(self, ax: Axes, results: Sequence[gw.Result]) -> None:
        """Draw the results of its jobs."""
        raise NotImplementedError


class Response(AxesPanel):
    """A measure of the motions of period 1 over the parameter, with their stability."""

    view = "response"

    def draw(self, ax: Axes, results: Sequence[gw.Result]) -> None:
        """Draw the branches; where special points crowd in the whole range, a close-up."""
        whole = self.within is None
        branches = _shortest(results[0])
        gw.plot.draw(branches, MEASURE, ax=ax, legend="above", closeup=whole, within=self.within)


class Balance(Response):
    """The response by shooting, and points by harmonic balance."""

    view = "balance"

    def draw(self, ax: Axes, results: Sequence[gw.Result]) -> None:
        """Draw the branches of the first result, and points of the second, spread evenly along the branch."""
        from matplotlib.legend import Legend
        from matplotlib.lines import Line2D

        shot, balanced = results
        gw.plot.draw(_shortest(shot), MEASURE, ax=ax, labels=False, legend="above")
        other = balanced.branches[0]
        style = {
            "ls": "none",
            "marker": "o",
            "markersize": 4.2,
            "markerfacecolor": "none",
            "markeredgecolor": "#009E73",
        }
        ax.plot(other.values, other.measure(MEASURE), markevery=0.03, zorder=6, **style)
        # Another legend than the one above the axes, which has to stay theirs: the layout leaves room for it.
        ax.add_artist(Legend(ax, [Line2D([], [], **style)], ["harmonic balance"], loc="upper right"))


class Loops(AxesPanel):
    """q1(0) of all motions, once every forcing period: the loops of periods 2 and 4."""

    view = "loops"

    def draw(self, ax: Axes, results: Sequence[gw.Result]) -> None:
        """Draw the states of all branches, and their names."""
        assert results[0].diagram is not None
        gw.plot.draw(results[0].diagram, "q1", ax=ax, within=self.within)


@dataclass(frozen=True, kw_only=True)
class Overlay(AxesPanel):
    """The motions of period 1 of several jobs, which have the names of the legend."""

    names: tuple[str, ...]

    view = "overlay"
    above = None

    def draw(self, ax: Axes, results: Sequence[gw.Result]) -> None:
        """Draw the branches of each result by a line of its own."""
        branches = {name: _shortest(result) for name, result in zip(self.names, results, strict=True)}
        gw.plot.overlay(branches, MEASURE, ax=ax, within=self.within)


@dataclass(frozen=True, kw_only=True)
class Hysteresis(AxesPanel):
    """The loop of a contact's force under a harmonic deflection, in closed form: it rests on no job."""

    law: str

    view = "hysteresis"
    above = None

    def draw(self, ax: Axes, results: Sequence[gw.Result]) -> None:
        """Draw the loop of its damping law."""
        gw.plot.draw([LOOPS[self.law]], [self.law], ax=ax)


class Motion(Panel):
    """A settled motion: time history, spectrum, section, and the loop of the contact force. It fills the sheet."""

    view = "motion"

    @staticmethod
    def size(count: int, columns: int) -> tuple[float, float]:
        """Return width and height in inches."""
        return 9.0, 5.8

    @staticmethod
    def fill(picture: Picture, panels: Sequence[Panel], shown: Shown, columns: int) -> None:
        """Draw the motion."""
        (((result,),),) = (shown,)
        assert isinstance(result.options, gw.studies.SettleStudyOptions)
        title = picture.get_suptitle()
        gw.plot.draw(attractor_of(result), result.options.signal, title=title, figure=picture)


@dataclass(frozen=True, kw_only=True)
class Contrast(Panel):
    """A signal of two motions, over each other in time and as lines of their spectra.

    All panels of a figure show the same two motions, each another signal.
    """

    names: tuple[str, str]
    signal: str

    view = "contrast"

    @staticmethod
    def size(count: int, columns: int) -> tuple[float, float]:
        """Return width and height in inches, with title and legend."""
        return 9.5, 2.9 * count + 0.5

    @staticmethod
    def fill(picture: Picture, panels: Sequence[Panel], shown: Shown, columns: int) -> None:
        """Draw a row for each signal."""
        first, second = (orbit_of(result) for result in shown[0])
        rows = [panel for panel in panels if isinstance(panel, Contrast)]
        found = gw.analysis.contrast(first, second, [row.signal for row in rows], names=rows[0].names)
        gw.plot.draw(found, title=picture.get_suptitle(), figure=picture)


class Record(Panel):
    """The acceleration of the third inertia: of a motion, and a record of another one."""

    view = "record"

    @staticmethod
    def size(count: int, columns: int) -> tuple[float, float]:
        """Return width and height in inches."""
        return 9.5, 6.0 * count

    @staticmethod
    def fill(picture: Picture, panels: Sequence[Panel], shown: Shown, columns: int) -> None:
        """Draw the motions below each other, each over the record."""
        parts = picture.subfigures(len(panels), 1, squeeze=False)[:, 0]
        for part, panel, results in zip(parts, panels, shown, strict=True):
            gw.plot.draw(aligned_with_record(*results), title=panel.title, figure=part)


def _shortest(result: gw.Result) -> list[gw.Branch]:
    """Return the branches of the shortest period."""
    shortest = min(branch.period for branch in result.branches)
    return [branch for branch in result.branches if branch.period == shortest]

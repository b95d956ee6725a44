"""The kinds of panels: what each shows of the results of jobs, and how it is drawn, with what the paper says of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.jobs import MEASURE, Reading
from reproductions.padmanabhan_singh_1995.quantities import (
    IMPACT,
    LOOPS,
    VISCOUS,
    attractor_of,
    highest,
    main_branch,
    third_inertia,
)
from reproductions.padmanabhan_singh_1995.tables import consistent_machine

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Picture

Within = tuple[float, float]

_PAPER = "#8e3b8e"  # what the paper says, which nothing else has
_COLOURS = {VISCOUS: "#000000", IMPACT: "#882255"}
_OTHERS = ("#000000", "#882255", "#17627d")  # of several curves, as in all pictures
_DASHES = ("-", (0, (9, 2.2)), (0, (9, 2, 1.4, 2)))
PERIODS = {2: ("#7f4a1e", 1.5), 4: ("#b5824f", 1.5)}
"""Colours and widths of stable motions of longer periods, as in all pictures."""
_BALANCED = "#c0006a"  # points by harmonic balance: no colour of stability
_ROW = 0.13  # height of what the paper says above a picture, as a share of the picture
_PERIOD = 2.0 * math.pi

_WORDS = {
    "amplitude of harmonic 1": "excitation amplitude Te1",
    "q1": "q1, twist of the clutch",
    "q1'": "rate of q1",
    "q1''": "acceleration of q1",
    "stage2": "force of the second stage",
    "force of stage2": "force of the second stage",
    "amplitude of q1": "amplitude of q1 per line",
    "amplitude of stage2": "amplitude of the force",
    "deflection": "q1, twist of the clutch",
    "u3''": "acceleration u3'' of the third inertia",
    "q1(0), once every forcing period": "q1 at the beginning of each period",
}
"""The words of the paper for what gapwalk calls by the names in the model."""


@dataclass(frozen=True, slots=True)
class Fact:
    """What the paper says about a place or a range of the axis below."""

    text: str  #: In a few words.
    low: float  #: The place, or where the range begins.
    high: float | None = None  #: Where the range ends.
    #: Whether the numbers are shares of the frequency of the highest peak, or come on top of it.
    of_peak: Literal["", "share", "beyond"] = ""

    def places(self, results: Sequence[gw.Result]) -> tuple[float, float]:
        """Return where it begins and ends on the axis."""
        low, high = self.low, self.low if self.high is None else self.high
        if not self.of_peak:
            return low, high
        peak = highest(main_branch(results[0])).value
        return (low * peak, high * peak) if self.of_peak == "share" else (low + peak, high + peak)


@dataclass(frozen=True, kw_only=True)
class Panel:
    """A panel of a figure: one pair of axes."""

    title: str  #: What it shows, in a few words.
    jobs: tuple[str, ...] = ()  #: Keys of the jobs whose results it shows.
    letter: str = ""  #: Its letter in the paper; empty for a panel that the paper does not have.
    within: Within | None = None  #: Range of the axis below; None for all of it.
    heights: Within | None = None  #: Range of the axis at the left; None: what there is.
    log: bool = False  #: Whether the axis at the left is logarithmic.
    facts: tuple[Fact, ...] = ()  #: What the paper says.
    names: tuple[str, ...] = ()  #: Names of the jobs in a legend; none if there is one.
    reading: Reading | None = (
        None  #: The reading, or the other numbers, at which it is drawn; None: those of the figure.
    )
    at: str = ""  #: Where else it is drawn than at the printed numbers, in words; by default what the reading says.
    size: ClassVar[Within] = (8.0, 4.3)
    """Width and height in inches on a screen."""

    view: ClassVar[str]
    """What documents call the kind of panel."""

    short: ClassVar[bool] = False
    """Whether it shows motions of period 1 alone."""

    @property
    def place(self) -> str:
        """Where it is drawn, in words; empty for the printed numbers."""
        return self.at or (self.reading.differs if self.reading else "")

    def picture(self, results: Sequence[gw.Result]) -> Picture:
        """Draw it on a sheet of its own, as wide as a column of a journal."""
        with gw.plot.sized("column"), gw.plot.figure(*self.size) as sheet:
            ax = sheet.subplots()
            self.draw(ax, results)
            ax.set_xlabel(_WORDS.get(ax.get_xlabel(), ax.get_xlabel()))
            ax.set_ylabel(_WORDS.get(ax.get_ylabel().replace("\n", ", "), ax.get_ylabel()))
            if self.log:
                ax.set_yscale("log")
                ax.yaxis.set_major_formatter("{x:g}")
            if self.heights:
                ax.set_ylim(self.heights)
            if self.within:
                ax.set_xlim(self.within)
            sheet.set_dpi(200)  # on a page, not in print
            _draw_facts(ax, [(fact.text, *fact.places(results)) for fact in self.facts])
        return sheet

    def draw(self, ax: Axes, results: Sequence[gw.Result]) -> None:
        """Draw the results of its jobs."""
        raise NotImplementedError


def _draw_facts(ax: Axes, facts: Sequence[tuple[str, float, float]]) -> None:
    """Draw what the paper says: a bar above the curves for a range, a tick for a place, each with its words."""
    left, right = ax.get_xlim()
    low, high = ax.get_ylim()
    scale = (math.log10, lambda y: 10.0**y) if ax.get_yscale() == "log" else (float, float)
    bottom, top = scale[0](low), scale[0](high)
    rows = _rows([(text, (a - left) / (right - left), (b - left) / (right - left)) for text, a, b in facts])
    height = (top - bottom) * _ROW
    for (text, begin, end), row in zip(facts, rows, strict=True):
        y = scale[1](top + height * (row + 0.3))
        if end > begin:
            ax.axvspan(begin, end, color=_PAPER, alpha=0.09, linewidth=0, zorder=0.4)
            ax.plot([begin, end], [y, y], color=_PAPER, linewidth=3.0, solid_capstyle="butt", zorder=6)
        else:
            ax.axvline(begin, color=_PAPER, linewidth=0.9, linestyle=(0, (5, 2)), zorder=0.6)
            ax.plot([begin], [y], marker="v", markersize=4.0, color=_PAPER, zorder=6)
        middle = (0.5 * (begin + end) - left) / (right - left)
        side = "left" if middle < 0.33 else "right" if middle > 0.67 else "center"
        x = {"left": max(begin, left), "right": min(end, right), "center": 0.5 * (begin + end)}[side]
        _write(ax, text, (x, y), side)
    if facts:
        ax.set_ylim(low, scale[1](top + height * (max(rows) + 1.15)))
        ax.set_xlim(left, right)


def _write(ax: Axes, text: str, place: Within, side: str, above: float = 2.5) -> None:
    """Write words of the paper some points above a place, in its colour."""
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.85}
    style: Any = {"color": _PAPER, "fontsize": "small", "zorder": 7, "bbox": box}
    ax.annotate(text, place, xytext=(0.0, above), textcoords="offset points", ha=side, va="bottom", **style)


def _rows(facts: Sequence[tuple[str, float, float]]) -> list[int]:
    """Return a row for each text, such that no two meet; widths are shares of that of the axes."""
    taken: list[float] = []
    rows = []
    for text, begin, end in facts:
        width = 0.022 * len(text)
        middle = 0.5 * (begin + end)
        start = begin if middle < 0.33 else end - width if middle > 0.67 else middle - 0.5 * width
        row = next((i for i, stop in enumerate(taken) if stop < min(start, begin)), len(taken))
        taken[row : row + 1] = [max(start + width, end) + 0.02]
        rows.append(row)
    return rows


class Response(Panel):
    """A measure of the motions of period 1 over the parameter, with their stability."""

    view = "response"
    short = True

    def draw(self, ax: Axes, results: Sequence[gw.Result]) -> None:
        """Draw the branches."""
        gw.plot.draw(_shortest(results[0]), MEASURE, ax=ax, labels=False, legend=False, within=self.within)


class Through(Response):
    """The branch that was followed first, alone."""

    view = "branch"

    def draw(self, ax: Axes, results: Sequence[gw.Result]) -> None:
        """Draw it."""
        gw.plot.draw([main_branch(results[0])], MEASURE, ax=ax, labels=False, legend=False, within=self.within)


class Isolated(Response):
    """The motions of period 1, with names for the two isolated loops as the paper has them."""

    def draw(self, ax: Axes, results: Sequence[gw.Result]) -> None:
        """Draw the branches; of a loop and its mirror image one has the name."""
        super().draw(ax, results)
        loops = sorted(_shortest(results[0])[1:], key=lambda branch: -float(np.ptp(branch.values)))
        for name, branch in zip(("larger loop", "smaller loop"), loops, strict=False):
            heights, middle = branch.measure(MEASURE), 0.5 * float(branch.values.min() + branch.values.max())
            if name == "larger loop":  # inside, where no other curve is
                inside = heights[np.abs(branch.values - middle) < 0.2 * float(np.ptp(branch.values))]
                _write(ax, name, (middle, 0.5 * float(inside.min() + inside.max())), "center", -5.0)
                continue
            arrow: Any = {"arrowstyle": "-", "color": _PAPER, "linewidth": 0.7, "shrinkA": 0.0, "shrinkB": 0.0}
            low = float(heights.min())
            style: Any = {"color": _PAPER, "fontsize": "small", "ha": "right", "va": "top", "arrowprops": arrow}
            ax.annotate(name, (middle, low), xytext=(0.8, 0.55 * low), **style)


class Balance(Response):
    """The response by shooting, and points by harmonic balance."""

    view = "balance"

    def draw(self, ax: Axes, results: Sequence[gw.Result]) -> None:
        """Draw the branches of the first result, and points of the second, spread evenly along the branch."""
        gw.plot.draw(_shortest(results[0]), MEASURE, ax=ax, labels=False, legend=False)
        other = results[1].branches[0]
        style: Any = {"ls": "none", "marker": "x", "markersize": 3.0, "mec": _BALANCED, "zorder": 6}
        ax.plot(other.values, other.measure(MEASURE), markevery=0.03, label="harmonic balance", **style)
        ax.legend(loc="upper right")


@dataclass(frozen=True, kw_only=True)
class Loops(Panel):
    """q1(0) of all motions, once every forcing period: the loops of periods 2 and 4, by kinds of instability."""

    most: int = 4  #: The longest period that is shown.

    view: ClassVar[str] = "loops"

    def draw(self, ax: Axes, results: Sequence[gw.Result]) -> None:
        """Draw the states of all branches; stars are where pairs leave the unit circle."""
        diagram = results[0].diagram
        assert diagram is not None
        shown = replace(diagram, members=tuple(each for each in diagram.members if each.period <= self.most))
        gw.plot.draw(shown, "q1", ax=ax, within=self.within, legend=False, labels=False, instabilities=True)
        stars: Any = {"marker": "*", "markersize": 8.0, "ls": "none", "mfc": "#009E73", "mec": "black", "mew": 0.5}
        for member in shown.members:
            for special in member.branch.special(gw.Kind.NEIMARK_SACKER) if member.period > 1 else ():
                states = [state[0] for state in special.point.orbit.strobes(member.period)]
                ax.plot([special.value] * len(states), states, zorder=6, scalex=False, scaley=False, **stars)


class Overlay(Panel):
    """The motions of period 1 of several jobs, which have the names of the legend."""

    view = "overlay"
    short = True

    def draw(self, ax: Axes, results: Sequence[gw.Result]) -> None:
        """Draw the branches of each result by a line of its own."""
        branches = {name: _shortest(result) for name, result in zip(self.names, results, strict=True)}
        gw.plot.overlay(branches, MEASURE, ax=ax, within=self.within)
        if legend := ax.get_legend():  # above the curves, on which it would lie inside
            shown = [legend.legend_handles, [text.get_text() for text in legend.get_texts()]]
            ax.legend(*shown, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.1)


@dataclass(frozen=True, kw_only=True)
class Hysteresis(Panel):
    """The loop of a contact's force under a harmonic deflection, in closed form: it rests on no job."""

    law: str

    view: ClassVar[str] = "hysteresis"

    def draw(self, ax: Axes, results: Sequence[gw.Result]) -> None:
        """Draw the loop of its damping law, on the scale of both."""
        gw.plot.draw([LOOPS[self.law]], [self.law], ax=ax)
        ax.legend_ = None
        ax.set(ylim=(-0.45, 1.3), xlim=(0.2, 2.05), yticks=(0.0, 0.5, 1.0))
        ax.set_title(f"loss {LOOPS[self.law].loss:.3f} per cycle", fontsize="small")


class Machine(Panel):
    """The drawing of the three inertias with the clutch and the shaft between them."""

    view = "machine"
    size = (8.0, 2.6)

    def draw(self, ax: Axes, results: Sequence[gw.Result]) -> None:
        """Draw it from the model."""
        gw.plot.draw_machine(consistent_machine(), ax=ax)
        for text in ax.texts:  # the widths of the tables are 1; in radians the paper has none
            if text.get_text().endswith(" rad"):
                text.set_text("±b0")


class Torque(Panel):
    """The static torque of the clutch over its twist, for the three ratios of the stages in the tables."""

    view = "torque"

    def draw(self, ax: Axes, results: Sequence[gw.Result]) -> None:
        """Draw it from the numbers of the tables."""
        twist = np.linspace(-2.2, 2.2, 441)
        beyond = np.sign(twist) * np.maximum(np.abs(twist) - 1.0, 0.0)
        for case, colour, dashes in zip(("4a", "13", "9b"), _OTHERS, _DASHES, strict=True):
            numbers = gw.paper.parameter_set(case)
            torque = numbers.stiffness[0] * twist + numbers.n[0] * beyond
            ax.plot(twist, torque, color=colour, linestyle=dashes, label=f"κ = {numbers.stiffness[0]:g}")
        ax.set(xlabel="q1, twist of the clutch", ylabel="torque of the clutch")
        ax.legend(loc="upper left")
        for level in (-1.0, 1.0):
            ax.axvline(level, color="#6f6f6f", linewidth=0.7, linestyle=(0, (4, 2)))


@dataclass(frozen=True, kw_only=True)
class Motion(Panel):
    """A panel of settled motions of one signal; several are drawn over each other."""

    signal: str = "q1"

    def draw(self, ax: Axes, results: Sequence[gw.Result]) -> None:
        """Draw each motion in a colour of its own."""
        for place, result in enumerate(results):
            name = self.names[place] if self.names else ""
            colour = _COLOURS.get(name, _OTHERS[place])
            self.draw_one(ax, result, place, {"color": colour, "label": name or None})
        if len(self.names) > 1:
            ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=len(self.names), borderaxespad=0.1)

    def draw_one(self, ax: Axes, result: gw.Result, place: int, options: dict[str, Any]) -> None:
        """Draw one of the motions."""
        raise NotImplementedError

    def values(self, motion: Any) -> Any:
        """Return the signal of a motion, at its samples."""
        if self.signal == "u3''":
            return third_inertia(motion.system).of(motion)
        return motion.signal(self.signal)


@dataclass(frozen=True, kw_only=True)
class History(Motion):
    """A signal over the forcing periods: of the settled motion, or from rest."""

    periods: int = 2
    from_rest: bool = False  #: Whether it shows the start; dots mark where the contact closes.
    lowest: bool = False  #: Whether an inset magnifies its lowest values.

    view: ClassVar[str] = "history"

    def draw_one(self, ax: Axes, result: gw.Result, place: int, options: dict[str, Any]) -> None:
        """Draw the history."""
        start = np.zeros(4) if self.from_rest else attractor_of(result).state
        motion = gw.integrate(result.system, start, self.periods, 512 if self.periods < 10 else 128)
        values = self.values(motion)
        ax.plot(motion.theta / _PERIOD, values, linestyle=_DASHES[place], linewidth=1.1, **options)
        if self.from_rest and self.signal == "stage2":
            closings = [event.theta / _PERIOD for event in motion.events if event.enters]
            marks: Any = {"color": options["color"], "ls": "none", "marker": "^", "markersize": 4.0}
            ax.plot(closings, [0.03 + 0.04 * place] * len(closings), transform=ax.get_xaxis_transform(), **marks)
        if self.signal == "q1" and np.abs(values).max() > 0.9:
            for level in (-1.0, 1.0):
                ax.axhline(level, color="#6f6f6f", linewidth=0.7, linestyle=(0, (4, 2)), zorder=1)
        ax.set(xlim=(0.0, self.periods), xlabel="forcing periods", ylabel=self.signal)
        if self.lowest:
            place, depth = motion.theta[np.argmin(values)] / _PERIOD, float(values.min())
            ax.set_ylim(top=1.9 * float(values.max()))
            inset = ax.inset_axes((0.58, 0.66, 0.4, 0.31))
            inset.plot(motion.theta / _PERIOD, values, linewidth=1.1, color=options["color"])
            inset.set(xlim=(place - 0.06, place + 0.06), ylim=(1.3 * depth, -0.8 * depth))
            inset.tick_params(labelsize="x-small")
            ax.indicate_inset_zoom(inset, edgecolor="#6f6f6f")


class Spectrum(Motion):
    """The amplitudes of the lines of a signal, relative to the forcing frequency."""

    view = "spectrum"

    def draw_one(self, ax: Axes, result: gw.Result, place: int, options: dict[str, Any]) -> None:
        """Draw lines of a periodic motion, and a curve of any other."""
        attractor = attractor_of(result)
        assert isinstance(result.finding, gw.studies.SettleFinding)
        found = gw.analysis.spectrum(attractor.orbit or result.finding.settled, self.signal)
        top = self.within[1] if self.within else 6.0
        shown = (found.orders > 0.02) & (found.orders <= top)
        orders, heights = found.orders[shown], found.amplitudes[shown]
        floor = 1e-4 * max(found.amplitudes[1:].max(), ax.dataLim.y1 if place else 0.0)
        if attractor.orbit is None:
            ax.plot(orders, np.maximum(heights, floor), linewidth=0.7, **options)
        else:
            orders = orders + (0.12 * place if self.names else 0.0)
            ax.vlines(orders, floor, np.maximum(heights, floor), color=options["color"], linewidth=1.1)
            ax.plot(orders, np.maximum(heights, floor), marker=".", markersize=4.0, ls="none", **options)
        ax.set_yscale("log")
        ax.set(xlim=(0.0, top), xlabel="multiples of the forcing frequency", ylabel=f"amplitude of {self.signal}")
        ax.set_ylim(bottom=floor)


class Section(Motion):
    """The states once every forcing period: points, closed curves, or a cloud."""

    view = "section"

    def draw_one(self, ax: Axes, result: gw.Result, place: int, options: dict[str, Any]) -> None:
        """Draw the section."""
        attractor = attractor_of(result)
        found = gw.analysis.strobe(result.system, attractor.state, attractor.period if attractor.orbit else 4000)
        gw.plot.draw(found, ax=ax, heading=False)
        if attractor.orbit is None:  # smaller dots are lost at this size
            ax.lines[-1].set(markersize=2.4, markeredgewidth=0.0)


class ForceLoop(Motion):
    """The force of the second stage over q1."""

    view = "force loop"

    def draw_one(self, ax: Axes, result: gw.Result, place: int, options: dict[str, Any]) -> None:
        """Draw one period."""
        motion = gw.integrate(result.system, attractor_of(result).state, 1, 1024)
        ax.plot(motion.signal("q1"), motion.signal("stage2"), linestyle=_DASHES[place], linewidth=1.0, **options)
        for level in (-1.0, 1.0):
            ax.axvline(level, color="#6f6f6f", linewidth=0.7, linestyle=(0, (4, 2)), zorder=1)
        ax.set(xlabel="q1", ylabel="force of stage2")


def _shortest(result: gw.Result) -> list[gw.Branch]:
    """Return the branches of the shortest period."""
    shortest = min(branch.period for branch in result.branches)
    return [branch for branch in result.branches if branch.period == shortest]

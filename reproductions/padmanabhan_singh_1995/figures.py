"""The figures of the paper as data: their panels, and the jobs that these show."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import TYPE_CHECKING

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.jobs import JOBS, USUAL, Job, Reading
from reproductions.padmanabhan_singh_1995.panels import (
    Balance,
    Contrast,
    Hysteresis,
    Loops,
    Motion,
    Overlay,
    Panel,
    Record,
    Response,
)
from reproductions.padmanabhan_singh_1995.quantities import IMPACT, VISCOUS

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Picture


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure of the paper, in one reading.

    Parameters
    ----------
    name
        Its number; with a letter if it is only a part, such as ``20a``.
    caption
        What is to be seen, in our words.
    panels
        Its panels, row by row.
    columns
        Number of columns.
    kind
        What it shows, in two or three words.
    reading
        How the paper is read.
    """

    name: str
    caption: str
    panels: tuple[Panel, ...]
    columns: int = 1
    kind: str = "frequency response"
    reading: Reading = USUAL

    @property
    def number(self) -> int:
        """Its number in the paper."""
        return int(self.name.rstrip("abcdefgh"))

    @property
    def jobs(self) -> tuple[Job, ...]:
        """The jobs that it shows, in this reading, each once."""
        jobs = [job for panel in self.panels for job in self.jobs_of(panel)]
        return tuple({job.key: job for job in jobs}.values())

    def jobs_of(self, panel: Panel) -> tuple[Job, ...]:
        """Return the jobs that one panel shows, in this reading."""
        return tuple(JOBS[key].at(self.reading) for key in panel.jobs)

    @property
    def file_name(self) -> str:
        """How its files are called; a reading that is not the default stands at the end."""
        return f"figure-{self.name}{self.reading.suffix}"

    @property
    def notes(self) -> dict[str, str]:
        """What had to be decided beyond the printed tables, by the parameter set that it concerns."""
        cases = dict.fromkeys(job.case for job in self.jobs)
        return {case: note for case in cases if (note := gw.paper.describe(case))}

    def at(self, reading: Reading) -> Figure:
        """Return the figure in another reading."""
        return replace(self, reading=reading)

    def part(self, letter: str) -> Figure:
        """Return the figure with the panel of one letter only."""
        panels = tuple(panel for panel in self.panels if panel.letter == letter)
        return replace(self, name=f"{self.number}{letter}", panels=panels, columns=1)

    def draw(self, results: Mapping[str, gw.Result]) -> Picture:
        """Draw it from the results of its jobs, by their keys."""
        shown = [[results[job.key] for job in self.jobs_of(panel)] for panel in self.panels]
        view = type(self.panels[0])
        size = view.size(len(self.panels), self.columns)
        with gw.plot.figure(*size, f"Figure {self.name}. {self.caption}") as picture:
            view.fill(picture, self.panels, shown, self.columns)
        return picture


Within = tuple[float, float]


def _response(job: str, title: str = "response", letter: str = "a", within: Within | None = None) -> Panel:
    return Response(title=title, jobs=(job,), letter=letter, within=within)


def _loops(job: str, title: str, letter: str = "", within: Within | None = None) -> Panel:
    return Loops(title=title, jobs=(job,), letter=letter, within=within)


def _overlay(letter: str, title: str, within: Within, **jobs: tuple[str, str]) -> Panel:
    first, second = jobs["first"], jobs["second"]
    return Overlay(title=title, jobs=(first[0], second[0]), letter=letter, within=within, names=(first[1], second[1]))


def _two_cases(name: str, caption: str, first: tuple[str, str], second: tuple[str, str]) -> Figure:
    """Two frequency responses next to each other, and under each of them its loops, which the paper leaves out."""
    panels = (
        _response(*first, letter="a"),
        _response(*second, letter="b"),
        _loops(first[0], f"all periods of a: {first[1]}"),
        _loops(second[0], f"all periods of b: {second[1]}"),
    )
    return Figure(name, caption, panels, columns=2)


def _motion(name: str, job: str, caption: str) -> Figure:
    return Figure(name, caption, (Motion(title="settled motion", jobs=(job,)),), kind="settled motion")


def _contrast(name: str, caption: str, jobs: tuple[str, str], force: str, acceleration: str) -> Figure:
    """Force and acceleration of both damping models; each has the letter of its panel."""
    panels = tuple(
        Contrast(title=f"both models: {signal}", jobs=jobs, letter=letter, names=(VISCOUS, IMPACT), signal=signal)
        for letter, signal in sorted({force: "stage2", acceleration: "q1''"}.items())
    )
    return Figure(name, caption, panels, kind="two motions")


def _over_amplitude(name: str, caption: str, job: str, loops: str = "states") -> Figure:
    panels = (_response(job, "motions of period 1"), _loops(job, loops, "b"))
    return Figure(name, caption, panels, kind="diagram over the amplitude")


_LAWS = (
    Hysteresis(title="Dubowsky and Freudenstein: the contact pulls at the end", jobs=(), letter="a", law=VISCOUS),
    Hysteresis(title="Hunt and Crossley: no force where the bodies part", jobs=(), letter="b", law=IMPACT),
)
_RECORDS = (
    Record(title="computed with impact damping", jobs=("8-impact", "8-record"), letter="a"),
    Record(title="computed with viscous damping", jobs=("8-viscous", "8-record"), letter="b"),
)
_BALANCES = (
    Balance(title="κ = 0.1", jobs=("9a", "9a-balance"), letter="a"),
    Balance(title="κ = 0.4", jobs=("9b", "9b-balance"), letter="b"),
    _loops("9a", "all periods of a: κ = 0.1"),
    _loops("9b", "all periods of b: κ = 0.4"),
)
_SUPERHARMONIC = ("about the superharmonic resonance", (0.24, 0.36))
_IN_PHASE = ("20a", "φ = 0")


def _soft_clutch(job: str) -> tuple[Panel, ...]:
    low = _response(job, "low frequencies", "b", (0.15, 0.45))
    return _response(job), low, _loops(job, "all periods")


FIGURES = (
    Figure(
        "1",
        "Contact force under a harmonic deflection: with a damper while the bodies touch, and with impact damping of "
        "the same loss.",
        _LAWS,
        columns=2,
        kind="force law",
    ),
    _contrast(
        "3", "Accelerations and contact forces of both damping models at Ω = 1.5.", ("3-viscous", "3-impact"), "b", "a"
    ),
    _two_cases(
        "4",
        "Pure backlash under a heavy mean load, with impact damping and with viscous damping.",
        ("4a", "impact damping"),
        ("4b", "viscous damping"),
    ),
    _motion(
        "5",
        "5-near",
        "Impact damping near Ω = 0.17: four peaks of the contact force on one side, then one on the other. At the "
        "printed loads the contact stays closed.",
    ),
    _motion("6", "6-near", "Viscous damping at the place of figure 5: impacts on one side only."),
    _contrast(
        "7",
        "Both damping models at the place of figure 5, with damping so high that their forces are alike.",
        ("7-viscous-near", "7-impact-near"),
        "a",
        "c",
    ),
    Figure(
        "8",
        "Acceleration u3'' of the third inertia under a very low mean load, and of a SYNTHETIC record: the measured "
        "one of the paper is not printed as numbers.",
        _RECORDS,
        kind="motion and a record",
    ),
    Figure("9", "Shooting (lines) and harmonic balance (circles) give the same responses.", _BALANCES, columns=2),
    _two_cases(
        "10",
        "Pure backlash: a stiff second stage, and one that is a fifth softer.",
        ("4a", "n1 = 1"),
        ("10b", "n1 = 0.8"),
    ),
    _two_cases(
        "11",
        "Resonances at two distances from each other; the numbers of both sets are damaged in the scan.",
        ("11a", "K12 = 0.3"),
        ("11b", "K12 = 0.06"),
    ),
    Figure(
        "12",
        "A heavily loaded clutch: jumps, and no motion of a longer period.",
        (_response("12"), _loops("12", "states")),
    ),
    Figure(
        "13",
        "Half the mean load of figure 12 on the clutch: periods double about the second resonance and beside the jump.",
        (
            _response("13"),
            _loops("13", "about the second resonance", "b", (1.14, 1.36)),
            _loops("13", "beside the jump", within=(0.58, 0.84)),
        ),
    ),
    Figure(
        "14",
        "As figure 13, with twice the mean load on the shaft: fewer doublings.",
        (
            _response("9a"),
            _loops("9a", "about the second resonance", "b", (1.2, 1.36)),
            _loops("9a", "beside the jump", within=(0.58, 0.84)),
        ),
    ),
    Figure(
        "15",
        "As figure 13, with twice the excitation: the richest of the responses to one harmonic.",
        (_response("15"), _response("15", "low frequencies", "b", (0.15, 0.5))),
    ),
    Figure(
        "16",
        "The loops of figure 15: doubled periods, and doubled once more.",
        (_loops("15", "high frequencies", "a", (0.9, 1.4)), _loops("16", "low frequencies", "b", (0.3, 0.5))),
    ),
    _motion("17", "17-near", "Period 3 at Ω = 0.864. At 0.63, as the paper has it, only period 1 was found."),
    _motion("18", "18-near", "Quasi-periodic at Ω = 0.855. At 0.634, as the paper has it, only period 1 was found."),
    _motion("19", "19-near", "Chaotic at Ω = 0.833. At 0.636, as the paper has it, only period 1 was found."),
    _two_cases(
        "20",
        "A second harmonic of the excitation, in phase and 120 degrees ahead.",
        _IN_PHASE,
        ("20b", "φ = 120°"),
    ),
    Figure(
        "21",
        "The responses of figure 20 laid over each other.",
        (
            _overlay("a", "about the first resonance", (0.45, 0.75), first=_IN_PHASE, second=("20b", "φ = 120°")),
            _overlay("b", *_SUPERHARMONIC, first=_IN_PHASE, second=("20b", "φ = 120°")),
        ),
    ),
    Figure(
        "22",
        "A second harmonic in antiphase: one more range of doubled periods.",
        (
            _response("22", "φ = 180°"),
            _overlay("b", *_SUPERHARMONIC, first=_IN_PHASE, second=("22", "φ = 180°")),
            _loops("22", "all periods, φ = 180°"),
        ),
    ),
    _two_cases(
        "23",
        "A softer clutch (κ = 0.4) under one harmonic, and with a second one at twice the frequency.",
        ("9b", "one harmonic"),
        ("23b", "two harmonics, Ω and 2 Ω"),
    ),
    Figure("24", "The clutch of figure 23 under twice the excitation.", _soft_clutch("24")),
    Figure("25", "As figure 24, with a second harmonic at twice the frequency.", _soft_clutch("25")),
    _two_cases(
        "26",
        "The clutch of figure 23 under one harmonic, and with a second one at three times the frequency.",
        ("9b", "one harmonic"),
        ("26b", "two harmonics, Ω and 3 Ω"),
    ),
    _over_amplitude("27", "Motions over the amplitude at Ω = 0.25, with the isolated branches.", "27"),
    _over_amplitude("28", "As figure 27, at Ω = 0.255.", "28"),
    _over_amplitude(
        "29", "Pure backlash at Ω = 0.35 over the amplitude: cascades of doubled periods.", "29", "all periods"
    ),
)


def find_figure(name: str) -> Figure:
    """Return a figure by its number, or a part of it: ``13``, ``Fig. 20``, ``20a``, ``20(b)``.

    Raises
    ------
    ModelError
        If the paper has no such figure.
    """
    plain = re.sub(r"^fig(ure|\.)?|[\s().]", "", name.strip().lower())
    whole = {figure.name: figure for figure in FIGURES}
    parts = {f"{figure.name}{panel.letter}": figure for figure in FIGURES for panel in figure.panels if panel.letter}
    if plain in whole:
        return whole[plain]
    if plain in parts:
        return parts[plain].part(plain[-1])
    near = get_close_matches(plain, [*whole, *parts], cutoff=0.6)
    hint = f"did you mean {' or '.join(near)}?" if near else f"the figures are {', '.join(whole)}"
    raise gw.errors.ModelError(f"the paper has no figure {name!r} that can be drawn; {hint}")

"""The figures of the paper as data: their panels, the jobs that these show, and what the paper says drawn in."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.jobs import (
    AS_PRINTED,
    CHANGES,
    JOBS,
    LITERAL,
    USUAL,
    Job,
    Reading,
    changed_numbers,
    in_words,
)
from reproductions.padmanabhan_singh_1995.panels import (
    Balance,
    Fact,
    ForceLoop,
    History,
    Hysteresis,
    Isolated,
    Loops,
    Machine,
    Overlay,
    Panel,
    Response,
    Section,
    Spectrum,
    Torque,
    Within,
)
from reproductions.padmanabhan_singh_1995.quantities import IMPACT, START, VISCOUS


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure of the paper, in one reading."""

    name: str  #: Its number; with a letter if it is only a part, such as ``20a``.
    caption: str  #: What is to be seen, in our words.
    panels: tuple[Panel, ...]
    kind: str = "frequency response"  #: What it shows, in two or three words.
    reading: Reading = USUAL  #: How the paper is read.

    @property
    def number(self) -> int:
        """Its number in the paper; 0 for what the paper does not have."""
        return int(self.name.rstrip("abcdefgh")) if self.name[0].isdigit() else 0

    @property
    def jobs(self) -> tuple[Job, ...]:
        """The jobs that it shows, in this reading, each once."""
        jobs = [job for panel in self.panels for job in self.jobs_of(panel)]
        return tuple({job.key: job for job in jobs}.values())

    def jobs_of(self, panel: Panel) -> tuple[Job, ...]:
        """Return the jobs that one panel shows, in its reading or in that of the figure."""
        usual = [JOBS[key] for key in panel.jobs]
        jobs = [job.at(panel.reading or self.reading) for job in usual]
        short = panel.short and panel.reading is not None
        return tuple(b.shortest if short and b != a else b for a, b in zip(usual, jobs, strict=True))

    def file_name(self, panel: Panel) -> str:
        """Return the name of the picture of a panel; a reading that is not the default stands at the end."""
        place = panel.letter or f"-{self.panels.index(panel) + 1}"
        return f"figure-{self.number or self.name}{place}{self.reading.suffix}.png"

    @property
    def notes(self) -> dict[str, str]:
        """What had to be decided beyond the printed tables, by the parameter set that it concerns."""
        cases = dict.fromkeys(job.case for job in self.jobs)
        return {case: note for case in cases if (note := gw.paper.describe(case))}

    def at(self, reading: Reading) -> Figure:
        """Return the figure in another reading, without the panels that have one of their own."""
        if reading == USUAL:
            return self
        panels = tuple(panel for panel in self.panels if panel.reading is None)
        return replace(self, reading=reading, panels=panels)

    def part(self, letter: str) -> Figure:
        """Return the figure with the panel of one letter only."""
        panels = tuple(panel for panel in self.panels if panel.letter == letter)
        return replace(self, name=f"{self.number}{letter}", panels=panels)


def _response(job: str, title: str = "response", letter: str = "a", within: Within | None = None, **more: Any) -> Panel:
    return Response(title=title, jobs=(job,), letter=letter, within=within, **more)


def _loops(job: str, title: str, letter: str = "", within: Within | None = None, **more: Any) -> Panel:
    return Loops(title=title, jobs=(job,), letter=letter, within=within, **more)


def _overlay(letter: str, title: str, within: Within, jobs: dict[str, str], **more: Any) -> Panel:
    return Overlay(title=title, jobs=tuple(jobs.values()), names=tuple(jobs), letter=letter, within=within, **more)


def _settled(job: str, at: str = "", reading: Reading | None = None) -> tuple[Panel, ...]:
    """History, spectrum and section of q1."""
    more: Any = {"jobs": (job,), "at": at, "reading": reading}
    return (
        History(title="history of q1", letter="a", periods=16, **more),
        Spectrum(title="spectrum", letter="b", within=(0.0, 4.0), **more),
        Section(title="section, once every forcing period", letter="c", **more),
    )


def _impacts(job: str, *others: Panel) -> tuple[Panel, ...]:
    """Loop, history and spectrum of the force where the contact opens; the history at the printed numbers."""
    more: Any = {"jobs": (job,), "reading": _MORE}
    harmonics = (Fact("paper: at least 10 to 12 lines", 10.0, 12.0),) if job == "5" else ()
    return (
        ForceLoop(title="force over the twist", letter="a", **more),
        History(title="history of the force", letter="b", signal="stage2", **more),
        Spectrum(title="its spectrum", letter="c", within=(0.0, 26.0), signal="stage2", facts=harmonics, **more),
        History(title="at the printed numbers the contact stays closed", jobs=(job,), signal="stage2"),
        *others,
    )


def _over_amplitude(
    name: str, caption: str, job: str, facts: tuple[Fact, ...] = (), *more: Panel, kind: type[Response] = Isolated
) -> Figure:
    panels = (
        kind(title="motions of period 1", jobs=(job,), letter="a", facts=facts),
        _loops(job, "states once every period", "b", most=1 if kind is Isolated else 2),
        *more,
    )
    return Figure(name, caption, panels, kind="diagram over the amplitude")


_MORE = CHANGES["te1-0.37"]
_FOUR = CHANGES["te1-0.338"]
_LESS_DAMPING = CHANGES["c11-0.025"]
_RULE = CHANGES["matched"]
_TENTH = CHANGES["beta-0.1"]
_EXCHANGED = CHANGES["exchanged"]
_ALONE = CHANGES["k11-0"]

_HALF = Fact("paper: half the main peak's frequency", 0.5, of_peak="share")
_PARTS = tuple(Fact(f"1/{part}", 1.0 / part, of_peak="share") for part in (4, 3, 2))
_SMALL = (0.15, 0.35)
_NOTHING = Fact("paper: nothing found", 0.3, 0.45)
_SCALE: Any = {"heights": (0.02, 50.0), "log": True}
_LAWS = {VISCOUS: "4b", IMPACT: "4a"}
_STATES = (-2.0, 2.0)
_BEYOND = (0.75, 1.8)
_SUPERHARMONIC = ("about the superharmonic resonance", (0.24, 0.36))
_RAISED = ("7-viscous-raised", "7-impact-raised")
_VERY_LOW = "Tm1 = Tm2 = 0.05, Ω = 0.35"
_DAMPERS = {
    name: in_words(changed_numbers(gw.paper.case(JOBS[name].case), JOBS[name].study.system)) for name in _RAISED
}
_CHOSEN = f"{_MORE.differs}, {', '.join(_DAMPERS.values())}"
_BOTH: Any = {"jobs": _RAISED, "names": (VISCOUS, IMPACT), "reading": _MORE, "at": _CHOSEN}
_LOW = ("low frequencies", (0.15, 0.42))

FIGURES = (
    Figure(
        "1",
        "Contact force under a harmonic deflection: with a damper while the bodies touch, and with impact damping of "
        "the same loss.",
        (
            Hysteresis(title="Dubowsky and Freudenstein: it pulls at the end", letter="a", law=VISCOUS),
            Hysteresis(title="Hunt and Crossley: no force where the bodies part", letter="b", law=IMPACT),
        ),
        kind="force law",
    ),
    Figure(
        "2",
        "The machine: flywheel, clutch hub and the rest of the driveline; the torque of a clutch of two stages.",
        (Machine(title="three inertias in line", letter="a"), Torque(title="torque of the clutch", letter="b")),
        kind="model",
    ),
    Figure(
        "3",
        "A start from rest with both damping models at Ω = 1.5. Triangles mark where the second stage closes.",
        tuple(
            History(
                title=title,
                jobs=("3-viscous", "3-impact"),
                names=(VISCOUS, IMPACT),
                letter=letter,
                signal=signal,
                periods=START,
                from_rest=True,
                facts=facts,
            )
            for letter, signal, title, facts in (
                ("a", "q1''", "acceleration of q1", ()),
                ("b", "stage2", "force of the second stage", (Fact("paper: one impact in two periods", 2.0, 4.0),)),
            )
        ),
        kind="two motions",
    ),
    Figure(
        "4",
        "Pure backlash under a heavy mean load, with impact damping and with viscous damping, on one scale.",
        (
            _response("4a", "impact damping, β = 0.075", "a", **_SCALE),
            _response("4b", "viscous damping", "b", **_SCALE),
            _response("4a", "impact damping, β by the paper's rule", "", reading=_RULE, **_SCALE),
            _overlay("", "beyond the first resonance, β = 0.075", _BEYOND, _LAWS),
            _overlay("", "beyond the first resonance, β by the paper's rule", _BEYOND, _LAWS, reading=_RULE),
            _loops("4a", "period 2, β by the paper's rule", "", (0.58, 0.76), reading=_RULE, most=2, heights=_STATES),
            _loops("4b", "period 2, viscous damping", "", (0.58, 0.76), most=2, heights=_STATES),
        ),
    ),
    Figure(
        "5",
        "Impact damping at Ω = 0.17. At the printed loads the contact stays closed; with Te1 = 0.37 it opens.",
        _impacts(
            "5",
            History(
                title="four peaks, then a touch on the other side",
                jobs=("5-start",),
                signal="stage2",
                reading=_FOUR,
                lowest=True,
            ),
        ),
        kind="settled motion",
    ),
    Figure(
        "6",
        "Viscous damping at Ω = 0.17, under the loads of figure 5.",
        _impacts("6"),
        kind="settled motion",
    ),
    Figure(
        "7",
        "Both damping models at Ω = 0.17 with more damping, such that their forces are alike.",
        (
            History(title="force of the second stage", letter="a", signal="stage2", **_BOTH),
            Spectrum(title="its spectrum", letter="b", within=(0.0, 16.0), signal="stage2", **_BOTH),
            *(
                History(
                    title=f"acceleration of q1, {name}",
                    letter=letter,
                    jobs=(job,),
                    names=(name,),
                    reading=_MORE,
                    at=f"{_MORE.differs}, {_DAMPERS[job]}",
                    periods=2,
                    signal="q1''",
                )
                for letter, job, name in (("c", _RAISED[1], IMPACT), ("d", _RAISED[0], VISCOUS))
            ),
        ),
        kind="two motions",
    ),
    Figure(
        "8",
        "The measured acceleration is a curve in the paper, which the scan has lost: there is nothing left to compare "
        "with. Here is what both models give at a very low mean load.",
        tuple(
            History(
                title=name,
                letter=letter,
                jobs=(job,),
                names=(name,),
                at=_VERY_LOW,
                periods=4,
                signal="u3''",
            )
            for letter, job, name in (("a", "8-impact", IMPACT), ("", "8-viscous", VISCOUS))
        ),
        kind="settled motion",
    ),
    Figure(
        "9",
        "Shooting (lines) and harmonic balance (circles) give the same responses.",
        (
            Balance(title="κ = 0.1", jobs=("9a", "9a-balance"), letter="a"),
            Balance(title="κ = 0.4", jobs=("9b", "9b-balance"), letter="b"),
        ),
    ),
    Figure(
        "10",
        "Pure backlash: a stiff second stage, and one that is a fifth softer.",
        (
            _response("4a", "n1 = 1", "a"),
            _response("10b", "n1 = 0.8", "b"),
            _response("4a", "n1 = 1", "", reading=_TENTH),
            _response("10b", "n1 = 0.8", "", reading=_TENTH),
        ),
    ),
    Figure(
        "11",
        "Resonances at two distances from each other. The numbers of both sets are damaged in the scan.",
        (
            _response(
                "11a",
                "K12 = 0.3",
                "a",
                facts=(Fact("paper: stable", 0.5, 0.7), Fact("0.6 further", 0.6, of_peak="beyond")),
            ),
            _response(
                "11b",
                "n1 and n2 exchanged",
                "b",
                reading=_EXCHANGED,
                facts=(Fact("paper: pair", 0.5, 0.7), Fact("0.8 further", 0.8, of_peak="beyond")),
            ),
        ),
    ),
    Figure(
        "12",
        "A heavily loaded clutch: jumps, and no motion of a longer period.",
        (
            _response("12"),
            _response("12", "the first resonance", "", (0.55, 0.68)),
            _response(
                "12", "first resonance, with the pair", "", (0.55, 0.68), reading=AS_PRINTED, heights=(0.0, 20.0)
            ),
        ),
    ),
    Figure(
        "13",
        "Half the mean load of figure 12 on the clutch: periods double about the second resonance and beside the jump.",
        (
            _response("13", facts=(Fact("paper: flips 0.62 to 0.85", 0.62, 0.85),)),
            _loops("13", "period 2 about the second resonance", "b", (1.14, 1.36), most=2),
            _loops("13", "period 2 beside the jump", "", (0.58, 0.84), most=2),
        ),
    ),
    Figure(
        "14",
        "As figure 13, with twice the mean load on the shaft: fewer doublings.",
        (
            _response("9a"),
            _loops("9a", "period 2 about the second resonance", "b", (1.2, 1.36), most=2),
            _loops("9a", "period 2 beside the jump", "", (0.58, 0.84), most=2),
            _response("9a", "beside the jump period 1 stays stable", "", (0.55, 0.9), reading=LITERAL),
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
        (
            _loops("16-high", "high frequencies", "a", (1.05, 1.25), most=2),
            _loops("16", "low frequencies", "b", (0.38, 0.43), most=2),
            _loops("16-doubled", "b with period 4, closer", "", (0.406, 0.4165)),
        ),
    ),
    Figure(
        "17",
        "Period 3 at Ω = 0.63 without the first stage (K11 = 0). With it only period 1 was found.",
        (
            *_settled("17-start", reading=_ALONE),
            History(title="at the printed numbers: period 1", jobs=("17",), periods=16),
        ),
        kind="settled motion",
    ),
    Figure(
        "18",
        "A quasi-periodic motion, which the clutch has at Ω = 0.855. At 0.634 it has period 1; without the first stage "
        "(K11 = 0) it is chaotic there.",
        (
            *_settled("18-near", "at Ω = 0.855"),
            Section(title="section without the first stage: chaos", jobs=("18-start",), reading=_ALONE),
        ),
        kind="settled motion",
    ),
    Figure(
        "19",
        "Chaos at Ω = 0.636 without the first stage (K11 = 0). With it only period 1 was found.",
        (
            *_settled("19-start", reading=_ALONE),
            History(title="at the printed numbers: period 1", jobs=("19",), periods=16),
        ),
        kind="settled motion",
    ),
    Figure(
        "20",
        "A second harmonic of the excitation, in phase and 120 degrees ahead.",
        (
            _response("20a", "φ = 0", "a", facts=(_HALF,)),
            _response("20b", "φ = 120°", "b", facts=(_HALF,)),
            _response("20b", f"φ = 120°, {_SUPERHARMONIC[0]}", "", _SUPERHARMONIC[1]),
        ),
    ),
    Figure(
        "21",
        "The responses of figure 20 laid over each other.",
        tuple(
            _overlay(letter, title, within, {"φ = 0": "20a", "φ = 120°": "20b"})
            for letter, title, within in (("a", "about the first resonance", (0.45, 0.75)), ("b", *_SUPERHARMONIC))
        ),
    ),
    Figure(
        "22",
        "A second harmonic in antiphase: one more range of doubled periods.",
        (
            _response("22", "φ = 180°", facts=(_HALF, Fact("paper: flips about 0.8", 0.8))),
            _overlay("b", *_SUPERHARMONIC, {"φ = 0": "20a", "φ = 120°": "20b", "φ = 180°": "22"}),
        ),
    ),
    Figure(
        "23",
        "A softer clutch (κ = 0.4) under one harmonic, and with a second one at twice the frequency.",
        (
            _response("9b", "one harmonic", "a"),
            _response("23b", "Ω and 2 Ω", "b"),
            _response("9b", "one harmonic, the small peaks", "", _SMALL, facts=_PARTS),
            _response("23b", "Ω and 2 Ω, the small peaks", "", _SMALL, facts=_PARTS),
        ),
    ),
    Figure(
        "24",
        "The clutch of figure 23 under twice the excitation.",
        (_response("24"), _response("24", _LOW[0], "b", _LOW[1])),
    ),
    Figure(
        "25",
        "As figure 24, with a second harmonic at twice the frequency.",
        (
            _response("25"),
            _response("25", _LOW[0], "b", _LOW[1]),
            _overlay(
                "",
                "figures 24 and 25",
                _LOW[1],
                {"one harmonic": "24", "Ω and 2 Ω": "25"},
                facts=(Fact("paper: lower up to 0.25", 0.15, 0.25),),
            ),
        ),
    ),
    Figure(
        "26",
        "The clutch of figure 23 under one harmonic, and with a second one at three times the frequency.",
        (
            _response("9b", "one harmonic", "a"),
            _response("26b", "Ω and 3 Ω", "b"),
            _overlay("", "low frequencies", (0.15, 0.55), {"one harmonic": "9b", "Ω and 3 Ω": "26b"}, facts=_PARTS),
        ),
    ),
    _over_amplitude(
        "27",
        "Motions over the amplitude at Ω = 0.25, with the isolated branches.",
        "27",
        (_NOTHING,),
        Isolated(title="one number changed", jobs=("27",), reading=_LESS_DAMPING),
    ),
    _over_amplitude(
        "28",
        "As figure 27, at Ω = 0.255.",
        "28",
        (),
        Isolated(title="one number changed", jobs=("28",), reading=_LESS_DAMPING),
    ),
    _over_amplitude(
        "29", "Pure backlash at Ω = 0.35 over the amplitude: cascades of doubled periods.", "29", kind=Response
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

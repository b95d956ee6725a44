"""The figures of the paper, as data."""

from __future__ import annotations

import re

from gapwalk.errors import ModelError
from gapwalk.model.problem import did_you_mean
from reproductions.padmanabhan_singh_1995.figure import Figure, FigureKind, Panel, View
from reproductions.padmanabhan_singh_1995.loops import IMPACT, VISCOUS

_RESPONSE, _DIAGRAM = FigureKind.RESPONSE, FigureKind.DIAGRAM


def _response(letter: str, job: str, title: str, within: tuple[float, float] | None = None) -> Panel:
    return Panel(letter, View.RESPONSE, (job,), title, within)


def _loops(letter: str, job: str, title: str, within: tuple[float, float] | None = None) -> Panel:
    return Panel(letter, View.LOOPS, (job,), title, within)


def _two_cases(name: str, caption: str, first: tuple[str, str], second: tuple[str, str]) -> Figure:
    """Two frequency responses side by side, and under each of them its loops, which the paper leaves out."""
    panels = (
        _response("a", *first),
        _response("b", *second),
        _loops("", first[0], f"all periods of a: {first[1]}"),
        _loops("", second[0], f"all periods of b: {second[1]}"),
    )
    return Figure(name, _RESPONSE, caption, panels, columns=2)


def _with_balance(letter: str, job: str, title: str) -> Panel:
    return Panel(letter, View.BALANCE, (job, f"{job}-balance"), title)


def _motion(name: str, job: str, caption: str) -> Figure:
    """Time history, spectrum and section, as the paper has them, and the loop of the contact force."""
    return Figure(name, FigureKind.MOTION, caption, (Panel("", View.MOTION, (job,), "settled motion"),))


def _contrast(name: str, caption: str, jobs: tuple[str, str], letters: tuple[str, str]) -> Figure:
    """Force and acceleration of both damping models, in time and as spectra."""
    signals = dict(zip(letters, ("stage2", "q1''"), strict=True))
    panels = tuple(
        Panel(letter, View.CONTRAST, jobs, f"both models: {signals[letter]}", None, (VISCOUS, IMPACT), signals[letter])
        for letter in sorted(letters)
    )
    return Figure(name, FigureKind.CONTRAST, caption, panels)


FIGURES = (
    Figure(
        "1",
        FigureKind.LAW,
        "Contact force under a harmonic deflection: with a damper while the bodies touch, and with impact damping of "
        "the same loss.",
        (
            Panel(
                "a", View.HYSTERESIS, (), "Dubowsky and Freudenstein: the contact pulls at the end", None, (VISCOUS,)
            ),
            Panel("b", View.HYSTERESIS, (), "Hunt and Crossley: no force where the bodies part", None, (IMPACT,)),
        ),
        columns=2,
    ),
    _contrast(
        "3",
        "Accelerations and contact forces of both damping models at Ω = 1.5.",
        ("3-viscous", "3-impact"),
        ("b", "a"),
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
        ("a", "c"),
    ),
    Figure(
        "8",
        FigureKind.RECORD,
        "Acceleration u3'' of the third inertia under a very low mean load, beside a SYNTHETIC record: the measured "
        "one of the paper is not printed as numbers.",
        (
            Panel("a", View.RECORD, ("8-impact", "8-record"), "computed with impact damping"),
            Panel("b", View.RECORD, ("8-viscous", "8-record"), "computed with viscous damping"),
        ),
    ),
    Figure(
        "9",
        _RESPONSE,
        "Shooting (lines) and harmonic balance (circles) give the same responses.",
        (
            _with_balance("a", "9a", "κ = 0.1"),
            _with_balance("b", "9b", "κ = 0.4"),
            _loops("", "9a", "all periods of a: κ = 0.1"),
            _loops("", "9b", "all periods of b: κ = 0.4"),
        ),
        columns=2,
    ),
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
        _RESPONSE,
        "A heavily loaded clutch: jumps, and no motion of a longer period.",
        (_response("a", "12", "response"), _loops("", "12", "states")),
    ),
    Figure(
        "13",
        _RESPONSE,
        "Half the mean load of figure 12 on the clutch: periods double about the second resonance and beside the jump.",
        (
            _response("a", "13", "response"),
            _loops("b", "13", "about the second resonance", (1.14, 1.36)),
            _loops("", "13", "beside the jump", (0.58, 0.84)),
        ),
    ),
    Figure(
        "14",
        _RESPONSE,
        "As figure 13, with twice the mean load on the shaft: fewer doublings.",
        (
            _response("a", "9a", "response"),
            _loops("b", "9a", "about the second resonance", (1.2, 1.36)),
            _loops("", "9a", "beside the jump", (0.58, 0.84)),
        ),
    ),
    Figure(
        "15",
        _RESPONSE,
        "As figure 13, with twice the excitation: the richest of the responses to one harmonic.",
        (_response("a", "15", "response"), _response("b", "15", "low frequencies", (0.15, 0.5))),
    ),
    Figure(
        "16",
        _RESPONSE,
        "The loops of figure 15: doubled periods, and doubled once more.",
        (
            _loops("a", "15", "high frequencies", (0.9, 1.4)),
            _loops("b", "15", "low frequencies", (0.3, 0.5)),
        ),
    ),
    _motion("17", "17-near", "Period 3 at Ω = 0.864. At 0.63, as the paper has it, only period 1 was found."),
    _motion("18", "18-near", "Quasi-periodic at Ω = 0.855. At 0.634, as the paper has it, only period 1 was found."),
    _motion("19", "19-near", "Chaotic at Ω = 0.833. At 0.636, as the paper has it, only period 1 was found."),
    _two_cases(
        "20",
        "A second harmonic of the excitation, in phase and 120 degrees ahead.",
        ("20a", "φ = 0"),
        ("20b", "φ = 120°"),
    ),
    Figure(
        "21",
        _RESPONSE,
        "The responses of figure 20 laid over each other.",
        (
            Panel(
                "a",
                View.OVERLAY,
                ("20a", "20b"),
                "about the first resonance",
                (0.45, 0.75),
                ("φ = 0", "φ = 120°"),
            ),
            Panel(
                "b",
                View.OVERLAY,
                ("20a", "20b"),
                "about the superharmonic resonance",
                (0.24, 0.36),
                ("φ = 0", "φ = 120°"),
            ),
        ),
    ),
    Figure(
        "22",
        _RESPONSE,
        "A second harmonic in antiphase: one more range of doubled periods.",
        (
            _response("a", "22", "φ = 180°"),
            Panel(
                "b",
                View.OVERLAY,
                ("20a", "22"),
                "about the superharmonic resonance",
                (0.24, 0.36),
                ("φ = 0", "φ = 180°"),
            ),
            _loops("", "22", "all periods, φ = 180°"),
        ),
    ),
    _two_cases(
        "23",
        "A softer clutch (κ = 0.4) under one harmonic, and with a second one at twice the frequency.",
        ("9b", "one harmonic"),
        ("23b", "two harmonics, Ω and 2 Ω"),
    ),
    Figure(
        "24",
        _RESPONSE,
        "The clutch of figure 23 under twice the excitation.",
        (
            _response("a", "24", "response"),
            _response("b", "24", "low frequencies", (0.15, 0.45)),
            _loops("", "24", "all periods"),
        ),
    ),
    Figure(
        "25",
        _RESPONSE,
        "As figure 24, with a second harmonic at twice the frequency.",
        (
            _response("a", "25", "response"),
            _response("b", "25", "low frequencies", (0.15, 0.45)),
            _loops("", "25", "all periods"),
        ),
    ),
    _two_cases(
        "26",
        "The clutch of figure 23 under one harmonic, and with a second one at three times the frequency.",
        ("9b", "one harmonic"),
        ("26b", "two harmonics, Ω and 3 Ω"),
    ),
    Figure(
        "27",
        _DIAGRAM,
        "Motions over the amplitude at Ω = 0.25, with the branches that hang together with no other.",
        (_response("a", "27", "motions of period 1"), _loops("b", "27", "states")),
    ),
    Figure(
        "28",
        _DIAGRAM,
        "As figure 27, at Ω = 0.255.",
        (_response("a", "28", "motions of period 1"), _loops("b", "28", "states")),
    ),
    Figure(
        "29",
        _DIAGRAM,
        "Pure backlash at Ω = 0.35 over the amplitude: cascades of doubled periods.",
        (_response("a", "29", "motions of period 1"), _loops("b", "29", "all periods")),
    ),
)


def find_figure(name: str) -> Figure:
    """A figure by its number, or a part of it: ``13``, ``Fig. 20``, ``20a``, ``20(b)``.

    Raises
    ------
    ModelError
        If the paper has no such figure.
    """
    plain = re.sub(r"^fig(ure|\.)?|[\s().]", "", name.strip().lower())
    known = {figure.name: figure for figure in FIGURES}
    if plain in known:
        return known[plain]
    parts = {f"{figure.name}{panel.letter}": figure for figure in FIGURES for panel in figure.panels if panel.letter}
    if plain in parts:
        return parts[plain].part(plain[-1])
    raise ModelError(f"the paper has no figure {name!r} that can be drawn; {did_you_mean(plain, [*known, *parts])}")

"""A figure of the paper as data: its panels, and the jobs that they show."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

from reproductions.padmanabhan_singh_1995.jobs import find_job
from reproductions.padmanabhan_singh_1995.reading import USUAL, Reading


class FigureKind(StrEnum):
    """What a figure shows."""

    RESPONSE = "frequency response"
    DIAGRAM = "diagram over the amplitude"
    MOTION = "settled motion"
    CONTRAST = "two motions"
    RECORD = "motion beside a record"
    LAW = "force law"


class View(StrEnum):
    """What a panel shows of its jobs."""

    RESPONSE = "response"
    """A measure of the motions of period 1 over the parameter, with their stability."""
    LOOPS = "loops"
    """q1(0) of all motions, once every forcing period: the loops of P2 and P4."""
    OVERLAY = "overlay"
    """The motions of period 1 of several jobs, told apart by their lines."""
    BALANCE = "balance"
    """As `RESPONSE`, beside harmonic balance."""
    MOTION = "motion"
    """Time history, spectrum, section and loop of the contact force."""
    CONTRAST = "contrast"
    """A signal of two motions, laid over each other in time and as lines of their spectra."""
    RECORD = "record"
    """The acceleration of the third inertia: of a motion, and a record of another one."""
    HYSTERESIS = "hysteresis"
    """The loop of a contact's force under a harmonic deflection, in closed form: it rests on no job."""


@dataclass(frozen=True, slots=True)
class Panel:
    """One panel of a figure.

    Parameters
    ----------
    letter
        Its letter in the paper; empty for a panel that the paper does not have.
    view, jobs
        What it shows, and the keys of the jobs that it shows this of.
    title
        What it is, in a few words.
    within
        Range of the parameter; None for the whole range of the job.
    names
        What the legend calls the jobs of an overlay or a contrast, or the loops of figure 1.
    signal
        What a contrast shows, as in `Motion.signal`.
    """

    letter: str
    view: View
    jobs: tuple[str, ...]
    title: str
    within: tuple[float, float] | None = None
    names: tuple[str, ...] = ()
    signal: str = ""


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure of the paper.

    Parameters
    ----------
    name
        Its number; with a letter if it is only a part, such as ``20a``.
    kind
        What it shows.
    caption
        What is to be seen, in our words.
    panels
        Its panels, row by row.
    columns
        In how many columns they stand.
    reading
        How the paper is read.
    """

    name: str
    kind: FigureKind
    caption: str
    panels: tuple[Panel, ...] = ()
    columns: int = 1
    reading: Reading = USUAL

    @property
    def number(self) -> int:
        """Its number in the paper."""
        return int(self.name.rstrip("abcdefgh"))

    @property
    def jobs(self) -> tuple[str, ...]:
        """The keys of the jobs that it shows, in this reading."""
        keys = dict.fromkeys(key for panel in self.panels for key in panel.jobs)
        return tuple(self.key(key) for key in keys)

    @property
    def file_name(self) -> str:
        """What its files are called; the end tells a reading that is not the default."""
        return f"figure-{self.name}{self.reading.suffix}"

    def key(self, job: str) -> str:
        """The key of a job of a panel, in the reading of this figure."""
        return find_job(job).at(self.reading).key

    def at(self, reading: Reading) -> Figure:
        """The same in another reading."""
        return replace(self, reading=reading)

    def part(self, letter: str) -> Figure:
        """Only the panel of one letter."""
        panels = tuple(panel for panel in self.panels if panel.letter == letter)
        return replace(self, name=f"{self.number}{letter}", panels=panels, columns=1)

"""The job of a settled motion: it has one part, all of it."""

from __future__ import annotations

from collections.abc import Callable

from gapwalk.attractors.classify import ClassifyOptions, identify
from gapwalk.attractors.rattle import rattle
from gapwalk.attractors.section import strobe
from gapwalk.attractors.settle import settle
from gapwalk.attractors.spectrum import spectrum
from gapwalk.results.result_file import Part, Parts
from gapwalk.studies.file import Study
from gapwalk.studies.request import Keeper
from gapwalk.studies.settle.finding import SettleFinding, motion_of
from gapwalk.studies.settle.study_options import SettleStudyOptions

SETTLED = Part("settled", SettleFinding)

_LINES = 40  # of the spectrum
_POINTS = 2000  # of the section of a motion without period


def work_settle(study: Study, file: Keeper | None, report: Callable[..., object] | None = None) -> SettleFinding:
    """Find where a motion settles, and what it is there; see `gapwalk.studies.jobs.Job`."""
    options = study.options
    assert isinstance(options, SettleStudyOptions)
    settled = settle(study.system, options.start, options.limits)
    attractor = identify(settled, ClassifyOptions(options.limits, options.lyapunov))
    motion = motion_of(attractor, settled)
    section = strobe(study.system, motion.state, motion.period or _POINTS, options.phase)
    lines = tuple(spectrum(motion, options.signal).peaks(_LINES))
    finding = SettleFinding(options, attractor, motion, section.states, rattle(motion), lines)
    if file is not None:
        file.write(SETTLED.entry(finding))
    return finding


def read_settled(study: Study, parts: Parts) -> SettleFinding:
    """What has been found; see `gapwalk.studies.jobs.Job`."""
    finding = parts.one(SETTLED)
    if finding.options != study.options:
        raise ValueError("the motion does not belong to the study")
    return finding

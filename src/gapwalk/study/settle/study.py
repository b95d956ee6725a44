"""The job of a settled motion: it has one part, all of it."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from gapwalk.attractor.classify import ClassifyOptions, identify
from gapwalk.attractor.impact import Impact
from gapwalk.attractor.line import line_name
from gapwalk.attractor.plain import attractor_of, plain_attractor
from gapwalk.attractor.rattle import ContactLoad, Impulsiveness, Rattle, SideRattle, rattle
from gapwalk.attractor.section import strobe
from gapwalk.attractor.settle import settle
from gapwalk.attractor.settled import Settled
from gapwalk.attractor.spectrum import Peak, spectrum
from gapwalk.model.system import System
from gapwalk.study.file import Study
from gapwalk.study.settle.finding import SettleFinding, motion_of
from gapwalk.study.settle.study_options import SettleStudyOptions
from gapwalk.study.store.chunk_store import open_chunks

_LINES = 40  # of the spectrum
_POINTS = 2000  # of the section of a motion without period


def work_settle(
    study: Study, shelf: os.PathLike[str] | None, report: Callable[..., object] | None = None
) -> SettleFinding:
    """Find where a motion settles, and what it is there; see `gapwalk.study.jobs.Job`."""
    options = study.options
    assert isinstance(options, SettleStudyOptions)
    settled = settle(study.system, options.start, options.limits)
    attractor = identify(settled, ClassifyOptions(options.limits, options.lyapunov))
    motion = motion_of(attractor, settled)
    section = strobe(study.system, motion.state, motion.period or _POINTS, options.phase)
    lines = spectrum(motion, options.signal).peaks(_LINES)
    finding = SettleFinding(options, attractor, motion, section.states, rattle(motion), lines)
    if shelf is not None:
        open_chunks(shelf, {}).add(0, json.dumps(_plain(finding)).encode())
    return finding


def read_settled(study: Study, parts: Mapping[int, bytes]) -> SettleFinding:
    """What has been found; see `gapwalk.study.jobs.Job`."""
    options = study.options
    assert isinstance(options, SettleStudyOptions)
    plain = json.loads(parts[0])
    attractor = attractor_of(plain["attractor"], study.system)
    about = plain["settled"]
    settled = Settled(
        study.system,
        attractor.strobes,
        int(about["periods"]),
        bool(about["converged"]),
        attractor.orbit,
        float(about["residual"]),
        tuple(str(sentence) for sentence in about["evidence"]),
    )
    section = np.array(plain["section"], dtype=float)
    if section.ndim != 2 or section.shape[1] != 2 * study.system.size:
        raise ValueError(f"a section of shape {section.shape} is none of this system")
    lines = tuple(_line(study.system.turns, *line) for line in plain["lines"])
    return SettleFinding(options, attractor, settled, section, _rattle(plain["rattle"], study.system), lines)


def _line(turns: int | None, name: object, order: object, height: object) -> Peak:
    """A stored line; older results count those of a train per period of the excitation, not per turn."""
    line = Peak(str(name), float(order), float(height))  # pyright: ignore[reportArgumentType]
    if turns is None or line.name.startswith("order"):
        return line
    return Peak(line_name(line.order * turns, range(1, 13), 1e-9, turns), line.order * turns, line.amplitude)


def _plain(finding: SettleFinding) -> dict[str, Any]:
    settled, loud = finding.settled, finding.rattle
    about = {name: getattr(settled, name) for name in ("periods", "converged", "residual", "evidence")}
    parts = {name: [asdict(each) for each in getattr(loud, name)] for name in _PARTS}
    return {
        "attractor": plain_attractor(finding.attractor),
        "settled": about,
        "section": finding.section.tolist(),
        "lines": [list(line) for line in finding.lines],
        "rattle": {"periods": loud.periods, **parts},
    }


_PARTS: dict[str, type[Any]] = {
    "sides": SideRattle,
    "contacts": ContactLoad,
    "coordinates": Impulsiveness,
    "impacts": Impact,
}


def _rattle(plain: Any, system: System) -> Rattle:
    parts = {name: tuple(kind(**each) for each in plain[name]) for name, kind in _PARTS.items()}
    return Rattle(system, int(plain["periods"]), **parts)

"""Titles of results: what each one is, in one line, such as ``speed 3000 to 800 rpm, stage2.clearance = 0.5``."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from gapwalk.attractors.attractor import AttractorKind, Settled
from gapwalk.model.system import System
from gapwalk.model.words import pace_words, parameter_symbol, value_words
from gapwalk.orbit.orbit import Orbit
from gapwalk.studies.options import RangeStudy
from gapwalk.studies.settle_study import SettleFinding, SettleStudyOptions, rest_words
from gapwalk.studies.study_file import Study

_MOST = 3  # changed values that a title names
_SAME = 1e-12  # relative difference up to which a value counts as that of the file
_PLAIN = "response"  # the kind of study whose titles need not name it


def along_words(system: System, parameter: str, begin: float, end: float) -> str:
    """Write the range of a walk: ``speed 3000 to 800 rpm``."""
    units = system.units
    words = f"{name_words(system, parameter)} {begin:.6g} to {end:.6g}"
    return " ".join(filter(None, (words, units and units.parameter(parameter))))


def name_words(system: System, parameter: str) -> str:
    """Write the name of a parameter without its unit."""
    return parameter_symbol(parameter, system.units).partition(" [")[0]


def study_title(study: Study, values: Mapping[str, float]) -> str:
    """Return the title of a study of the file, computed with changed values."""
    options, system = study.options, study.system
    parameter = getattr(options, "parameter", "")
    parts = [
        f"{study.name}:" if study.name not in ("", parameter) else "",
        "" if options.kind == _PLAIN else options.kind,
    ]
    if isinstance(options, RangeStudy):
        parts.append(along_words(system, options.parameter, options.begin, options.end))
    if isinstance(options, SettleStudyOptions):
        parts[1:] = [f"settled at {pace_words(system)}"]
        values = {name: value for name, value in values.items() if name != system.structure.pace}
    title = " ".join(filter(None, parts)) or options.kind
    return title + _listed([value_words(value, name, system.units, 6) for name, value in values.items()])


def changed_words(system: System, base: System | None, others: Collection[str]) -> str:
    """Return the values in which a system differs from that of the file, for the end of a title."""
    if base is None or base.structure != system.structure:
        return ""
    one, two = (np.asarray(each.values, dtype=float) for each in (system, base))
    places = np.flatnonzero(np.abs(one - two) > _SAME * np.maximum(np.abs(one), np.abs(two))).tolist()
    names = [system.structure.names[place] for place in places]
    return _listed([value_words(system[name], name, system.units, 6) for name in names if name not in others])


def _listed(words: list[str]) -> str:
    shown = [f", {each}" for each in words[:_MOST]]
    return "".join(shown) + (f" and {len(words) - _MOST} more" if len(words) > _MOST else "")


def verdict(motion: Orbit | Settled, finding: SettleFinding | None = None) -> str:
    """Describe a motion in a few words: ``torus, rotation number 0.313``."""
    attractor = None if finding is None else finding.attractor
    orbit = motion if isinstance(motion, Orbit) else motion.orbit
    if orbit is not None:
        return ", ".join([f"period {orbit.period}, {orbit.instability.words}", *rest_words(orbit)])
    if attractor is None:
        return "not periodic" if not isinstance(motion, Settled) or motion.converged else "not settled"
    words = "kind not known" if attractor.kind is AttractorKind.UNDECIDED else attractor.label
    if attractor.rotation is not None:
        words += f", rotation number {attractor.rotation.number:.6g}"
    if attractor.kind is AttractorKind.CHAOTIC and attractor.lyapunov is not None:
        words += f", largest exponent {attractor.lyapunov.exponents[0]:.3g}"
    return words

"""Walks the solution branches of vibrating systems with gaps."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gapwalk import errors, paper
    from gapwalk.attractor.attractor import Attractor
    from gapwalk.attractor.basins import Basins, BasinShares
    from gapwalk.attractor.classify import ClassifyOptions, classify
    from gapwalk.attractor.contrast import Contrast, contrast
    from gapwalk.attractor.judge import RegimeOptions
    from gapwalk.attractor.lyapunov import lyapunov
    from gapwalk.attractor.match import match
    from gapwalk.attractor.plane import Plane, impact_plane
    from gapwalk.attractor.rattle import rattle
    from gapwalk.attractor.regime import Regime
    from gapwalk.attractor.regimes import Regimes
    from gapwalk.attractor.section import section, strobe
    from gapwalk.attractor.settle import SettleOptions, settle
    from gapwalk.attractor.settled import Settled
    from gapwalk.attractor.spectrum import spectrum
    from gapwalk.attractor.waterfall import waterfall
    from gapwalk.bifurcation.compare import Comparison, compare
    from gapwalk.bifurcation.diagram import Cascade, Diagram, Limb
    from gapwalk.bifurcation.follow import follow
    from gapwalk.bifurcation.locus import Locus, follow_locus
    from gapwalk.bifurcation.search import SearchOptions, SearchResult, search
    from gapwalk.bifurcation.switch import switch
    from gapwalk.continuation.branch import Branch, Kind, SpecialPoint
    from gapwalk.continuation.options import WalkOptions
    from gapwalk.continuation.point import BranchPoint
    from gapwalk.measurement.alignment import Alignment, align
    from gapwalk.measurement.damping import DampingMatch, impact_damping_of, match_impact_damping
    from gapwalk.measurement.fit import Fit, FitOptions, fit
    from gapwalk.measurement.read import read_measurement
    from gapwalk.measurement.record import Record
    from gapwalk.model.contact import Contact, DampingLaw, Side, Stage, backlash, stop
    from gapwalk.model.damping import ModalDamping, ProportionalDamping
    from gapwalk.model.excitation import Harmonic
    from gapwalk.model.modes import Modes, modes_of
    from gapwalk.model.rest import Equilibrium, Rest, rest_of
    from gapwalk.model.system import System
    from gapwalk.model.train import Gear, Inertia, Shaft, Train, chain
    from gapwalk.motion.hysteresis import Hysteresis, hysteresis
    from gapwalk.motion.mass import MassOptions, mass_flow_of
    from gapwalk.motion.motion import integrate
    from gapwalk.orbit.balance import Balance
    from gapwalk.orbit.find import find_orbit
    from gapwalk.orbit.orbit import Orbit
    from gapwalk.orbit.shooting import Shooting
    from gapwalk.reduction import Reduction, reduce
    from gapwalk.study.basins.basins import BasinOptions, basin_shares, basins
    from gapwalk.study.basins.store import load_basins
    from gapwalk.study.compare import compare_results
    from gapwalk.study.comparison import ResultComparison
    from gapwalk.study.diagram.diagram import DiagramOptions, diagram
    from gapwalk.study.family.family import family
    from gapwalk.study.family.options import FamilyOptions
    from gapwalk.study.family.over import Over
    from gapwalk.study.family.record import Family
    from gapwalk.study.family.store import load_family
    from gapwalk.study.file import Study, read_studies, read_study
    from gapwalk.study.map import Map, MapOptions, bifurcation_map
    from gapwalk.study.options import DiagramStudyOptions, MapStudyOptions, ResponseOptions, SecondParameter
    from gapwalk.study.regimes.mapping import RegimeMapOptions, regimes
    from gapwalk.study.regimes.store import load_regimes
    from gapwalk.study.result import Result
    from gapwalk.study.run import run
    from gapwalk.study.store.stored import load
    from gapwalk.study.sweep.options import SweepOptions
    from gapwalk.study.sweep.record import Sweep
    from gapwalk.study.sweep.store import load_sweep
    from gapwalk.study.sweep.sweeping import sweep
    from gapwalk.study.work.workers import on_cluster, workers

    __version__: str

__all__ = [
    "Alignment",
    "Attractor",
    "Balance",
    "BasinOptions",
    "BasinShares",
    "Basins",
    "Branch",
    "BranchPoint",
    "Cascade",
    "ClassifyOptions",
    "Comparison",
    "Contact",
    "Contrast",
    "DampingLaw",
    "DampingMatch",
    "Diagram",
    "DiagramOptions",
    "DiagramStudyOptions",
    "Equilibrium",
    "Family",
    "FamilyOptions",
    "Fit",
    "FitOptions",
    "Gear",
    "Harmonic",
    "Hysteresis",
    "Inertia",
    "Kind",
    "Limb",
    "Locus",
    "Map",
    "MapOptions",
    "MapStudyOptions",
    "MassOptions",
    "ModalDamping",
    "Modes",
    "Orbit",
    "Over",
    "Plane",
    "ProportionalDamping",
    "Record",
    "Reduction",
    "Regime",
    "RegimeMapOptions",
    "RegimeOptions",
    "Regimes",
    "ResponseOptions",
    "Rest",
    "Result",
    "ResultComparison",
    "SearchOptions",
    "SearchResult",
    "SecondParameter",
    "SettleOptions",
    "Settled",
    "Shaft",
    "Shooting",
    "Side",
    "SpecialPoint",
    "Stage",
    "Study",
    "Sweep",
    "SweepOptions",
    "System",
    "Train",
    "WalkOptions",
    "__version__",
    "align",
    "backlash",
    "basin_shares",
    "basins",
    "bifurcation_map",
    "chain",
    "classify",
    "compare",
    "compare_results",
    "contrast",
    "diagram",
    "errors",
    "family",
    "find_orbit",
    "fit",
    "follow",
    "follow_locus",
    "hysteresis",
    "impact_damping_of",
    "impact_plane",
    "integrate",
    "load",
    "load_basins",
    "load_family",
    "load_regimes",
    "load_sweep",
    "lyapunov",
    "mass_flow_of",
    "match",
    "match_impact_damping",
    "modes_of",
    "on_cluster",
    "paper",
    "rattle",
    "read_measurement",
    "read_studies",
    "read_study",
    "reduce",
    "regimes",
    "rest_of",
    "run",
    "search",
    "section",
    "settle",
    "spectrum",
    "stop",
    "strobe",
    "sweep",
    "switch",
    "waterfall",
    "workers",
]

# Each name is imported when it is first asked for: `gapwalk --help` must not wait for a compiler to load.
_HOMES = {
    "Alignment": "measurement.alignment",
    "Attractor": "attractor.attractor",
    "Balance": "orbit.balance",
    "BasinOptions": "study.basins.basins",
    "BasinShares": "attractor.basins",
    "Basins": "attractor.basins",
    "Branch": "continuation.branch",
    "BranchPoint": "continuation.point",
    "Cascade": "bifurcation.diagram",
    "ClassifyOptions": "attractor.classify",
    "Comparison": "bifurcation.compare",
    "Contact": "model.contact",
    "Contrast": "attractor.contrast",
    "DampingLaw": "model.contact",
    "DampingMatch": "measurement.damping",
    "Diagram": "bifurcation.diagram",
    "DiagramOptions": "study.diagram.diagram",
    "DiagramStudyOptions": "study.options",
    "Equilibrium": "model.rest",
    "Family": "study.family.record",
    "FamilyOptions": "study.family.options",
    "Fit": "measurement.fit",
    "FitOptions": "measurement.fit",
    "Gear": "model.train",
    "Harmonic": "model.excitation",
    "Hysteresis": "motion.hysteresis",
    "Inertia": "model.train",
    "Kind": "continuation.branch",
    "Limb": "bifurcation.diagram",
    "Locus": "bifurcation.locus",
    "Map": "study.map",
    "MapOptions": "study.map",
    "MapStudyOptions": "study.options",
    "MassOptions": "motion.mass",
    "ModalDamping": "model.damping",
    "Modes": "model.modes",
    "Orbit": "orbit.orbit",
    "Over": "study.family.over",
    "Plane": "attractor.plane",
    "ProportionalDamping": "model.damping",
    "Record": "measurement.record",
    "Reduction": "reduction",
    "Regime": "attractor.regime",
    "RegimeMapOptions": "study.regimes.mapping",
    "RegimeOptions": "attractor.judge",
    "Regimes": "attractor.regimes",
    "ResponseOptions": "study.options",
    "Rest": "model.rest",
    "Result": "study.result",
    "ResultComparison": "study.comparison",
    "SearchOptions": "bifurcation.search",
    "SearchResult": "bifurcation.search",
    "SecondParameter": "study.options",
    "SettleOptions": "attractor.settle",
    "Settled": "attractor.settled",
    "Shaft": "model.train",
    "Shooting": "orbit.shooting",
    "Side": "model.contact",
    "SpecialPoint": "continuation.branch",
    "Stage": "model.contact",
    "Study": "study.file",
    "Sweep": "study.sweep.record",
    "SweepOptions": "study.sweep.options",
    "System": "model.system",
    "Train": "model.train",
    "WalkOptions": "continuation.options",
    "align": "measurement.alignment",
    "backlash": "model.contact",
    "basin_shares": "study.basins.basins",
    "basins": "study.basins.basins",
    "bifurcation_map": "study.map",
    "chain": "model.train",
    "classify": "attractor.classify",
    "compare": "bifurcation.compare",
    "compare_results": "study.compare",
    "contrast": "attractor.contrast",
    "diagram": "study.diagram.diagram",
    "family": "study.family.family",
    "find_orbit": "orbit.find",
    "fit": "measurement.fit",
    "follow": "bifurcation.follow",
    "follow_locus": "bifurcation.locus",
    "hysteresis": "motion.hysteresis",
    "impact_damping_of": "measurement.damping",
    "impact_plane": "attractor.plane",
    "integrate": "motion.motion",
    "load": "study.store.stored",
    "load_basins": "study.basins.store",
    "load_family": "study.family.store",
    "load_regimes": "study.regimes.store",
    "load_sweep": "study.sweep.store",
    "lyapunov": "attractor.lyapunov",
    "mass_flow_of": "motion.mass",
    "match": "attractor.match",
    "match_impact_damping": "measurement.damping",
    "modes_of": "model.modes",
    "on_cluster": "study.work.workers",
    "rattle": "attractor.rattle",
    "read_measurement": "measurement.read",
    "read_studies": "study.file",
    "read_study": "study.file",
    "reduce": "reduction",
    "regimes": "study.regimes.mapping",
    "rest_of": "model.rest",
    "run": "study.run",
    "search": "bifurcation.search",
    "section": "attractor.section",
    "settle": "attractor.settle",
    "spectrum": "attractor.spectrum",
    "stop": "model.contact",
    "strobe": "attractor.section",
    "sweep": "study.sweep.sweeping",
    "switch": "bifurcation.switch",
    "waterfall": "attractor.waterfall",
    "workers": "study.work.workers",
}
_MODULES = ("errors", "paper")


def __getattr__(name: str) -> Any:
    if name == "__version__":
        value: Any = _version()
    elif name in _HOMES:
        value = getattr(import_module(f"gapwalk.{_HOMES[name]}"), name)
    elif name in _MODULES:
        value = import_module(f"gapwalk.{name}")
    else:
        raise AttributeError(f"module 'gapwalk' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("gapwalk")
    except PackageNotFoundError:  # run from the source tree without installation
        return "0+unknown"

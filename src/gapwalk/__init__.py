"""Walks the solution branches of vibrating systems with gaps."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from gapwalk.homes import HOMES

if TYPE_CHECKING:
    from gapwalk import errors, paper, plot
    from gapwalk.attractor.attractor import Attractor
    from gapwalk.attractor.basins import Basins, BasinShares
    from gapwalk.attractor.classify import ClassifyOptions, classify
    from gapwalk.attractor.contrast import Contrast, contrast
    from gapwalk.attractor.judge import RegimeOptions
    from gapwalk.attractor.lyapunov import LyapunovOptions, lyapunov
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
    from gapwalk.bifurcation.branch import Branch, SpecialPoint
    from gapwalk.bifurcation.compare import Comparison, compare
    from gapwalk.bifurcation.diagram import Cascade, Diagram, Limb
    from gapwalk.bifurcation.follow import BranchWalk, follow, walk
    from gapwalk.bifurcation.kinds import Event, Kind
    from gapwalk.bifurcation.locus import Locus, follow_locus
    from gapwalk.bifurcation.search import SearchOptions, SearchResult, search
    from gapwalk.bifurcation.switch import switch
    from gapwalk.continuation.options import WalkOptions
    from gapwalk.continuation.point import BranchPoint
    from gapwalk.explorer.kept import save_html
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
    from gapwalk.model.train import (
        Gear,
        Inertia,
        PaperNumbers,
        Scales,
        Shaft,
        Train,
        chain,
        nondimensional,
        paper_numbers,
    )
    from gapwalk.motion.hysteresis import Hysteresis, hysteresis
    from gapwalk.motion.mass import MassOptions, mass_flow_of
    from gapwalk.motion.motion import integrate
    from gapwalk.motion.signal import Signal
    from gapwalk.notebook.progress import show_progress
    from gapwalk.orbit.balance import Balance
    from gapwalk.orbit.find import find_orbit
    from gapwalk.orbit.orbit import Orbit
    from gapwalk.orbit.shooting import Shooting
    from gapwalk.reduction import Reduction, reduce
    from gapwalk.study.basins.basins import basin_shares, basins
    from gapwalk.study.basins.options import BasinOptions
    from gapwalk.study.compare import compare_results
    from gapwalk.study.comparison import ResultComparison
    from gapwalk.study.diagram.diagram import DiagramOptions, diagram
    from gapwalk.study.diagram.others import find_others
    from gapwalk.study.export import save_tables
    from gapwalk.study.family.family import family
    from gapwalk.study.family.options import FamilyOptions
    from gapwalk.study.family.over import Over
    from gapwalk.study.family.record import Family
    from gapwalk.study.file import Study, read_studies, read_study
    from gapwalk.study.load import load
    from gapwalk.study.locus.study_options import LocusStudyOptions
    from gapwalk.study.map import Map, MapOptions, bifurcation_map
    from gapwalk.study.options import DiagramStudyOptions, MapStudyOptions, ResponseOptions, SecondParameter
    from gapwalk.study.regimes.mapping import regimes
    from gapwalk.study.regimes.options import RegimeMapOptions
    from gapwalk.study.result import Result
    from gapwalk.study.run import run
    from gapwalk.study.settle.finding import SettleFinding
    from gapwalk.study.settle.study_options import SettleStudyOptions
    from gapwalk.study.sweep.options import SweepOptions
    from gapwalk.study.sweep.record import Sweep
    from gapwalk.study.sweep.sweeping import sweep
    from gapwalk.study.verify import verify
    from gapwalk.study.work.workers import on_cluster, workers
    from gapwalk.verification import Check, Verification

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
    "BranchWalk",
    "Cascade",
    "Check",
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
    "Event",
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
    "LocusStudyOptions",
    "LyapunovOptions",
    "Map",
    "MapOptions",
    "MapStudyOptions",
    "MassOptions",
    "ModalDamping",
    "Modes",
    "Orbit",
    "Over",
    "PaperNumbers",
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
    "Scales",
    "SearchOptions",
    "SearchResult",
    "SecondParameter",
    "SettleFinding",
    "SettleOptions",
    "SettleStudyOptions",
    "Settled",
    "Shaft",
    "Shooting",
    "Side",
    "Signal",
    "SpecialPoint",
    "Stage",
    "Study",
    "Sweep",
    "SweepOptions",
    "System",
    "Train",
    "Verification",
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
    "find_others",
    "fit",
    "follow",
    "follow_locus",
    "hysteresis",
    "impact_damping_of",
    "impact_plane",
    "integrate",
    "load",
    "lyapunov",
    "mass_flow_of",
    "match",
    "match_impact_damping",
    "modes_of",
    "nondimensional",
    "on_cluster",
    "paper",
    "paper_numbers",
    "plot",
    "rattle",
    "read_measurement",
    "read_studies",
    "read_study",
    "reduce",
    "regimes",
    "rest_of",
    "run",
    "save_html",
    "save_tables",
    "search",
    "section",
    "settle",
    "show_progress",
    "spectrum",
    "stop",
    "strobe",
    "sweep",
    "switch",
    "verify",
    "walk",
    "waterfall",
    "workers",
]

# Each name is imported when it is first asked for: `gapwalk --help` must not wait for a compiler to load.
_MODULES = ("errors", "paper", "plot")


def __getattr__(name: str) -> Any:
    if name == "__version__":
        value: Any = _version()
    elif name in HOMES:
        value = getattr(import_module(f"gapwalk.{HOMES[name]}"), name)
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

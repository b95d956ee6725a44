"""Walks the solution branches of vibrating systems with gaps."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from gapwalk.homes import HOMES

if TYPE_CHECKING:
    from gapwalk import errors, paper, plot
    from gapwalk.attractors.attractor import Attractor, Settled
    from gapwalk.attractors.attractor_catalogue import match
    from gapwalk.attractors.basins import Basins, BasinShares
    from gapwalk.attractors.classify import ClassifyOptions, classify
    from gapwalk.attractors.contrast import Contrast, contrast
    from gapwalk.attractors.lyapunov import LyapunovOptions, lyapunov
    from gapwalk.attractors.rattle import rattle
    from gapwalk.attractors.regime_judge import RegimeOptions
    from gapwalk.attractors.regimes import Regime, Regimes
    from gapwalk.attractors.section import Plane, impact_plane, section, strobe
    from gapwalk.attractors.settle import SettleOptions, settle
    from gapwalk.attractors.spectrum import spectrum, waterfall
    from gapwalk.bifurcation.branch import Branch, SpecialPoint
    from gapwalk.bifurcation.branch_comparison import Comparison, compare
    from gapwalk.bifurcation.branch_start import switch
    from gapwalk.bifurcation.diagram import Cascade, Diagram, DiagramBranch
    from gapwalk.bifurcation.follow import BranchWalk, follow, walk
    from gapwalk.bifurcation.isolated import SearchOptions, SearchResult, search
    from gapwalk.bifurcation.kinds import Event, Kind
    from gapwalk.bifurcation.loci import Locus, follow_locus
    from gapwalk.continuation.branch_point import BranchPoint
    from gapwalk.continuation.walk_options import WalkOptions
    from gapwalk.ensemble import BatchOptions, batch_flow_of
    from gapwalk.explorer.saved_page import save_html
    from gapwalk.flow.hysteresis import Hysteresis, hysteresis
    from gapwalk.flow.motion import integrate
    from gapwalk.flow.signal import Signal
    from gapwalk.measurement.alignment import Alignment, align
    from gapwalk.measurement.damping_match import DampingMatch, impact_damping_of, match_impact_damping
    from gapwalk.measurement.fit import Fit, FitOptions, fit
    from gapwalk.measurement.measured_record import Record
    from gapwalk.measurement.read_record import read_measurement
    from gapwalk.model.contact import Contact, Side, Stage, backlash, stop
    from gapwalk.model.damping import ModalDamping, ProportionalDamping
    from gapwalk.model.drivetrain import (
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
    from gapwalk.model.equilibria import Equilibrium, Rest, rest_of
    from gapwalk.model.laws import Law
    from gapwalk.model.loads import Harmonic, Load
    from gapwalk.model.modes import Modes, modes_of
    from gapwalk.model.system import System
    from gapwalk.notebook import show_progress
    from gapwalk.orbit.find import find_orbit
    from gapwalk.orbit.harmonic_balance import Balance
    from gapwalk.orbit.orbit import Orbit
    from gapwalk.orbit.shooting import Shooting
    from gapwalk.parallel.workers import on_cluster, workers
    from gapwalk.reduction import Reduction, reduce
    from gapwalk.studies.basin_study import basins
    from gapwalk.studies.basin_work import BasinOptions, basin_shares
    from gapwalk.studies.compare import ResultComparison, compare_results
    from gapwalk.studies.diagram_study import DiagramOptions, DiagramStudyOptions, diagram, find_others
    from gapwalk.studies.export import save_tables
    from gapwalk.studies.family import Family, MemberParameter
    from gapwalk.studies.family_joining import FamilyOptions
    from gapwalk.studies.family_study import family
    from gapwalk.studies.load import load
    from gapwalk.studies.locus_study import LocusStudyOptions
    from gapwalk.studies.map import Map, MapOptions
    from gapwalk.studies.map_study import MapStudyOptions, bifurcation_map
    from gapwalk.studies.options import SecondParameter
    from gapwalk.studies.regime_study import RegimeMapOptions, regimes
    from gapwalk.studies.response_study import ResponseOptions
    from gapwalk.studies.result import Result
    from gapwalk.studies.runner import run
    from gapwalk.studies.settle_study import SettleFinding, SettleStudyOptions
    from gapwalk.studies.study_file import Study, read_studies, read_study
    from gapwalk.studies.sweep import Sweep, SweepOptions
    from gapwalk.studies.sweep_study import sweep
    from gapwalk.studies.verify import verify
    from gapwalk.verification import Check, Verification

    __version__: str

__all__ = [
    "Alignment",
    "Attractor",
    "Balance",
    "BasinOptions",
    "BasinShares",
    "Basins",
    "BatchOptions",
    "Branch",
    "BranchPoint",
    "BranchWalk",
    "Cascade",
    "Check",
    "ClassifyOptions",
    "Comparison",
    "Contact",
    "Contrast",
    "DampingMatch",
    "Diagram",
    "DiagramBranch",
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
    "Law",
    "Load",
    "Locus",
    "LocusStudyOptions",
    "LyapunovOptions",
    "Map",
    "MapOptions",
    "MapStudyOptions",
    "MemberParameter",
    "ModalDamping",
    "Modes",
    "Orbit",
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
    "batch_flow_of",
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

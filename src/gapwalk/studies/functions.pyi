"""Signatures of the functions of studies; ``python -m tests.release.stubs`` writes this file."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from gapwalk.answers.campbell import Campbell
from gapwalk.answers.design import Design
from gapwalk.answers.goals import NoPoint, PeakBelow, Quiet, Resonance
from gapwalk.answers.least_change import Change
from gapwalk.answers.rattle_bands import RattleBands
from gapwalk.answers.scan import Scan
from gapwalk.answers.scan_claims import AlikeClaim, LoopClaim, MotionClaim, PointClaim, RangeClaim, SizeClaim
from gapwalk.answers.threshold import Threshold
from gapwalk.answers.tolerance import Spread, Spreads, Tolerance
from gapwalk.attractors.basins import Basins
from gapwalk.attractors.regimes import Regimes
from gapwalk.bifurcation.diagram import Diagram
from gapwalk.bifurcation.isolated.search_starts import SearchOptions
from gapwalk.bifurcation.special_point import Kind
from gapwalk.continuation.walk import WalkOptions
from gapwalk.model.system import System
from gapwalk.orbit.method import Method
from gapwalk.orbit.orbit import Orbit
from gapwalk.parallel.workers import Workers
from gapwalk.studies.bifurcation_map import Map
from gapwalk.studies.branch_family import Family, MemberParameter
from gapwalk.studies.rattle_chance import RattleChance
from gapwalk.studies.runner import Report
from gapwalk.studies.share_study import ShareCurve
from gapwalk.studies.study_kind import StudyKind
from gapwalk.studies.sweep_study import Sweep

FUNCTIONS: dict[str, str]

def keywords_of(kind: type[StudyKind]) -> Iterator[Any]: ...
def function_of(kind: type[StudyKind], name: str) -> Callable[..., Any]: ...
def basins(
    system: System,
    plane: Mapping[str, tuple[float, float]],
    resolution: int | tuple[int, int] = ...,
    *,
    longest: int = ...,
    max_period: int = ...,
    tries: int = ...,
    exact_borders: bool = ...,
    check: int = ...,
    seed: int = ...,
    fixed: Mapping[str, float] = ...,
    workers: Workers | int | None = ...,
    report: Report | None = ...,
    output: str | os.PathLike[str] | None = ...,
) -> Basins: ...
def bifurcation_map(
    system: System,
    plane: Mapping[str, tuple[float, float]],
    *,
    period: int = ...,
    start: str | Sequence[float] = ...,
    walk: WalkOptions = ...,
    method: Method = ...,
    sections: int | Sequence[float] = ...,
    max_period: int = ...,
    kinds: Sequence[Kind] = ...,
    search_values: int | Sequence[float] = ...,
    search: SearchOptions = ...,
    workers: Workers | int | None = ...,
    report: Report | None = ...,
    output: str | os.PathLike[str] | None = ...,
) -> Map: ...
def campbell(
    system: System,
    parameter: str,
    to: tuple[float, float],
    *,
    orders: Sequence[float] = ...,
    points: int = ...,
    workers: Workers | int | None = ...,
    report: Report | None = ...,
    output: str | os.PathLike[str] | None = ...,
) -> Campbell: ...
def design(
    system: System,
    changes: Mapping[str, float] | Sequence[Change],
    goals: NoPoint | Quiet | PeakBelow | Resonance | Sequence[NoPoint | Quiet | PeakBelow | Resonance],
    parameter: str,
    to: tuple[float, float],
    *,
    period: int = ...,
    start: str | Sequence[float] = ...,
    starts: int = ...,
    steps: int = ...,
    margin: float = ...,
    seed: int = ...,
    walk: WalkOptions = ...,
    search_values: int | Sequence[float] = ...,
    search: SearchOptions = ...,
    workers: Workers | int | None = ...,
    report: Report | None = ...,
    output: str | os.PathLike[str] | None = ...,
) -> Design: ...
def diagram(
    system: System,
    parameter: str,
    to: tuple[float, float],
    *,
    period: int = ...,
    start: str | Sequence[float] | Orbit = ...,
    walk: WalkOptions = ...,
    method: Method = ...,
    max_period: int = ...,
    max_branches: int = ...,
    search_values: int | Sequence[float] = ...,
    search: SearchOptions = ...,
    workers: Workers | int | None = ...,
    report: Report | None = ...,
    output: str | os.PathLike[str] | None = ...,
) -> Diagram: ...
def family(
    system: System,
    parameter: str,
    to: tuple[float, float],
    over: MemberParameter | Mapping[str, Sequence[float]],
    *,
    period: int = ...,
    start: str | Sequence[float] = ...,
    walk: WalkOptions = ...,
    method: Method = ...,
    max_period: int | None = ...,
    kinds: Sequence[Kind] = ...,
    exact: bool = ...,
    workers: Workers | int | None = ...,
    report: Report | None = ...,
    output: str | os.PathLike[str] | None = ...,
) -> Family: ...
def rattle_bands(
    system: System,
    parameter: str,
    to: tuple[float, float],
    gaps: str | Sequence[str] = ...,
    *,
    start: str | Sequence[float] = ...,
    second: Mapping[str, tuple[float, float]] | None = ...,
    resolution: tuple[int, int] = ...,
    steps: int = ...,
    longest: int = ...,
    patience: int = ...,
    by: str = ...,
    walk: WalkOptions = ...,
    search: int | None = ...,
    starts: int = ...,
    seed: int = ...,
    reference: float = ...,
    check: int = ...,
    workers: Workers | int | None = ...,
    report: Report | None = ...,
    output: str | os.PathLike[str] | None = ...,
) -> RattleBands: ...
def rattle_chance(
    system: System,
    spreads: Spreads | Sequence[Spread],
    *,
    values: Sequence[float] = ...,
    gaps: str | Sequence[str] = ...,
    samples: int = ...,
    starts: int = ...,
    seed: int = ...,
    workers: Workers | int | None = ...,
    report: Report | None = ...,
    output: str | os.PathLike[str] | None = ...,
) -> RattleChance: ...
def regimes(
    system: System,
    plane: Mapping[str, tuple[float, float]],
    resolution: int | tuple[int, int] = ...,
    *,
    start: str | Sequence[float] = ...,
    carry: str = ...,
    longest: int = ...,
    max_period: int = ...,
    forces: bool = ...,
    check: int = ...,
    seed: int = ...,
    workers: Workers | int | None = ...,
    report: Report | None = ...,
    output: str | os.PathLike[str] | None = ...,
) -> Regimes: ...
def scan(
    system: System,
    claims: Sequence[MotionClaim | PointClaim | RangeClaim | SizeClaim | AlikeClaim | LoopClaim],
    parameters: str | Sequence[str] = ...,
    *,
    listed: Sequence[Mapping[str, float]] = ...,
    factors: Sequence[float] = ...,
    pairs: int = ...,
    neighbours: int = ...,
    spread: float = ...,
    starts: int = ...,
    seed: int = ...,
    longest: int = ...,
    max_period: int = ...,
    forces: bool = ...,
    check: int = ...,
    workers: Workers | int | None = ...,
    report: Report | None = ...,
    output: str | os.PathLike[str] | None = ...,
) -> Scan: ...
def shares(
    system: System,
    parameter: str,
    to: tuple[float, float],
    box: Mapping[str, tuple[float, float]],
    *,
    points: int = ...,
    starts: int = ...,
    confidence: float = ...,
    seed: int = ...,
    workers: Workers | int | None = ...,
    report: Report | None = ...,
    output: str | os.PathLike[str] | None = ...,
) -> ShareCurve: ...
def sweep(
    system: System,
    parameter: str,
    to: tuple[float, float],
    *,
    steps: int = ...,
    ways: str = ...,
    points: int = ...,
    starts: int | Sequence[Sequence[float]] = ...,
    seed: int = ...,
    max_period: int = ...,
    shortest: int = ...,
    longest: int = ...,
    tolerance: float = ...,
    kick: float = ...,
    workers: Workers | int | None = ...,
    report: Report | None = ...,
    output: str | os.PathLike[str] | None = ...,
) -> Sweep: ...
def threshold(
    system: System,
    parameter: str,
    to: tuple[float, float],
    over: Mapping[str, tuple[float, float]],
    gaps: str | Sequence[str] = ...,
    *,
    values: int = ...,
    starts: int = ...,
    periods: int = ...,
    rounds: int = ...,
    seed: int = ...,
    workers: Workers | int | None = ...,
    report: Report | None = ...,
    output: str | os.PathLike[str] | None = ...,
) -> Threshold: ...
def tolerance(
    system: System,
    parameter: str,
    to: tuple[float, float],
    spreads: Spreads | Sequence[Spread],
    *,
    band: tuple[float, float] | None = ...,
    start: str | Sequence[float] = ...,
    samples: int = ...,
    seed: int = ...,
    check: int = ...,
    period: int = ...,
    walk: WalkOptions = ...,
    accuracy: float = ...,
    workers: Workers | int | None = ...,
    report: Report | None = ...,
    output: str | os.PathLike[str] | None = ...,
) -> Tolerance: ...

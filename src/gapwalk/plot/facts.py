"""What stands on the card of each type that users meet in a notebook."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial, singledispatch

import numpy as np
from matplotlib.axes import Axes

from gapwalk.attractor.basins import Basins
from gapwalk.attractor.regimes import Regimes
from gapwalk.attractor.settled import Settled
from gapwalk.bifurcation.branch import Branch, Kind, SpecialPoint
from gapwalk.bifurcation.compare import Comparison
from gapwalk.bifurcation.diagram import Diagram
from gapwalk.measurement.fit import Fit
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit
from gapwalk.plot.basins import plot_basins
from gapwalk.plot.branch import plot_branches
from gapwalk.plot.card import Card
from gapwalk.plot.history import plot_history
from gapwalk.plot.map import plot_map
from gapwalk.plot.regimes import plot_regimes
from gapwalk.plot.style import BLUE
from gapwalk.plot.words import pace_words, parameter_symbol
from gapwalk.study.family.record import Family
from gapwalk.study.map.chart import Map
from gapwalk.study.result import Result
from gapwalk.study.sweep.record import Sweep

_FEW = 8  # names that are listed
_LARGE = 40  # branches of which no small picture is drawn


@singledispatch
def facts_of(value: object) -> Card:
    """The card of a value; of a type that has none of its own, what `repr` says."""
    name, _, rest = repr(value).partition("(")
    parts = rest.removesuffix(")").split("; ")
    return Card(name, [("", part) for part in parts])


@facts_of.register
def _(system: System) -> Card:
    structure = system.structure
    contacts = [
        (contact.name, _listed(f"{stage.name or contact.name} ({stage.side.value})" for stage in contact.stages))
        for contact in structure.contacts
    ]
    orders = [f"{form.name} (order {form.order * (system.turns or 1):g})" for form in structure.harmonics]
    facts = [
        ("coordinates", _listed(system.coordinates)),
        _pace(system),
        ("excitation", _listed(orders) or "none"),
        ("named parameters", str(len(system.parameters))),
    ]
    if system.units:
        facts.append(("units", system.units.words))
    return Card("System", facts, ("contact", "stages"), contacts)


@facts_of.register
def _(orbit: Orbit) -> Card:
    facts = [
        _pace(orbit.system),
        ("period", _periods(orbit.period)),
        ("stability", "stable" if orbit.stable else f"unstable ({orbit.instability.label})"),
        ("largest multiplier", f"{np.abs(orbit.multipliers).max():.6g}"),
        ("contacts", orbit.pattern),
    ]
    return Card("Orbit", facts, draw=partial(_draw_motion, orbit))


@facts_of.register
def _(special: SpecialPoint) -> Card:
    facts = [
        ("at", f"{special.value:.10g} ± {special.uncertainty:.0e}"),
        ("stability", special.change),
        ("nature", special.nature_words),
        ("contact", special.contact),
        ("period", _periods(special.orbit.period)),
    ]
    return Card(f"SpecialPoint: {special.kind.value}", [fact for fact in facts if fact[1]])


@facts_of.register
def _(branch: Branch) -> Card:
    values = branch.values
    facts = [
        (parameter_symbol(branch.parameter, branch.system.units), f"{values.min():.8g} to {values.max():.8g}"),
        ("period", _periods(branch.period)),
        ("points", f"{len(values)}, {sum(point.stable for point in branch.points)} of them stable"),
    ]
    rows = [
        (special.kind.value, f"{special.value:.8g}", special.change)
        for special in branch.special_points
        if special.kind is not Kind.GRAZING
    ]
    grazing = len(branch.special(Kind.GRAZING))
    note = f"and {grazing} grazing points" if grazing else ""
    return Card("Branch", facts, ("special point", "at", "stability"), rows, partial(_draw_branches, [branch]), note)


@facts_of.register
def _(diagram: Diagram) -> Card:
    low, high = diagram.within
    rows = [
        (limb.name, f"{limb.branch.values.min():.6g} to {limb.branch.values.max():.6g}", _kinds([limb.branch]))
        for limb in diagram.limbs
    ]
    facts = [(diagram.parameter, f"{low:.8g} to {high:.8g}"), ("branches", str(len(diagram.limbs)))]
    draw = partial(_draw_branches, diagram.branches) if diagram.limbs else None
    return Card("Diagram", facts, ("branch", "from, to", "special points"), rows, draw)


@facts_of.register
def _(chart: Map) -> Card:
    rows = [
        (name, locus.kind.value, str(len(locus.points))) for name, locus in zip(chart.names, chart.loci, strict=True)
    ]
    facts = [("over", f"{chart.first}, {chart.second}"), ("sections", str(len(chart.sections)))]
    return Card("Map", facts, ("locus", "of", "points"), rows, partial(plot_map, chart, labels=False, legend=False))


@facts_of.register
def _(family: Family) -> Card:
    values = [member.value for member in family.members]
    facts = [
        (family.parameter, "{:.8g} to {:.8g}".format(*family.within)),
        ("over", f"{family.over.name} = {_listed(f'{value:.6g}' for value in values)}"),
        ("special points", _kinds(family.branches) if family.branches else "none"),
    ]
    return Card("Family", facts, draw=partial(_draw_branches, family.branches) if family.branches else None)


@facts_of.register
def _(settled: Settled) -> Card:
    facts = [
        _pace(settled.system),
        ("period", _periods(settled.period) if settled.period else "not periodic"),
        ("settled", f"{'after' if settled.converged else 'not within'} {settled.periods} forcing periods"),
        *(("", text) for text in settled.evidence[:3]),
    ]
    return Card("Settled", facts, draw=partial(_draw_motion, settled.orbit) if settled.orbit else None)


@facts_of.register
def _(found: Basins) -> Card:
    total = sum(found.cells.values()) + found.unresolved + found.runaway
    rows = [(name, f"{count / total:.1%}") for name, count in found.cells.items()]
    facts = [("cells", " x ".join(map(str, found.resolution))), ("check", found.check.text)]
    return Card("Basins", facts, ("attractor", "share"), rows, partial(plot_basins, found))


@facts_of.register
def _(found: Regimes) -> Card:
    rows, columns = found.regimes.shape
    facts = [("over", f"{found.first}, {found.second}"), ("cells", f"{columns} x {rows}")]
    return Card("Regimes", facts, draw=partial(plot_regimes, found))


@facts_of.register
def _(sweep: Sweep) -> Card:
    facts = [
        (sweep.parameter, f"{sweep.values.min():.8g} to {sweep.values.max():.8g}"),
        ("steps", str(len(sweep.values))),
    ]
    names, counts = np.unique(sweep.regimes[sweep.regimes != ""], return_counts=True)
    rows = sorted(zip(map(str, names), map(str, counts), strict=True), key=lambda row: -int(row[1]))
    return Card("Sweep", facts, ("settled to", "times"), rows, partial(_draw_sweep, sweep))


@facts_of.register
def _(fit: Fit) -> Card:
    rows = [(each.name, str(each)) for each in fit.estimates]
    facts = [("rms error", f"{fit.before.agreement.rms:.4g} to {fit.after.agreement.rms:.4g}")]
    return Card("Fit", facts, ("parameter", "fitted"), rows, note="; ".join(fit.failures))


@facts_of.register
def _(found: Comparison) -> Card:
    rows = [(match.first.kind.value, f"{match.first.value:.8g}", f"{match.difference:.2g}") for match in found.matches]
    facts = [
        ("over", found.parameter),
        ("largest distance", f"{found.largest:.2g} of the ranges"),
        ("only in one", f"{len(found.only_first)} and {len(found.only_second)} special points"),
    ]
    return Card("Comparison", facts, ("both have", "at", "difference"), rows)


@facts_of.register
def _(result: Result) -> Card:
    """The card of what is in it, under the title of the study."""
    within = result.diagram or result.map or (result.finding and result.finding.record)
    if within is None and len(result.branches) == 1:
        within = result.branches[0]
    state = ("study", result.options.kind + ("" if result.complete else ", not complete"))
    if within is None:
        return Card(result.title or "Result", [state, ("branches", str(len(result.branches)))])
    card = facts_of(within)
    return card._replace(title=result.title or "Result", facts=[state, *card.facts])


def _draw_branches(branches: Iterable[Branch], ax: Axes | None = None) -> None:
    branches = list(branches)[:_LARGE]
    plot_branches(branches, ax=ax, labels=False, legend=False)


def _draw_motion(orbit: Orbit, ax: Axes) -> None:
    plot_history(orbit.motion(), orbit.system.coordinates[0], ax=ax)


def _draw_sweep(sweep: Sweep, ax: Axes) -> None:
    """The first coordinate once every forcing period, over the parameter."""
    for lane in sweep.sections:
        points = lane.shape[1]
        ax.plot(np.repeat(sweep.values, points), lane[:, :, 0].ravel(), ".", color=BLUE, markersize=1.5)
    ax.set_xlabel(sweep.parameter)
    ax.set_ylabel(sweep.system.coordinates[0])


def _kinds(branches: Iterable[Branch]) -> str:
    found = [special.kind for branch in branches for special in branch.special_points]
    return ", ".join(f"{found.count(kind)} {kind.value}" for kind in Kind if kind in found) or "none"


def _periods(period: int) -> str:
    return f"{period} forcing period{'s' if period > 1 else ''}"


def _listed(names: Iterable[str]) -> str:
    """The first names of some, and how many more there are."""
    names = list(names)
    more = f", and {len(names) - _FEW} more" if len(names) > _FEW else ""
    return ", ".join(names[:_FEW]) + more


def _pace(system: System) -> tuple[str, str]:
    symbol, _, value = pace_words(system).partition(" = ")
    return symbol, value

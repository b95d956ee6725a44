"""Cards of values in a notebook: a name, a table of the main figures, and a small picture."""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable, Sequence
from functools import singledispatch
from typing import Any, NamedTuple

import numpy as np

from gapwalk.attractors.attractor import Settled
from gapwalk.attractors.basins import Basins
from gapwalk.attractors.regimes import Regimes
from gapwalk.bifurcation.branch import Branch, Kind, SpecialPoint
from gapwalk.bifurcation.branch_comparison import Comparison
from gapwalk.bifurcation.diagram import Diagram
from gapwalk.errors import GapwalkError
from gapwalk.measurement.fit import Fit
from gapwalk.model.system import System
from gapwalk.model.words import pace_words, parameter_symbol
from gapwalk.orbit.orbit import Orbit
from gapwalk.plot.picture import drawing_of
from gapwalk.plot.sheet import new_sheet, png_bytes
from gapwalk.plot.style import CARD, in_style, sized
from gapwalk.studies.family import Family
from gapwalk.studies.map import Map
from gapwalk.studies.result import Result
from gapwalk.studies.sweep import Sweep

_CELL = "text-align: left; padding: 1px 12px 1px 0; background: none; vertical-align: top"
_MOST = 12  # most rows of a table
_FEW = 8  # most names in a list
_DPI = 110


class Card(NamedTuple):
    """Contents of a card.

    Parameters
    ----------
    title
        Title of the card.
    facts
        Name and value of each main figure.
    head, rows
        An optional table: the names of its columns, and its rows.
    note
        Optional further text.
    drawn
        The record to draw, if it is not the value itself.
    """

    title: str
    facts: Sequence[tuple[str, str]]
    head: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    note: str = ""
    drawn: Any = None


def card_of(value: object) -> str:
    """Write the card of a value as HTML, with the colours of the page and without external files."""
    card = facts_of(value)
    parts = [f"<b>{html.escape(card.title)}</b>", _table((), card.facts, len(card.facts))]
    if card.rows:
        parts.append(_table(card.head, card.rows, _MOST))
    if card.note:
        parts.append(f"<div>{html.escape(card.note)}</div>")
    left = f'<div style="flex: 0 1 auto">{"".join(parts)}</div>'
    picture = _picture(value if card.drawn is None else card.drawn)
    return f'<div style="display: flex; flex-wrap: wrap; gap: 4px 24px; align-items: flex-start">{left}{picture}</div>'


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], most: int) -> str:
    lines = [_row(head, "th")] if head else []
    lines += [_row(row, "td") for row in rows[:most]]
    if len(rows) > most:
        lines.append(_row([f"and {len(rows) - most} more"], "td"))
    return f'<table style="margin: 4px 0; border: none">{"".join(lines)}</table>'


def _row(cells: Sequence[str], kind: str) -> str:
    texts = "".join(f'<{kind} style="{_CELL}">{html.escape(cell)}</{kind}>' for cell in cells)
    return f'<tr style="background: none; border: none">{texts}</tr>'


def _picture(record: object) -> str:
    """Draw a small picture embedded in the page; return an empty text if there is none."""
    try:
        drawing, _ = drawing_of(record, in_axes=True)
        plain = {name: False for name in ("labels", "legend") if name in drawing.options}
        with sized(CARD), in_style():
            figure = new_sheet()
            if finish := drawing.draw(record, figure.add_subplot(), **plain):
                finish()
            data = base64.b64encode(png_bytes(figure, _DPI)).decode()
    except GapwalkError:
        return ""
    return f'<img alt="" style="max-width: 460px; margin: 0" src="data:image/png;base64,{data}">'


@singledispatch
def facts_of(value: object) -> Card:
    """Return the contents of the card of a value; without a function for its type, those of its `repr`."""
    name, _, rest = repr(value).partition("(")
    return Card(name, [("", part) for part in rest.removesuffix(")").split("; ")])


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
    return Card("Orbit", facts)


@facts_of.register
def _(special: SpecialPoint) -> Card:
    words = special.words | {"period": _periods(special.orbit.period)}
    return Card(f"SpecialPoint: {words.pop('kind')}", [fact for fact in words.items() if fact[1]])


@facts_of.register
def _(branch: Branch) -> Card:
    values = branch.values
    facts = [
        (parameter_symbol(branch.parameter, branch.system.units), f"{values.min():.8g} to {values.max():.8g}"),
        ("period", _periods(branch.period)),
        ("points", f"{len(values)}, {sum(point.stable for point in branch.points)} of them stable"),
    ]
    rows = [
        [special.words[column] for column in ("kind", "at", "stability")]
        for special in branch.special_points
        if special.kind is not Kind.GRAZING
    ]
    note = f"and {grazing} grazing points" if (grazing := len(branch.special(Kind.GRAZING))) else ""
    return Card("Branch", facts, ("special point", "at", "stability"), rows, note)


@facts_of.register
def _(diagram: Diagram) -> Card:
    low, high = diagram.within
    rows = [
        (member.name, f"{member.branch.values.min():.6g} to {member.branch.values.max():.6g}", _kinds([member.branch]))
        for member in diagram.members
    ]
    facts = [(diagram.parameter, f"{low:.8g} to {high:.8g}"), ("branches", str(len(diagram.members)))]
    return Card("Diagram", facts, ("branch", "from, to", "special points"), rows)


@facts_of.register
def _(chart: Map) -> Card:
    rows = [
        (name, locus.kind.value, str(len(locus.points))) for name, locus in zip(chart.names, chart.loci, strict=True)
    ]
    facts = [("over", f"{chart.first}, {chart.second}"), ("sections", str(len(chart.sections)))]
    return Card("Map", facts, ("locus", "of", "points"), rows)


@facts_of.register
def _(family: Family) -> Card:
    values = [member.value for member in family.members]
    facts = [
        (family.parameter, "{:.8g} to {:.8g}".format(*family.within)),
        ("over", f"{family.over.name} = {_listed(f'{value:.6g}' for value in values)}"),
        ("special points", _kinds(family.branches) if family.branches else "none"),
    ]
    return Card("Family", facts)


@facts_of.register
def _(settled: Settled) -> Card:
    facts = [
        _pace(settled.system),
        ("period", _periods(settled.period) if settled.period else "not periodic"),
        ("settled", f"{'after' if settled.converged else 'not within'} {settled.periods} forcing periods"),
        *(("", text) for text in settled.evidence[:3]),
    ]
    return Card("Settled", facts)


@facts_of.register
def _(found: Basins) -> Card:
    total = sum(found.cells.values()) + found.unresolved + found.runaway
    rows = [(name, f"{count / total:.1%}") for name, count in found.cells.items()]
    facts = [("cells", " x ".join(map(str, found.resolution))), ("check", found.check.text)]
    return Card("Basins", facts, ("attractor", "share"), rows)


@facts_of.register
def _(found: Regimes) -> Card:
    rows, columns = found.regimes.shape
    return Card("Regimes", [("over", f"{found.first}, {found.second}"), ("cells", f"{columns} x {rows}")])


@facts_of.register
def _(sweep: Sweep) -> Card:
    facts = [
        (sweep.parameter, f"{sweep.values.min():.8g} to {sweep.values.max():.8g}"),
        ("steps", str(len(sweep.values))),
    ]
    names, counts = np.unique(sweep.regimes[sweep.regimes != ""], return_counts=True)
    rows = sorted(zip(map(str, names), map(str, counts), strict=True), key=lambda row: -int(row[1]))
    return Card("Sweep", facts, ("settled on", "times"), rows)


@facts_of.register
def _(fit: Fit) -> Card:
    rows = [(each.name, str(each)) for each in fit.estimates]
    facts = [("rms error", f"{fit.before.agreement.rms:.4g} to {fit.after.agreement.rms:.4g}")]
    return Card("Fit", facts, ("parameter", "fitted"), rows, "; ".join(fit.failures))


@facts_of.register
def _(found: Comparison) -> Card:
    rows = [(match.first.kind.value, f"{match.first.value:.8g}", f"{match.difference:.2g}") for match in found.matches]
    facts = [
        ("over", found.parameter),
        ("largest distance", f"{found.largest:.2g} of the ranges"),
        ("only in one", f"{len(found.only_first)} and {len(found.only_second)} special points"),
    ]
    return Card("Comparison", facts, ("in both", "at", "difference"), rows)


@facts_of.register
def _(result: Result) -> Card:
    """Return the card of the content of a result, under the title of its study."""
    within = result.diagram or result.map or (result.finding and result.finding.record)
    if within is None and len(result.branches) == 1:
        within = result.branches[0]
    title = result.title or "Result"
    state = ("study", result.options.kind + ("" if result.complete else ", not complete"))
    if within is None:
        return Card(title, [state, ("branches", str(len(result.branches)))])
    card = facts_of(within)
    return card._replace(title=title, facts=[state, *card.facts], drawn=within)


def _kinds(branches: Iterable[Branch]) -> str:
    found = [special.kind for branch in branches for special in branch.special_points]
    return ", ".join(f"{found.count(kind)} {kind.value}" for kind in Kind.known() if kind in found) or "none"


def _periods(period: int) -> str:
    return f"{period} forcing period{'s' if period > 1 else ''}"


def _listed(names: Iterable[str]) -> str:
    """List the first names, and the number of further ones."""
    names = list(names)
    more = f", and {len(names) - _FEW} more" if len(names) > _FEW else ""
    return ", ".join(names[:_FEW]) + more


def _pace(system: System) -> tuple[str, str]:
    symbol, _, value = pace_words(system).partition(" = ")
    return symbol, value

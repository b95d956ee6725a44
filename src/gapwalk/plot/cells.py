"""Pictures of basins of attraction, of regime maps, and of sweeps with strips of regimes."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, to_rgb
from numpy.typing import ArrayLike, NDArray

from gapwalk.attractors.basin_boundary import Manifold
from gapwalk.attractors.basins import IMPOSSIBLE, RUNAWAY, UNRESOLVED, Basins, BasinShares
from gapwalk.attractors.regimes import Regime, Regimes, regime_word
from gapwalk.attractors.settle import AttractorKind
from gapwalk.bifurcation.loci import Locus
from gapwalk.errors import ModelError
from gapwalk.flow.motion import contact_to_show
from gapwalk.meanings import FILLS
from gapwalk.model.words import coordinate_words, parameter_words, state_words
from gapwalk.picture_parts import START, Cells, Parts, Picture, Series, curves_of_loci, pictured
from gapwalk.plot import style
from gapwalk.plot.picture import AnyFigure, Finish, Inches, drawing_of, draws, is_narrow, stacked, write_legend
from gapwalk.studies.sweep_study import Sweep, Way

Ranges = tuple[tuple[float, float], tuple[float, float]]


_OTHERS = ((RUNAWAY, "#3a3a3a"), (UNRESOLVED, "#ffffff"), (IMPOSSIBLE, "#c9c9c9"))
_STROBES = ("in the plane", "all", "none")
_IN_PLANE = 1e-6  # distance, relative to the size of the plane, below which a strobe lies in it
_FORCES = "cividis"  # of peak forces and impacts: perceptually uniform for any colour vision

_SWEEP: Inches = (8.0, 5.4)
_WAYS = {Way.UP: ("up", style.FIRST), Way.DOWN: ("down", style.SECOND), Way.AGAIN: ("again", style.BLACK)}
_STRIP = 0.16  # height of a strip, in inches
_UNDER_LEGEND = 0.75  # share of a narrow picture that its legend of several rows leaves
_MOST_STRIPS = 12
_SPARSE = 6e4  # number of points up to which they are opaque and large; more are fainter and smaller, so that the shape
# of dense regions shows
_LETTER = 5.0  # width of a letter in a strip, in points


def _fill(ax: Axes, cells: NDArray[Any], within: Ranges, words: tuple[str, str], **options: Any) -> Any:
    """Fill the cells of a plane with colours."""
    extent = (*within[0], *within[1])
    fixed = {"origin": "lower", "aspect": "auto", "interpolation": "nearest", "zorder": 1}
    image = ax.imshow(cells, extent=extent, **fixed, **options)
    ax.grid(visible=False)
    ax.set(xlim=within[0], ylim=within[1], xlabel=words[0], ylabel=words[1])
    return image


def fill_colors(ax: Axes, codes: NDArray[Any], colors: Sequence[str], within: Ranges, words: tuple[str, str]) -> None:
    """Fill the cells of a plane with the colours of their codes 0, 1, ..."""
    _fill(ax, codes, within, words, cmap=ListedColormap(colors), vmin=-0.5, vmax=len(colors) - 0.5)


@pictured(Manifold, size=(6.6, 6.2), forms=("axes",))
def manifold_picture(found: Manifold) -> Picture:
    """Describe both sides of a manifold, and its saddle, in the plane of the first coordinate and its rate."""
    system, look = found.system, "first" if found.which == "unstable" else "main"  # black: it lies over basins
    names = system.state_names[0], system.state_names[system.size]

    def plane(states: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        rows = states.reshape(-1, system.state_size)
        return rows[:, 0], rows[:, system.size]

    axes = f"{START}{names[0]}", f"{START}{names[1]}"

    def parts() -> Parts:
        sides = [Series(*plane(side), "line", look, axes=axes) for side in (found.first, found.second)]
        sides[0] = sides[0]._replace(text=f"{found.which} manifold")
        saddle = Series(*plane(found.orbit.state), "dots", "main", "saddle", axes=axes)
        return Parts(layers=[*sides, saddle], quantities=axes)

    x_words, y_words = (coordinate_words(name, system.units) for name in names)
    return Picture(system, axes, (), parts, words=(x_words, y_words))


@pictured(Basins, size=(6.6, 6.2), forms=("axes",))
def basins_picture(found: Basins, *, strobes: str = "in the plane") -> Picture:
    """Describe the plane of initial states, each cell in the colour of its attractor, with the states of motions."""
    if strobes not in _STROBES:
        raise ModelError(f'strobes is {strobes!r}; write "in the plane", "all" or "none"')
    window, units = found.window, found.system.units
    across, up = (f"{coordinate_words(name, units)} at the start" for name in (window.across, window.up))
    shares = [f"{name} {count / found.labels.size:.1%}" for name, count in (*found.cells.items(), *_others(found))]
    return Picture(
        found.system,
        (f"{START}{window.across}", f"{START}{window.up}"),
        (),
        partial(_parts_of_basins, found, strobes),
        sentences=[f"Of {found.labels.size:,} starts: {', '.join(shares)}"],
        words=(across, up),
        note=found.check.text,
    )


def _others(found: Basins) -> list[tuple[str, int]]:
    return [(text, count) for text, count in found.others.items() if count]


def _parts_of_basins(found: Basins, strobes: str) -> Parts:
    axes, share = (f"{START}{found.window.across}", f"{START}{found.window.up}"), 100.0 / found.labels.size
    entries = [
        (f"{name} ({share * count:.1f} %)", FILLS[k % len(FILLS)])
        for k, (name, count) in enumerate(found.cells.items())
    ]
    codes = np.array(found.labels)
    for (text, count), (label, color) in zip(found.others.items(), _OTHERS, strict=True):
        if count:
            codes[found.labels == label] = len(entries)
            entries.append((f"{text} ({share * count:.2g} %)", color))
    orbits = [
        Series(*xy, "stars", "worst", f"orbit of {found.names[k]}", axes=axes, symbol=f"marker-{k}")
        for k, xy in _marked_strobes(found, strobes)
    ]
    within = dict(zip(axes, found.window.within, strict=True))
    return Parts(layers=orbits, cells=[Cells(codes, entries, found.window.within)], within=within, quantities=axes)


def _marked_strobes(found: Basins, which: str) -> Iterator[tuple[int, tuple[ArrayLike, ArrayLike]]]:
    """Yield the attractors with strobes to mark, and the positions of these strobes in the plane."""
    box = found.window.box
    shown = [box.names.index(name) for name in (found.window.across, found.window.up)]
    low, high = np.array(box.low), np.array(box.high)
    fixed = low == high
    for index, attractor in enumerate(found.attractors):
        if attractor.kind is AttractorKind.PERIODIC and which != "none":
            distances = np.abs(attractor.strobes - low)[:, fixed] / (high - low).max()
            states = attractor.strobes[(distances <= _IN_PLANE).all(axis=1) | (which == "all")]
            if len(states):
                yield index, (states[:, shown[0]], states[:, shown[1]])


# ------------------------------------------------------------------------------------------------- maps of regimes


@pictured(Regimes, size=stacked(1), forms=("axes",))
def regimes_picture(found: Regimes, *, loci: Iterable[Locus] = (), labels: str = "period") -> Picture:
    """Describe the kinds of motion in the plane of two parameters; `loci` and `labels` are as in `draw_regimes`."""
    checked, different = found.check.checked, len(found.check.different)
    shares = ", ".join(f"{name} {count / found.regimes.size:.1%}" for name, count in found.cells.items())
    return Picture(
        found.system,
        (found.first, found.second),
        curves_of_loci(loci, "{}"),
        partial(_parts_of_regimes, found, labels),
        sentences=[f"Of {found.regimes.size:,} cells: {shares}"],
        note=f"checked with the exact flow: {different} of {checked} cells differed"
        if checked
        else "not checked with the exact flow",
    )


def _parts_of_regimes(found: Regimes, labels: str = "period") -> Parts:
    """Return the cells, of which periodic motions are named first."""
    if labels not in ("period", "z") or (labels == "z" and not found.impacts.shape[2]):
        raise ModelError(f'labels is {labels!r}; write "period", or "z" for a map with figures of contacts')
    codes, entries = np.zeros(found.regimes.shape, dtype=int), list[tuple[str, str]]()
    within = dict(zip((found.first, found.second), found.within, strict=True))
    if labels == "z":
        for text, color, cells in _parts_by_z(found):
            codes[cells] = len(entries)
            entries.append((text, color))
        return Parts(cells=[Cells(codes, entries, found.within)], within=within)
    kinds = np.unique(np.stack((found.regimes, found.periods), axis=-1).reshape(-1, 2), axis=0)
    for text, word in style.regime_entries({regime_word(*pair) for pair in kinds.tolist()}).items():
        m = style.period_of(word)
        if m is None:
            cells = found.regimes == next(regime for regime in Regime if regime.text == word)
        else:
            cells = found.periods == m if m <= style.NAMED_PERIODS else found.periods > style.NAMED_PERIODS
        codes[cells] = len(entries)
        entries.append((text, style.regime_color(word)))
    return Parts(cells=[Cells(codes, entries, found.within)], within=within)


def _parts_by_z(found: Regimes) -> Iterator[tuple[str, str, NDArray[np.bool_]]]:
    """Yield a text, a colour and the cells of the commonest impacts per period, of all others, and of other regimes."""
    common = [z for z, _ in Counter(filter(None, found.z.ravel().tolist())).most_common(style.NAMED_PERIODS)]
    for number, z in enumerate(sorted(common, key=lambda z: [int(each) for each in re.findall(r"\d+", z)][::-1])):
        yield f"z = {z}", style.AREA_OF_ONE if number == 0 else style.period_color(number + 1), found.z == z
    others = (found.regimes == Regime.PERIODIC) & ~np.isin(found.z, common)
    if others.any():
        yield "other z", style.period_color(11), others
    for regime in (each for each in Regime if each != Regime.PERIODIC and (found.regimes == each).any()):
        yield regime.text, style.regime_color(regime.text), found.regimes == regime


@draws(Regimes, panels=True, size=lambda found, panels=None, **_: stacked(1 + len(_shown(found, panels))))
def draw_regimes(
    found: Regimes,
    figure: AnyFigure,
    *,
    panels: Sequence[str] | None = None,
    loci: Iterable[Locus] = (),
    contact: int | str | None = None,
    labels: str = "period",
    title: str = "",
) -> None:
    """Draw a regime map: kinds of motion in the plane of two parameters, and the severity of contacts.

    Periodic motions have the colour of their period, or with `labels` ``"z"`` of their impacts per period.
    """
    shown = _shown(found, panels)
    axes = figure.subplots(1 + len(shown), 1, sharex=True, squeeze=False)[:, 0]
    axes[0].set_title(title, wrap=True)
    drawing_of(found, in_axes=True)[0].draw(found, axes[0], loci=loci, labels=labels)
    for which, ax in zip(shown, axes[1:], strict=True):
        _draw_forces(found, which, contact, ax)
    for ax in axes[:-1]:
        ax.set_xlabel("")


def _shown(found: Regimes, panels: Sequence[str] | None) -> Sequence[str]:
    contacts = found.peak_force.shape[2]
    if panels and not contacts:
        raise ModelError("the map has no figures of contacts; write panels=()")
    for which in panels or ():
        if which not in ("peak force", "impacts"):
            raise ModelError(f'there is no figure {which!r} of a contact; write "peak force" or "impacts"')
    if panels is None:
        panels = ["impacts" if _rigid(found).all() else "peak force"] if contacts else []
    return panels


def _rigid(found: Regimes) -> NDArray[np.bool_]:
    """Return which contacts with figures are rigid stops."""
    return np.array([form.law.rebounds for form in found.system.structure.contacts][: found.peak_force.shape[2]])


def _draw_forces(found: Regimes, which: str, contact: int | str | None, ax: Axes) -> None:
    """Draw the peak force or the impacts per period of one contact in the plane, with a colour scale."""
    place = _contact_index(found, which, contact)
    name = found.system.structure.contacts[place].name
    cells = (found.peak_force if which == "peak force" else found.impacts)[..., place]
    top = float(np.nanquantile(cells, 0.998)) if np.isfinite(cells).any() else 1.0
    axes = parameter_words(found.first, found.system.units), parameter_words(found.second, found.system.units)
    image = _fill(ax, cells, found.within, axes, cmap=_FORCES, vmin=0.0, vmax=max(top, np.finfo(float).tiny))
    text = f"peak force of {name}" if which == "peak force" else f"impacts of {name} per forcing period"
    ax.figure.colorbar(image, ax=ax, label=text, pad=0.015, fraction=0.05, extend="max")


def _contact_index(found: Regimes, which: str, contact: int | str | None) -> int:
    names, rigid = [form.name for form in found.system.structure.contacts][: found.peak_force.shape[2]], _rigid(found)
    if contact is None:
        figures = found.peak_force if which == "peak force" and not rigid.all() else found.impacts
        largest = np.nan_to_num(figures).reshape(-1, len(names)).max(axis=0)
        contact = contact_to_show(found.system, "", np.where(rigid & (figures is found.peak_force), -1.0, largest))
    place = names.index(contact) if contact in names else contact
    if isinstance(place, int) and 0 <= place < len(names):
        if which == "peak force" and rigid[place]:
            raise ModelError(
                f"{names[place]} is a rigid stop, and its impacts have no finite force; write panels=['impacts']"
            )
        return place
    raise ModelError(f"the map has no figures of a contact {contact!r}; contacts are {', '.join(names)}")


def draw_locus(ax: Axes, plane: tuple[str, str], locus: Locus) -> dict[str, Any]:
    """Draw a locus in black on white, visible on any colour; return the options of its line."""
    if (locus.first, locus.second) != plane:
        raise ModelError(
            f"a locus is in the plane of {locus.first} and {locus.second}, and the map in that of {' and '.join(plane)}"
        )
    x, y = (np.vstack((locus.values, locus.values[:1])) if locus.is_closed else locus.values).T
    options = style.locus_options(locus.kind) | {"color": style.BLACK, "linewidth": style.points(1.1)}
    ax.plot(x, y, color="white", linewidth=style.points(2.6), zorder=3)
    ax.plot(x, y, zorder=4, **options)
    return options


# ---------------------------------------------------------------------------------------------------------- sweeps


@draws(Sweep, panels=True, size=_SWEEP)
def draw_sweep(
    sweep: Sweep, figure: AnyFigure, signal: str | None = None, *, title: str = "", legend: bool = True
) -> Finish:
    """Draw the section points of a sweep over its parameter, below a strip of regimes for each lane."""
    # The points are drawn as an image, so that pictures with a hundred thousand points remain small as SVG or PDF.
    _check(sweep, signal)
    shown = _shown_lanes(sweep)
    above, room = len(shown) * style.points(_STRIP), figure.bbox.height / figure.figure.dpi
    if is_narrow(figure):
        room *= _UNDER_LEGEND
    strips, ax = figure.subplots(2, 1, sharex=True, height_ratios=[above, room - above])
    draw_points(sweep, ax, signal)
    _draw_strips(strips, sweep, shown)
    strips.set_title(title, wrap=True)
    if legend:
        write_legend(figure, _sweep_entries(sweep, shown))
    return partial(_write_periods, strips, sweep, shown)


def _check(sweep: Sweep, signal: str | None) -> str:
    """Return the coordinate to draw; raise a ModelError if it is unknown, or there is nothing to draw yet."""
    place = sweep.place(signal)
    if not np.isfinite(sweep.sections[..., place]).any():
        raise ModelError("the sweep has no section points yet, so there is nothing to draw")
    return sweep.system.state_names[place]


@draws(Sweep)
def draw_points(sweep: Sweep, ax: Axes, signal: str | None = None) -> None:
    """Draw the section points of a sweep in one panel; `signal` is as in `draw_sweep`."""
    coordinate, units = _check(sweep, signal), sweep.system.units
    lanes = sorted(range(len(sweep.lanes)), key=lambda lane: -sweep.lanes[lane].way.number)  # up over down
    count = max(1, sum(len(sweep.section(coordinate, lane)[0]) for lane in lanes))
    alpha = float(np.clip(np.sqrt(_SPARSE / count), 0.15, 0.8))
    size = float(np.clip(1.1 * (_SPARSE / count) ** 0.25, 1.1, 3.0))
    for lane in lanes:
        color = _WAYS[sweep.lanes[lane].way][1]
        x, y = sweep.section(coordinate, lane)
        ax.plot(x, y, **style.dots(size, color, alpha=alpha, rasterized=True, zorder=2))
    ax.set(xlabel=parameter_words(sweep.parameter, units), ylabel=state_words(coordinate, units))
    ax.set_xlim(sweep.values[0], sweep.values[-1])


def _shown_lanes(sweep: Sweep) -> list[int]:
    """Select the lanes that get a strip: if there are too many, the first starts of each direction."""
    most = max(1, _MOST_STRIPS // len({lane.way for lane in sweep.lanes}))
    return [index for index, lane in enumerate(sweep.lanes) if lane.start <= most]


def _draw_strips(ax: Axes, sweep: Sweep, shown: Sequence[int]) -> None:
    for row, lane in enumerate(shown):
        for band in sweep.bands(lane):
            color = style.regime_color(band.regime)
            ax.barh(row, band.high - band.low, left=band.low, height=0.84, color=color, linewidth=0)
        frame = {"fill": False, "edgecolor": "#8a8a8a", "linewidth": 0.5}
        ax.barh(row, sweep.values[-1] - sweep.values[0], left=sweep.values[0], height=0.84, **frame)
    ax.set_yticks(range(len(shown)), [_lane_words(sweep, lane, len(shown)) for lane in shown], fontsize=style.points(8))
    ax.set_ylim(len(shown) - 0.5, -0.5)
    ax.tick_params(axis="both", length=0)
    ax.tick_params(axis="x", labelbottom=False)
    ax.grid(visible=False)
    ax.spines[:].set_visible(False)


def _lane_words(sweep: Sweep, lane: int, shown: int) -> str:
    """Return the name of a strip; if not all lanes have one, it includes the number of starts."""
    way, start = _WAYS[sweep.lanes[lane].way][0], sweep.lanes[lane].start
    count = max(each.start for each in sweep.lanes)
    if count == 1:
        return way
    return f"{way} {start}" if shown == len(sweep.lanes) else f"{way} {start} of {count}"


def _write_periods(ax: Axes, sweep: Sweep, shown: Sequence[int]) -> None:
    """Write the regime into each band that is wide enough, so that the information does not depend only on colour."""
    width = ax.get_window_extent().width / ax.figure.dpi * 72.0  # known only when the layout is final
    span = sweep.values[-1] - sweep.values[0]
    centered: dict[str, Any] = {"ha": "center", "va": "center_baseline", "fontsize": style.points(6.5)}
    for row, lane in enumerate(shown):
        for band in sweep.bands(lane):
            text = f"P{m}" if (m := style.period_of(band.regime)) is not None else band.regime
            if (band.high - band.low) / span * width > style.points(_LETTER) * len(text) + 2.0:
                red, green, blue = to_rgb(style.regime_color(band.regime))
                color = "white" if 0.3 * red + 0.59 * green + 0.11 * blue < 0.5 else style.BLACK
                ax.text(0.5 * (band.low + band.high), row, text, color=color, **centered)


def _sweep_entries(sweep: Sweep, shown: Sequence[int]) -> list[tuple[str, Any]]:
    ways = list(dict.fromkeys(lane.way for lane in sweep.lanes))
    top = min(way.number for way in ways)
    entries: list[tuple[str, Any]] = [
        (_WAYS[way][0] + " (beneath)" * (way.number > top), style.symbols("o", 4.0, _WAYS[way][1], _WAYS[way][1]))
        for way in ways
    ]
    regimes = {band.regime for lane in shown for band in sweep.bands(lane)}
    return entries + [(text, style.regime_color(regime)) for text, regime in style.regime_entries(regimes).items()]


@draws(BasinShares)
def draw_shares(found: BasinShares, ax: Axes) -> None:
    """Draw the shares of starts as bars, with their confidence limits."""
    shares = found.shares
    sizes = np.array([each.share for each in shares])
    limits = np.abs(np.array([(each.low, each.high) for each in shares]).T - sizes)
    places, fills = np.arange(len(shares))[::-1], [FILLS[number % len(FILLS)] for number in range(len(shares))]
    ax.barh(places, sizes, xerr=limits, color=fills, height=0.6, error_kw={"capsize": 3.0, "linewidth": 1.0})
    ax.set_yticks(places, [each.name for each in shares])
    ax.set(xlim=(0.0, 1.0), xlabel=f"share of {len(found.labels)} starts")

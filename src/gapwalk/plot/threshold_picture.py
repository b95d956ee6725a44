"""Pictures of thresholds: the border of rattle in the plane of both parameters, its quiet side, and the limit."""

from __future__ import annotations

from functools import partial
from textwrap import fill

from matplotlib.axes import Axes

from gapwalk.answers.threshold import Threshold
from gapwalk.model.words import parameter_words
from gapwalk.plot import style
from gapwalk.plot.picture import AnyFigure, Finish, draws, write_answer, write_legend
from gapwalk.plot.style import BLACK, GREY, stroke, symbols

_QUIET = "#e4f0e2"
_GOLD = "#f3c55b"
_LINE = 60  # letters in a line of a reason why nothing is drawn


@draws(Threshold, panels=True)
def draw_threshold_with_answer(found: Threshold, figure: AnyFigure, *, title: str = "") -> Finish | None:
    """Draw the loci, the quiet side and the limit below the answer in a sentence."""
    write_answer(figure, title, [found.sentence])
    return draw_threshold(found, figure.subplots())


@draws(Threshold)
def draw_threshold(found: Threshold, ax: Axes) -> Finish | None:
    """Draw the loci at which rattle begins or ceases, and the side of the parameter on which nothing rattles."""
    units = found.system.units
    ax.set(xlim=(found.low, found.high), ylim=sorted((found.begin, found.end)))
    ax.set_xlabel(parameter_words(found.over, units))
    ax.set_ylabel(parameter_words(found.parameter, units))
    for locus in found.loci:
        ax.plot(*locus.values.T[::-1], zorder=3, **style.locus_options(locus.kind, 0))
    entries = [
        (f"{locus.kind}: rattle begins or ceases", style.locus_options(locus.kind, 0)) for locus in found.loci[-1:]
    ]
    if found.limit is not None:
        ax.axhspan(found.value, found.end, color=_QUIET, linewidth=0, zorder=0)
        ax.axhline(found.value, **stroke(GREY, 0.9, "-", zorder=2))
        ax.plot([found.at], [found.value], zorder=6, **symbols("*", 12.0, _GOLD, BLACK))
        entries += [("nothing rattles", _QUIET), ("limit", symbols("*", 9.0, _GOLD, BLACK))]
    if not found.loci:
        text = ". ".join((*found.notes, *found.failures)) or "nothing was followed"
        options = {"ha": "center", "va": "center", "color": GREY, "transform": ax.transAxes}
        ax.grid(False)
        ax.text(0.5, 0.5, fill(text.replace("$", r"\$"), _LINE), **options)
    write_legend(ax, entries)
    return None if found.limit is None else partial(_name, ax, found)


def _name(ax: Axes, found: Threshold) -> None:
    """Write both values beside the limit, on the quiet side."""
    below = found.end < found.begin
    is_lower = bool(ax.yaxis_inverted()) == below  # of matplotlib, it may be NumPy's
    units = found.system.units
    limit, where = ((value, units and units.parameter(name)) for value, name in _limit(found))
    ax.annotate(
        " at ".join(f"{value:.6g}" + (f" {unit}" if unit else "") for value, unit in (limit, where)),
        (found.at, found.value),
        textcoords="offset points",
        xytext=(0, 9 if is_lower else -9),
        ha="center",
        va="bottom" if is_lower else "top",
        fontsize="small",
    )


def _limit(found: Threshold) -> tuple[tuple[float, str], tuple[float, str]]:
    return (found.value, found.parameter), (found.at, found.over)

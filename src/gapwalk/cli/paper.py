"""``gapwalk paper``: the figures of the paper in a folder that opens as a page, and what the paper says of them."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from gapwalk.cli.console import console
from gapwalk.cli.outcome import DONE, FAILED, print_json, printable
from gapwalk.cli.progress import CountProgress
from gapwalk.paper.claims import CLAIMS, Claim, claims_about
from gapwalk.paper.compute import compute
from gapwalk.paper.document import Checked, claim_document, figure_document, notes
from gapwalk.paper.figure import Figure
from gapwalk.paper.figures import FIGURES, find_figure
from gapwalk.paper.jobs import find_job
from gapwalk.paper.markdown import claims_page
from gapwalk.paper.page import report_page
from gapwalk.paper.reading import USUAL, Reading
from gapwalk.study.export import export_csv, table_names, write_whole
from gapwalk.study.load import load_result
from gapwalk.study.result import Result
from gapwalk.study.work.workers import sharing, workers

_FOLDER = Path("paper")
_FEW = 2
_FORMS = ("png", "svg")


class _Work(NamedTuple):
    """What is asked for: figures in one reading, and the claims about them."""

    figures: tuple[Figure, ...]
    claims: tuple[Claim, ...]
    reading: Reading
    whole: bool

    @property
    def jobs(self) -> tuple[str, ...]:
        keys = [key for figure in self.figures for key in figure.jobs]
        return tuple(dict.fromkeys([*keys, *(key for claim in self.claims for key in claim.jobs)]))


class _Piece(NamedTuple):
    """A figure to draw, and of which of its jobs the tables are to be written."""

    figure: Figure
    tables: tuple[str, ...]
    folder: Path


class _Found(NamedTuple):
    """What has come of it."""

    results: dict[str, Result]
    failures: dict[str, str]
    checked: Checked

    def about(self, figure: Figure) -> Checked:
        return [each for each in self.checked if each[0].figure == str(figure.number)]


def list_figures(*, json: bool) -> int:
    """List the figures."""
    if json:
        print_json([_line(figure) for figure in FIGURES])
        return DONE
    screen = console()
    for figure in FIGURES:
        screen.print(f"{figure.name:3} {figure.kind.value:27} {figure.caption}", soft_wrap=True)
    return DONE


def _line(figure: Figure) -> dict[str, Any]:
    words: dict[str, Any] = {"figure": figure.name, "kind": figure.kind.value, "caption": figure.caption}
    return words | {"notes": notes(figure)}


def run_figures(
    names: Sequence[str], reading: Reading, output: Path | None, *, force: bool = False, json: bool = False
) -> int:
    """Draw figures, or all of them, with what the paper says of them; the exit code is that of the worst."""
    work = _asked(names, reading)
    folder = output or (None if json else _FOLDER)
    pictures: dict[str, list[str]] = {}
    # A figure or two are done before other processes would have started.
    with TemporaryDirectory() as scratch, sharing() if len(work.figures) > _FEW else nullcontext():
        found = _compute(work, (folder or Path(scratch)) / "results", force=force, show=not json)
        if folder is not None:
            pictures = _draw_all(work, found, folder, force=force, show=not json)
    if folder is not None and work.whole:
        _write_page(work, found, pictures, folder)
    if json:
        _print_documents(work, found)
    else:
        _print(work, found, pictures, folder)
    return _code(work, found)


def write_claims(path: Path, output: Path | None, *, force: bool = False) -> int:
    """Check all claims, and write them as a page in Markdown."""
    work = _Work((), CLAIMS, USUAL, whole=False)
    found = _compute(work, (output or _FOLDER) / "results", force=force, show=True)
    write_whole(path, claims_page(found.checked).encode())
    console().print(f"written: {printable(str(path))}", soft_wrap=True)
    _say_what_failed(work, found)
    return _code(work, found)


def _asked(names: Sequence[str], reading: Reading) -> _Work:
    """The figures of these names; an unknown one is refused before anything is computed."""
    figures = tuple(find_figure(name).at(reading) for name in names) or tuple(each.at(reading) for each in FIGURES)
    numbers = dict.fromkeys(figure.number for figure in figures)
    claims = tuple(claim for number in numbers for claim in claims_about(number)) if names else CLAIMS
    # Claims name their own readings: they belong to the report of the default one.
    return _Work(figures, claims if reading == USUAL else (), reading, whole=not names)


def _compute(work: _Work, folder: Path, *, force: bool, show: bool) -> _Found:
    """Do all jobs, read their results back, and check the claims."""
    with CountProgress("paper", len(work.jobs), show=show) as progress:
        computed = compute(work.jobs, folder, force=force, report=progress)
    results = {key: result for key in work.jobs if (result := computed.result(key)) is not None}
    checked = [(claim, claim.check(results, computed.failures)) for claim in work.claims]
    return _Found(results, dict(computed.failures), checked)


def _draw_all(work: _Work, found: _Found, folder: Path, *, force: bool, show: bool) -> dict[str, list[str]]:
    """Draw the figures, several side by side, and write the tables of their jobs; the names of the pictures.

    What is newer than its results, and than gapwalk itself, is left as it is.
    """
    whole = [each for each in work.figures if set(each.jobs) <= set(found.results)]
    changed = _last_change()
    figures = [each for each in whole if force or not _is_drawn(each, folder, changed)]
    drawn = {each.name: _names(each) for each in whole if each not in figures}
    if not figures:
        return drawn
    with CountProgress("pictures", len(whole), show=show) as progress, workers(1) as hands:

        def accept(index: int, names: list[str]) -> None:
            drawn[figures[index].name] = names
            progress(figures[index].name, len(drawn), len(whole))

        hands.run(_draw, _pieces(figures, folder), accept, in_order=False)
    return drawn


def _pieces(figures: Sequence[Figure], folder: Path) -> list[_Piece]:
    """The figures to draw, each with the jobs that no other one has before it: their tables are written with it."""
    pieces, seen = [], set[str]()
    for figure in figures:
        pieces.append(_Piece(figure, tuple(key for key in figure.jobs if key not in seen), folder))
        seen.update(figure.jobs)
    return pieces


def _names(figure: Figure) -> list[str]:
    return [f"{figure.file_name}.{form}" for form in _FORMS]


def _last_change() -> float:
    """When the code that draws was changed last, which is when it was installed."""
    return max(path.stat().st_mtime for path in Path(__file__).parents[1].rglob("*.py"))


def _is_drawn(figure: Figure, folder: Path, changed: float) -> bool:
    """Whether the pictures of a figure, which are written last, show its results as they are."""
    pictures = [folder / name for name in _names(figure)]
    if not all(path.exists() for path in pictures):
        return False
    results = [folder / "results" / f"{key}.gapwalk" for key in figure.jobs]
    newest = max((path.stat().st_mtime for path in results), default=0.0)
    return min(path.stat().st_mtime for path in pictures) > max(changed, newest)


def _draw(piece: _Piece) -> list[str]:
    """Write the pictures of a figure and tables of jobs, and return the names of the pictures."""
    from gapwalk.plot.paper import draw_paper_figure  # only now: nothing else needs matplotlib
    from gapwalk.plot.sheet import sheet_bytes

    figure, tables, folder = piece
    results = {key: load_result(folder / "results" / f"{key}.gapwalk") for key in figure.jobs}
    picture = draw_paper_figure(figure, results)
    for key, result in ((key, results[key]) for key in tables):
        export_csv(result, {name: folder / "results" / f"{key}-{name}.csv" for name in table_names(result)})
    for name, form in zip(_names(figure), _FORMS, strict=True):
        write_whole(folder / name, sheet_bytes(picture, form))
    return _names(figure)


def _write_page(work: _Work, found: _Found, pictures: dict[str, list[str]], folder: Path) -> None:
    page = report_page(work.figures, found.results, found.failures, pictures, found.checked, work.reading)
    write_whole(folder / f"index{work.reading.suffix}.html", page.encode())


def _print_documents(work: _Work, found: _Found) -> None:
    documents = [figure_document(figure, found.results, found.failures, found.about(figure)) for figure in work.figures]
    if work.whole:
        print_json({"figures": documents, "claims": [claim_document(*each) for each in found.checked]})
    else:
        print_json(documents[0] if len(documents) == 1 else documents)


def _print(work: _Work, found: _Found, pictures: dict[str, list[str]], folder: Path | None) -> None:
    screen = console()
    for figure in work.figures:
        screen.print(f"Figure {figure.name}. {figure.caption}", style="bold", soft_wrap=True)
        for name, note in notes(figure).items():
            screen.print(f"  note on the set of figure {name}: {printable(note)}", soft_wrap=True)
        for key in figure.jobs:
            if key in found.results:
                screen.print(f"  {key}: {_sentence(found.results[key])}", soft_wrap=True)
        for claim, outcome in found.about(figure):
            screen.print(f"  {outcome}: {claim.says} ({outcome.evidence})", soft_wrap=True)
        if figure.name in pictures and folder is not None:
            files = ", ".join(str(folder / name) for name in pictures[figure.name])
            screen.print(f"  written: {printable(files)}", soft_wrap=True)
    _say_what_failed(work, found)
    if work.whole and folder is not None:
        screen.print(f"all of it as a page: {folder / f'index{work.reading.suffix}.html'}", soft_wrap=True)


def _sentence(result: Result) -> str:
    if result.diagram is not None:
        return repr(result.diagram).removeprefix("Diagram(").removesuffix(")")
    return repr(result)


def _failures(work: _Work, found: _Found) -> dict[str, str]:
    """What failed of that which was asked for; a reading that a claim looks at besides may fail: that is a finding."""
    shown = {key for figure in work.figures for key in figure.jobs}
    return {key: text for key, text in found.failures.items() if key in shown or find_job(key).reading == work.reading}


def _say_what_failed(work: _Work, found: _Found) -> None:
    for key, text in _failures(work, found).items():
        print(f"gapwalk: {key}: {printable(text)}", file=sys.stderr)


def _code(work: _Work, found: _Found) -> int:
    return FAILED if _failures(work, found) else DONE

"""``gapwalk run``: from the studies of a model file to results, pictures and tables."""

from __future__ import annotations

import shlex
import sys
from contextlib import nullcontext, suppress
from itertools import count
from pathlib import Path
from typing import Any

from rich.console import Console

from gapwalk.cli import output as screen_output
from gapwalk.cli.output import (
    BROKEN,
    DONE,
    FAILED,
    INTERRUPTED,
    console,
    failure_code,
    failure_text,
    print_json,
    printable,
    saying,
    show,
    show_files,
    show_title,
)
from gapwalk.cli.progress import progress_of
from gapwalk.continuation.walk import EndReason
from gapwalk.errors import GapwalkError, ModelError, WorkError
from gapwalk.model.words import parameter_symbol
from gapwalk.parallel.workers import on_cluster
from gapwalk.results.result_file import looks_like_result
from gapwalk.studies.cell_work import CHUNKS
from gapwalk.studies.export import save_tables
from gapwalk.studies.result import Result, check_claim, is_another, open_result
from gapwalk.studies.runner import check_work, run
from gapwalk.studies.set_values import parse_changes
from gapwalk.studies.study_file import Study, read_studies
from gapwalk.studies.study_kind import found_by

_OTHER_ENDINGS = (".csv", ".png", ".svg", ".toml")


def run_file(
    file: Path,
    output: Path | None,
    changes: list[str],
    names: list[str],
    *,
    plain: bool = False,
    scheduler: str | None = None,
    **how: bool,
) -> int:
    """Run the studies of a model file, or the named ones; return the highest exit code."""
    # With the address of a scheduler the work is done on its cluster. With `plain` it is done in non-dimensional form.
    # The keywords `how` are resume, force and json.
    with saying(f"reading {file}"):
        studies = list(read_studies(file, parse_changes(changes), names))
        check_work(studies)
    if plain:
        from gapwalk.studies.study_file import without_units  # imported late: it needs the options of all kinds

        studies = [without_units(study) for study in studies]
    alone = len(studies) == 1
    outputs = [result_path(file, output, study.name, alone=alone) for study in studies]
    for study, path in zip(studies, outputs, strict=True):
        if output is None and not (how["resume"] or how["force"]):
            _make_room(path, study)
        check_claim(path, study, resume=how["resume"], force=how["force"])  # before anything is computed
    resume_words = ["gapwalk", "run", str(file), *(["--units", "none"] if plain else []), "--resume"]
    resume_words += [] if scheduler is None else ["--scheduler", scheduler]
    resume_words += [each for name in names for each in ("--study", name)]
    resume_words += [each for change in changes for each in ("--set", change)]
    codes: list[int] = []
    documents: list[Any] = []
    with nullcontext() if scheduler is None else on_cluster(scheduler):
        for study, path in zip(studies, outputs, strict=True):
            earlier = None if how["resume"] else _file_number(path)
            most = None if scheduler is None or screen_output.is_quiet else study.options.most_workers
            if most is not None:
                helped = "this process alone does the work" if most == 1 else f"at most {most} workers are used"
                show([f"{study.name or study.options.kind}: {helped}"], console(stderr=True))
            try:
                code, document = _run_study(study, path, **how)
            except (GapwalkError, KeyboardInterrupt) as error:
                is_stored = path.exists() and _file_number(path) != earlier
                if isinstance(error, KeyboardInterrupt) and not error.args and not is_stored:
                    kept = f"; {path} is unchanged" * path.exists()
                    error.args = (f"no part was complete, so nothing is stored{kept}",)
                can_resume = isinstance(error, (KeyboardInterrupt, WorkError)) and is_stored
                if alone:
                    if can_resume:
                        _say_how_to_resume(resume_words, path)
                    raise
                code, text = failure_code(error), failure_text(error)
                document = {"name": study.name, "error": {"type": type(error).__name__, "message": text}}
                print(f"gapwalk: {study.name}: {printable(text)}", file=sys.stderr)
                if can_resume and code != INTERRUPTED:
                    _say_how_to_resume(resume_words, output)
            codes.append(code)
            documents.append(document)
            if code == INTERRUPTED:
                _say_how_to_resume(resume_words, path if alone else output)
                break
    if how["json"]:
        print_json(documents[0] if alone else documents)
    return max(codes)


def _make_room(path: Path, study: Study) -> None:
    """Give the result of another text a name of its own, and say which; what cannot be read is left to others."""
    with suppress(GapwalkError):
        if path.is_file() and looks_like_result(path) and is_another(path, study):
            number = next(k for k in count(1) if not path.with_stem(f"{path.stem}-{k}").exists())
            products = _products_of(path)
            kept = path.rename(path.with_stem(f"{path.stem}-{number}"))
            for each in products:
                each.replace(each.with_name(kept.stem + each.name.removeprefix(path.stem)))
            also = ", its pictures and tables too" * bool(products)
            show([f"{path} was the result of another model text; it is now {kept}{also}"], console(stderr=True))


def _products_of(path: Path) -> list[Path]:
    """Return the pictures and tables beside a result that it has; none if it cannot be read."""
    result, found = None, [path.with_suffix(".png"), path.with_suffix(".svg")]
    with suppress(GapwalkError, OSError):
        result = open_result(path)
    if not isinstance(result, Result):
        return []
    found += [path.with_name(f"{path.stem}-{name}.csv") for name in result.tables()]
    return [each for each in found if each.is_file()]


def _file_number(path: Path) -> int | None:
    """Return the number of a file in its file system, which is another one once a run has begun its file."""
    try:
        return path.stat().st_ino
    except OSError:
        return None


def _run_study(study: Study, path: Path, *, resume: bool, force: bool, json: bool) -> tuple[int, dict[str, Any]]:
    """Run one study, write its files, and print its result; return the exit code and the JSON document, if wanted."""
    screen = console(stderr=json)
    earlier = _products_of(path) if force else []
    with progress_of(study.options, study.name) as progress:
        result = found_by(run, study, path, resume=resume, force=force, report=progress)
    code = exit_code(result)
    # cells that are done are drawn, and told, also after Ctrl-C
    is_shown = code != INTERRUPTED or getattr(result.finding, "counted", "") == CHUNKS
    if not is_shown:
        _remove_earlier_products(result, path, earlier)
    files = [path, *(write_products(result, path) if is_shown else ())]
    if not json:
        show_heading(study, screen)
        show(result.summary(), screen)
        show_files(files, screen)
    if code == FAILED:
        for text in result.failures:
            print(f"gapwalk: {printable(text)}", file=sys.stderr)
    if code == INTERRUPTED:
        show([_stored_words(result)], console(stderr=True))
    return code, {**result.to_dict(), "files": list(map(str, files))} if json else {}


def result_path(file: Path, output: Path | None, name: str = "", *, alone: bool = True) -> Path:
    """Return the name of the result file of a study; raise a ModelError if it is that of another kind of file."""
    given = file.with_suffix(".gapwalk") if output is None else output
    if given.suffix in _OTHER_ENDINGS or given == file:
        raise ModelError(f"{given} is not a name for a result; give it the ending .gapwalk, as in {given.stem}.gapwalk")
    if name and not (output and alone):
        return given.with_name(f"{given.stem}-{name}{given.suffix}")
    return given


def write_products(result: Result, output: Path) -> list[Path]:
    """Write pictures, if there is something to draw, and tables next to a result file; return their names."""
    from gapwalk.plot import save  # imported late: only pictures need matplotlib

    can_be_drawn = result.finding is None or result.finding.can_be_drawn
    pictures = [output.with_suffix(ending) for ending in (".png", ".svg")] if can_be_drawn else []
    if pictures:
        save(result, *pictures)
    tables = save_tables(result, output.with_suffix(""))
    if (old := output.with_name(f"{output.stem}-movers.csv")) not in tables and "bands" in result.tables():
        old.unlink(missing_ok=True)  # of an earlier result
    return [*pictures, *tables]


def _remove_earlier_products(result: Result, output: Path, earlier: list[Path]) -> None:
    """Remove the pictures and tables of an earlier result beside one that was stopped, and say so."""
    tables = (output.with_name(f"{output.stem}-{name}.csv") for name in result.tables())
    every = dict.fromkeys((output.with_suffix(".png"), output.with_suffix(".svg"), *tables, *earlier))
    old = [each for each in every if each.is_file()]
    for each in old:
        each.unlink()
    if old:
        show([f"removed, because they were of an earlier result: {', '.join(map(str, old))}"], console(stderr=True))


def exit_code(result: Result) -> int:
    """Return 0 if all was computed, 130 after Ctrl-C, 3 if the numerics failed somewhere, 5 if verification failed."""
    if result.interrupted:
        return INTERRUPTED
    reasons = {end.reason for branch in result.branches for end in branch.ends}
    if result.failures or EndReason.STOPPED in reasons:
        return FAILED
    return BROKEN if result.verification is not None and not result.verification.ok else DONE


def show_heading(study: Study, screen: Console) -> None:
    """Print the title of a study, the unused parts of its file, and doubts about its damping and its measure."""
    show_title(study.title, screen)
    show([*study.unused_words, *(f"warning: {doubt}" for doubt in study.doubts)], screen)


def _stored_words(result: Result) -> str:
    """Describe the stored part of an interrupted run."""
    if result.finding is not None:
        return f"interrupted; {result.finding.stored}"
    if result.map is not None:
        return f"interrupted; all {len(result.map.loci)} loci and {len(result.map.sections)} sections are stored"
    if result.diagram is not None:
        return f"interrupted; all {len(result.branches)} branches up to {result.names[-1]} are stored"
    branch = result.branches[-1]
    place = f"{parameter_symbol(branch.parameter, branch.system.units)} = {branch.values[-1]:.8g}"
    return f"interrupted at {place}; all {len(branch.points)} points are stored"


def _say_how_to_resume(words: list[str], output: Path | None) -> None:
    """Print the command that resumes a run; the output comes after the model file."""
    named = words if output is None else [*words[:3], "--output", str(output), *words[3:]]
    show([f"resume with\n    {shlex.join(named)}"], console(stderr=True))

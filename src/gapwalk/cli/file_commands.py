"""``gapwalk new``, ``check``, ``show``, ``export`` and ``verify``: commands on one file that run no study."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from gapwalk.cli.output import BROKEN, DONE, console, print_json, show, show_files, show_title
from gapwalk.errors import ModelError
from gapwalk.summary import Table

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gapwalk.bifurcation.loci.gradient import Gradients
    from gapwalk.model.element_tables import MeasuredCurve
    from gapwalk.model.model_source import Source
    from gapwalk.model.system import System
    from gapwalk.plot.style import SizeName
    from gapwalk.studies.result import Result
    from gapwalk.studies.study_file import Study

_PICTURES = ("png", "svg", "pdf")


def new_file(file: Path | None, table: Path | None) -> int:
    """Write a template of a model file, that of a machine, or one made from the table of a drive train."""
    from gapwalk.studies.machine_templates import machine_text, machines, write_template

    if file is None:
        rows = Table(["NAME", "machine"], [*machines().items()])
        sheet = "gapwalk new train.toml --from train.csv makes a drive train from a spreadsheet (csv, xlsx)"
        show(["gapwalk new NAME writes a machine to begin with to NAME.toml:", rows, sheet])
        return DONE
    text = ""
    if table is not None:
        from gapwalk.studies.study_file import text_of_sheet

        text = text_of_sheet(table)
    if table is None and file.name and not file.suffix and len(file.parts) == 1:
        text, file = machine_text(file.name), file.with_suffix(".toml")
    write_template(file, text=text)
    todo = "run" if "\n[study]" in text or not text else "check"
    commands = (f"    gapwalk {each} {shlex.quote(str(file))}" for each in (todo, "explore"))
    show([f"wrote {file}; {todo} it, or explore it in the browser, with", *commands])
    return DONE


def check_file(file: Path, changes: list[str], picture: Path | None, *, json: bool) -> int:
    """Print a summary of a model file; draw what is in it."""
    from gapwalk.cli.modes_command import train_lines
    from gapwalk.model.doubts import doubts_of
    from gapwalk.model.model_file import curves_of, has_pace
    from gapwalk.model.model_source import read_source
    from gapwalk.results.codec import plain
    from gapwalk.studies.runner import check_work
    from gapwalk.studies.set_values import parse_changes
    from gapwalk.studies.study_file import check_system, check_whole

    asked, source = parse_changes(changes), read_source(file)
    if "study" in source.data:
        model, system, studies = check_whole(source, asked)
    else:
        (model, system), studies = check_system(source, asked), ()
    check_work(studies)
    curves = curves_of(source)
    heading = model.title or studies[0].title if len(studies) == 1 else model.title or str(file)
    if studies and studies[0].reduced:
        system = studies[0].system
    elif studies and not has_pace(source):  # loads may grow with the frequency, which only studies give
        system = system.at({(pace := system.structure.pace): studies[0].system[pace]})
    if picture is not None:
        draw_model(system, curves, picture, heading)
    if json:
        documents = [
            {
                "ok": True,
                "title": study.title,
                "name": study.name or None,
                "system": plain(study.system),
                "study": plain(study.options),
                **({"reduction": plain(study.reduced)} if study.reduced else {}),
                "unused": list(study.unused),
                "warnings": study.doubts,
            }
            for study in studies
        ]
        alone = {"ok": True, "title": model.title, "system": plain(system), "warnings": doubts_of(system)}
        print_json(documents if len(documents) > 1 else documents[0] if documents else alone)
        return DONE
    system = studies[0].system if studies else system
    doubts = dict.fromkeys(doubt for study in studies for doubt in study.doubts)
    doubts |= dict.fromkeys([] if studies else doubts_of(system))
    lines = [
        heading,
        *train_lines(system),
        *(f"  {text}" for text in system.contents),
        *(f"  curve of {each.name}: {each.curve.words}" for each in curves),
        *(f"  {study.reduced.words}" for study in studies[:1] if study.reduced),
        *(f"  study{f' {study.name}' if study.name else ''}: {_plan(study, source, asked)}" for study in studies),
        *["  no study: `gapwalk modes` shows its modes; [study] says what to compute"] * (not studies),
        *dict.fromkeys(f"  {words}" for study in studies for words in study.unused_words),
        *(f"warning: {doubt}" for doubt in doubts),
        f"no errors, {len(doubts)} warning{'s' * (len(doubts) > 1)}" if doubts else "no errors",
    ]
    show(lines)
    if picture is not None:
        show_files([picture])
    return DONE


_RANGE = re.compile(r"([\w.]+) from ([-+\d.e]+\d) to ([-+\d.e]*\d)")


def _plan(study: Study, source: Source, asked: Mapping[str, object]) -> str:
    """Return the plan of a study, ranges with their unit, and with what the file says in another one."""
    tables, units = source.data.get("study", []), study.system.units
    own = [each for each in (tables if isinstance(tables, list) else [tables]) if each.get("name", "") == study.name]
    ranges = (
        {}
        if any(each.startswith("study.") for each in asked)
        else {
            part["parameter"]: f"{part['from']} to {part['to']}"
            for table in own
            for part in (table, *(each for each in table.values() if isinstance(each, dict)))
            if all(isinstance(part.get(key), str) for key in ("parameter", "from", "to"))
        }
    )

    def words(match: re.Match[str]) -> str:
        unit = units.parameter(match[1]) if units and match[1] in study.system.parameters else ""
        given = ranges.get(match[1], "")
        return f"{match[0]} {unit}".rstrip() + f" ({given})" * bool(given and f" {unit} to " not in given)

    return _RANGE.sub(words, study.options.plan_with_workers)


def draw_model(system: System, curves: Sequence[MeasuredCurve], picture: Path, title: str) -> None:
    """Draw the system of a model file, with the measured points of its curves in the units of the system."""
    from gapwalk.plot import save

    unit = system.units.angle if system.units else 1.0
    points = {
        each.name: (each.deflection * ((each.angle.factor if each.angle else 1.0) / unit), each.force)
        for each in curves
    }
    save(system, picture, points=points, title=title)


def show_result(path: Path, *, points: bool, gradients: bool, json: bool) -> int:
    """Show the contents of a result file; special points of a diagram or a map, and gradients, only if requested."""
    from gapwalk.cli.run_command import show_heading
    from gapwalk.studies.result import load_result

    result = load_result(path)
    found = _gradients(result) if gradients else None
    if json:
        more = {} if found is None else {"gradients": [row for each in found.found for row in each.rows]}
        print_json({**result.to_dict(points=False), **more})
        return DONE
    screen, missed = console(), result.failures if result.complete else ()
    show_heading(result.study, screen)
    state = "complete" if result.complete else "not complete: `gapwalk run` with --resume continues it"
    if missed:
        state = f"finished, but {len(missed)} part(s) could not be computed or explained:"
    versions = ", ".join(f"{name} {version}" for name, version in result.versions.items())
    changes = (f"changed: {name} = {value}" for name, value in result.study.changes)
    show([f"{path}: {state}", *(f"  {text}" for text in missed), f"computed with {versions}", *changes], screen)
    show(result.summary(points=points or (result.diagram is None and result.map is None)), screen)
    if found is not None:
        show(found.summary(), screen)
    return DONE


def _gradients(result: Result) -> Gradients:
    from gapwalk.bifurcation.loci.gradient import gradients

    if not result.branches:
        raise ModelError("--gradients concerns special points of branches, and this result has no branches")
    return gradients(point for branch in result.branches for point in branch.special_points)


def export_result(
    path: Path,
    form: str | None,
    outputs: Sequence[Path],
    measure: str | None,
    size: SizeName | None = None,
    signal: str | None = None,
    full_scale: float | None = None,
    *,
    title: bool = True,
    legend: bool = True,
) -> int:
    """Write the tables, the picture or the sound of a result, or a page with its motions; or several of these."""
    from gapwalk.studies.export import format_names
    from gapwalk.studies.result import load_result

    if form is not None and len(outputs) > 1:
        raise ModelError("--format applies to a single output; leave it out, and give each output its ending")
    forms = [_form_of(form, output, path) for output in outputs or [None]]
    if size is not None and not set(forms) & set(_PICTURES):
        raise ModelError(f"--size concerns pictures; write --format svg, pdf or png instead of {forms[0]}, or omit it")
    if not (title and legend) and not set(forms) & set(_PICTURES):
        raise ModelError(f"--no-title and --no-legend concern pictures; write --format pdf instead of {forms[0]}")
    if (signal is not None or full_scale is not None) and "wav" not in forms:
        raise ModelError("--signal and --full-scale concern sounds; write --format wav")
    if measure is not None and not set(forms) - {*format_names()}:
        raise ModelError("--measure concerns pictures; the tables hold all measures")
    result = load_result(path)
    if result.finding is not None and result.finding.record is None:
        raise ModelError(f"{path} is not complete ({result.finding.stored}); `gapwalk run` with --resume continues it")
    for each, output in zip(forms, outputs or [None], strict=True):
        if each == "wav":
            save_sound(result, output or path.with_suffix(".wav"), signal, full_scale)
        else:
            show_files(_exported(result, path, each, output, measure, size, title, legend))
    return DONE


def _form_of(form: str | None, output: Path | None, path: Path) -> str:
    """Return the format of an output, by its ending if none is given; raise a ModelError if there is none such."""
    from gapwalk.studies.export import canonical, format_names

    form = canonical(form or (output.suffix.lstrip(".") if output and output.suffix else "csv"))
    if form not in (*format_names(), "html", "wav", *_PICTURES):
        known = ", ".join((*format_names(), *_PICTURES, "wav"))
        raise ModelError(f"nothing can be exported as {form!r}; write --format {known} or html")
    if output is not None and output.resolve() == path.resolve():
        raise ModelError(f"{output} is the result itself; choose another name")
    return form


def _exported(
    result: Result,
    path: Path,
    form: str,
    output: Path | None,
    measure: str | None,
    size: SizeName | None,
    title: bool,
    legend: bool,
) -> list[Path]:
    """Write tables, a picture or a page of a result; return the files."""
    from gapwalk.studies.export import export_data, format_names, format_of

    if form in format_names():
        target = output or path.with_suffix(format_of(form).ending)
        return list(export_data(result, target, form, named=output is None))
    written = output or path.with_suffix(f".{form}")
    if form == "html":
        from gapwalk.explorer.saved_page import save_html

        save_html(result, written, measure=measure)
    else:
        from gapwalk.plot import save

        save(result, written, form=form, measure=measure, size=size, title=None if title else False, legend=legend)
    return [written]


def verify_file(path: Path, *, json: bool) -> int:
    """Verify a result file; return the exit code."""
    from gapwalk.cli.progress import verify_line
    from gapwalk.studies.verify import verified_result

    with verify_line(str(path)) as progress:
        result, found = verified_result(path, progress)
    if json:
        print_json({"file": str(path), "complete": result.complete, **found.document()})
    else:
        screen = console()
        if not result.complete:
            show([f"{path} is not complete; its stored part was verified"], screen)
        show(found.summary(), screen)
        show_title(found.words, screen)
    return DONE if found.ok else BROKEN


def save_sound(result: Result, output: Path, signal: str | None, full_scale: float | None) -> int:
    """Write the sound of a run-up or a settled motion as a WAV file, and print its level."""
    from gapwalk.answers.run_up import RunUp  # these take time to load
    from gapwalk.attractors.settle import Settled
    from gapwalk.attractors.spectrum import sound
    from gapwalk.studies.export import write_whole

    record = None if result.finding is None else result.finding.record
    if isinstance(record, RunUp):
        heard = record.sound(signal or "")
    elif isinstance(record, Settled):
        asked = str(getattr(result.options, "signal", "") or record.system.coordinates[0]).rstrip("'")
        own = asked if asked in record.system.coordinates else record.system.coordinates[0]
        heard = sound(record, signal or f"{own}''")
    else:
        raise ModelError(
            f"a sound is that of one motion: of a run-up or a settled motion, not of a {result.options.kind}. Write a "
            'study of kind = "run-up" or "settle", or choose a point in `gapwalk explore` and press Listen'
        )
    scale = heard.full_scale if full_scale is None else full_scale
    write_whole(output, heard.wav(scale))
    unit = f" {heard.unit}" if heard.unit else ""
    show_files([output])
    show(
        [
            f"  {heard.signal}, {heard.duration:.4g} s at {heard.rate} Hz: peak {heard.peak:.4g}{unit}, root mean "
            f"square {heard.level:.4g}{unit}",
            f"  full scale is {scale:g}{unit}: give --full-scale {scale:g} to each sound compared with this one",
        ]
    )
    return DONE

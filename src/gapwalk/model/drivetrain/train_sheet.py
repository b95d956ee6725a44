"""Drive trains from spreadsheets: a table of inertias, shafts and gears becomes a model file with comments.

A row for each part, a column for each quantity, units in the headings: a CSV file, or the first sheet of a workbook.
"""

from __future__ import annotations

import csv
import io
import os
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from gapwalk.errors import ModelError
from gapwalk.files import content_of
from gapwalk.model.drivetrain.train_parts import GROUND
from gapwalk.model.problems import did_you_mean, given, near_names
from gapwalk.model.units import QuantityKind, read_quantity, read_unit

# Tables of texts from spreadsheets: CSV files as programs and countries write them, and Excel workbooks.

_MAX_BYTES, _MAX_ROWS, _MAX_COLUMNS = 10_000_000, 5000, 200


class Spreadsheet(NamedTuple):
    """A table of texts."""

    head_row: int  #: Number of the row with the headings, from 1 as a spreadsheet shows it.
    heads: list[str]  #: The headings.
    #: The rows below that are neither empty nor comments (``#``), each with its number.
    rows: list[tuple[int, list[str]]]
    mark: str  #: The separator of the cells: a tab, a semicolon or a comma; empty for a workbook.


def read_spreadsheet(path: str | os.PathLike[str]) -> Spreadsheet:
    """Read a table of texts from a CSV file, or from the first sheet of a workbook (``.xlsx``)."""
    name = os.fspath(path)
    try:
        content = content_of(name, _MAX_BYTES, "save the table of the train alone")
    except ValueError as error:
        raise ModelError(f"{name} {error}") from None
    is_workbook = os.path.splitext(name)[1].lower() == ".xlsx"
    mark, records = ("", _workbook(name, content)) if is_workbook else _text_rows(name, content)
    rows = [
        (number, cells)
        for number, cells in ((number, _without_end(cells)) for number, cells in records)
        if cells and not cells[0].lstrip().startswith("#")
    ]
    if not rows:
        raise ModelError(
            f"{name} is empty; write headings in its first row: part, name, from, to, inertia [kg m^2] ..."
        )
    if len(rows) > _MAX_ROWS or max(len(cells) for _, cells in rows) > _MAX_COLUMNS:
        most = f"{_MAX_ROWS:,} rows or {_MAX_COLUMNS} columns"
        raise ModelError(f"{name} has more than {most}; save the table of the train alone")
    return Spreadsheet(*rows[0], rows[1:], mark)


def letters(place: int) -> str:
    """Return the letters of a column of a spreadsheet: A for 0, Z for 25, AA for 26."""
    found, place = "", place + 1
    while place:
        place, rest = divmod(place - 1, 26)
        found = chr(65 + rest) + found
    return found


def plain_number(number: float) -> str:
    """Return a number with all digits; a whole one without a point."""
    return str(int(number)) if number.is_integer() and abs(number) < 1e15 else repr(number)


def _text_rows(name: str, content: bytes) -> tuple[str, list[tuple[int, list[str]]]]:
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        row = content.count(b"\n", 0, error.start) + 1
        raise ModelError(f"{name}: row {row} is not UTF-8 text; save the table as CSV UTF-8") from None
    first, _, rest = text.partition("\n")
    skipped = 0
    if match := re.fullmatch(r"sep=(.)\s*", first, re.IGNORECASE):  # Excel writes and reads it
        mark, text, skipped = match[1], rest, 1
    else:
        head = next((line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")), "")
        mark = next((mark for mark in "\t;," if mark in head), ",")
    try:
        rows = csv.reader(io.StringIO(text, newline=""), delimiter=mark, strict=True)
        return mark, list(enumerate(rows, start=1 + skipped))
    except csv.Error as error:
        raise ModelError(f"{name} cannot be divided into cells: {error}; save the table as CSV again") from None


def _workbook(name: str, content: bytes) -> list[tuple[int, list[str]]]:
    try:
        from openpyxl import load_workbook
    except ModuleNotFoundError:
        raise ModelError(
            f'{name} needs openpyxl; install it: pip install "gapwalk[data]", or save the table as CSV UTF-8'
        ) from None
    try:
        sheet: Any = load_workbook(io.BytesIO(content), read_only=True, data_only=True).worksheets[0]
        rows = sheet.iter_rows(values_only=True, max_row=2 * _MAX_ROWS, max_col=2 * _MAX_COLUMNS)
        return [(number, [_cell_text(value) for value in row]) for number, row in enumerate(rows, start=1)]
    except Exception as error:  # of zipfile, of the XML, and of openpyxl itself
        raise ModelError(f"{name} is not a readable workbook ({error}); save the table as CSV UTF-8") from None


def _without_end(cells: list[str]) -> list[str]:
    """Return the cells of a row up to the last one that is not empty."""
    last = max((place for place, cell in enumerate(cells) if cell.strip()), default=-1)
    return cells[: last + 1]


def _cell_text(value: object) -> str:
    if isinstance(value, int | float) and not isinstance(value, bool):
        return plain_number(float(value))
    return "" if value is None else str(value)


@dataclass(frozen=True)
class SheetColumn:
    """A column that a table may have."""

    name: str  #: Its heading.
    words: str  #: What its cells hold, for the documentation and for messages.
    kind: QuantityKind | None = None  #: Kind of its quantity; None for a text, a plain number or a count.
    others: tuple[str, ...] = ()  #: Other headings that are understood.


COLUMNS = (
    SheetColumn("part", "inertia, shaft, stage, gear, drag or load", others=("kind", "type", "element")),
    SheetColumn("name", "a word; the parameters of the part begin with it", others=("label",)),
    SheetColumn("from", "the first of the two inertias that a shaft, gear or drag joins", others=("first", "on")),
    SheetColumn("to", "the second one, or ground", others=("second",)),
    SheetColumn("inertia", "moment of inertia of a body", QuantityKind.INERTIA, ("moment of inertia", "j")),
    SheetColumn("radius", "of a gear: its acceleration is then linear", QuantityKind.LENGTH, ("r",)),
    SheetColumn("torque", "mean torque on a body; or the word reaction, on the one that balances all others",
                QuantityKind.TORQUE, ("mean", "mean torque")),
    SheetColumn("stiffness", "of a shaft, of a stage, or of the teeth of a gear", QuantityKind.STIFFNESS, ("k",)),
    SheetColumn("damping", "of a damper that acts always", QuantityKind.DAMPING, ("c",)),
    SheetColumn("clearance", "half the backlash, from the middle to a side", QuantityKind.ANGLE, ("half clearance",)),
    SheetColumn("backlash", "the whole backlash, from side to side: twice the clearance", QuantityKind.ANGLE,
                ("total backlash",)),
    SheetColumn("side", "of a stage: both, positive or negative"),
    SheetColumn("impact damping", "of the springs while they touch", QuantityKind.IMPACT, ("impact_damping",)),
    SheetColumn("ratio", "of a gear: speed of the first inertia divided by that of the second", others=("i",)),
    SheetColumn("teeth 1", "teeth of the first gear", others=("teeth", "z1", "z 1")),
    SheetColumn("teeth 2", "teeth of the second gear", others=("z2", "z 2")),
    SheetColumn("constant", "of a drag: torque while it slips", QuantityKind.TORQUE),
    SheetColumn("linear", "of a drag: torque over the speed of its slip", QuantityKind.DAMPING),
    SheetColumn("order", "of a load: oscillations per turn", others=("harmonic",)),
    SheetColumn("amplitude", "of a load", QuantityKind.TORQUE),
    SheetColumn("phase", "of a load, as an angle of its own oscillation", QuantityKind.PHASE),
    SheetColumn("speed", "of the shaft whose turns orders count; in one row", QuantityKind.FREQUENCY, ("rpm",)),
    SheetColumn("note", "anything: it becomes a comment", others=("comment", "comments", "notes", "source", "remark")),
)  # fmt: skip
"""The columns of a table, in any order."""

_BY_NAME = {name: column for column in COLUMNS for name in (column.name, *column.others)}
_ALLOWED = {
    "inertia": ("inertia", "radius", "torque", "speed"),
    "shaft": ("from", "to", "stiffness", "damping", "clearance", "backlash", "impact damping"),
    "stage": ("stiffness", "clearance", "backlash", "side"),
    "gear": ("from", "to", "stiffness", "damping", "clearance", "backlash", "impact damping", "ratio", "teeth 1",
             "teeth 2"),
    "drag": ("from", "to", "constant", "linear"),
    "load": ("from", "order", "amplitude", "phase"),
}  # fmt: skip
_PARTS = {"clutch": "shaft", "spring": "shaft", "spline": "shaft", "mesh": "gear", "body": "inertia", "disk": "inertia",
          "excitation": "load"}  # fmt: skip
_KEYS = {"impact damping": "impact_damping"}
_NUMBER = re.compile(r"[-+]?(\d+([.,]\d*)?|[.,]\d+)([eE][-+]?\d+)?")


@dataclass
class _Row:
    """A row of the table: its cells by the names of their columns, without the empty ones."""

    number: int
    cells: dict[str, str]
    part: str = ""
    stages: list[_Row] = field(default_factory=list)


def train_of_sheet(path: str | os.PathLike[str]) -> tuple[str, Mapping[str, str]]:
    """Make a model file from a table of a drive train."""
    name = os.fspath(path)
    table = read_spreadsheet(name)
    sheet = _Sheet(name, table)
    found = [row for row in (sheet.row(number, cells) for number, cells in table.rows) if row is not None]
    if not found and not sheet.problems:
        raise ModelError(f"{name} has no parts below its headings; write a row such as inertia, flywheel, 0.14")
    text, places = sheet.text(found)
    if sheet.problems:
        raise ModelError("\n".join(f"{name}: {each}" for each in dict.fromkeys(sheet.problems)))
    return text, places


class _Sheet:
    """A table while it is read: its columns, and its problems so far."""

    def __init__(self, name: str, table: Spreadsheet) -> None:
        self.name, self.mark, self.problems = name, table.mark, list[str]()
        self.columns: dict[int, tuple[SheetColumn, str, str]] = {}  # place: column, unit, heading as written
        self.places: dict[str, int] = {}  # by the name of the column
        self.marks: dict[str, str] = {}  # decimal point and comma: where each was first seen
        self.has_units: bool | None = None
        for place, head in enumerate(table.heads):
            if head.strip():
                self._add_column(place, head.strip(), f"row {table.head_row}, column {letters(place)}")
        for needed in ("part", "name"):
            if needed not in self.places and not self.problems:
                words = _BY_NAME[needed].words
                self.problems.append(f"row {table.head_row}: there is no column {needed}; its cells hold: {words}")

    def _add_column(self, place: int, head: str, where: str) -> None:
        match = re.fullmatch(r"(.*?)\s*(?:[\[(]\s*(.*?)\s*[\])])?", head, re.DOTALL)
        label, unit = (match[1], match[2] or "") if match else (head, "")
        column, problem = _BY_NAME.get(re.sub(r"[\s_]+", " ", label).lower()) or _BY_NAME.get(label.lower()), ""
        if column is None:
            hint = did_you_mean(label.lower(), [each.name for each in COLUMNS], "columns are")
            problem = f"the heading {given(head)} is not known; {hint} (note heads a column of remarks)"
        elif column.name in self.places and column.name != "note":
            problem = f"{given(head)} is column {letters(self.places[column.name])} again; leave one of them out"
        else:
            self.places[column.name] = place
            unit = "" if unit in ("-", "1") else unit
            if unit and column.kind is None:
                problem, unit = f"{column.name} has no unit; write the heading {column.name}", ""
            elif unit and column.kind is not None:
                try:
                    read_unit(unit, column.kind)
                except ValueError as error:
                    usual = " or ".join(f"{column.name} [{each}]" for each in column.kind.usual)
                    problem = f"{error}; write the heading {usual}"
            self.columns[place] = column, unit, head
        if problem:
            self.problems.append(f"{where}: {problem}")

    def where(self, row: _Row, column: str) -> str:
        """Return the place of a cell: its row, and the letter and heading of its column."""
        if (place := self.places.get(column)) is None:
            return f"row {row.number}, column {column} (which is missing)"
        return f"row {row.number}, column {letters(place)} ({self.columns[place][2]})"

    def refuse(self, row: _Row, column: str, told: str) -> str:
        """Add what is wrong with a cell to the problems, and return nothing."""
        self.problems.append(f"{self.where(row, column)} {told}")
        return ""

    def row(self, number: int, cells: Sequence[str]) -> _Row | None:
        """Return a row; None of an empty one, and of a comment."""
        texts = [(self.columns[k][0].name, " ".join(text.split())) for k, text in enumerate(cells) if k in self.columns]
        row = _Row(number, {name: text for name, text in texts if text and name != "note"})
        if not row.cells:
            return None
        if notes := [text for name, text in texts if text and name == "note"]:
            row.cells["note"] = "; ".join(notes)
        word = row.cells.get("part", "").lower()
        row.part = _PARTS.get(word, word)
        if row.part not in _ALLOWED:
            what = f"is {given(row.cells['part'])}" if word else "is empty"
            hint = f"; did you mean {near[0]}?" if (near := near_names(word, [*_ALLOWED])) else ""
            self.refuse(row, "part", f"{what}; write inertia, shaft, stage, gear, drag or load{hint}")
            return None
        for name in [name for name in row.cells if name not in (*_ALLOWED[row.part], "part", "name", "note")]:
            fits = " or ".join(kind for kind, names in _ALLOWED.items() if name in names)
            where = self.where(row, name)
            told = f"a {row.part} has no {name}; leave the cell empty, or write {fits} as the part"
            self.problems.append(f"{where}: {told}")
        return row

    def number(self, row: _Row, name: str, *, half: bool = False) -> str:
        """Return the TOML value of a cell with a number; an empty text if it is wrong."""
        text, (column, unit, _) = row.cells[name], self.columns[self.places[name]]
        here = f"is {given(text)}"
        match = _NUMBER.match(text)
        if match is None or (match[0].count(",") + match[0].count(".")) > 1:
            return self.refuse(row, name, f"{here}; write a number, as in 12.5")
        digits, own = match[0], text[match.end() :].strip()
        if re.match(r"[.,\d]", own):
            return self.refuse(row, name, f"{here}; write the number without separators of thousands, as in 1234.5")
        if "," in digits and self.mark == ",":
            return self.refuse(row, name, f"{here}; the file separates cells by commas: write a decimal point")
        for mark in ".,":
            if mark in digits:
                self.marks.setdefault(mark, f"{self.where(row, name)} {here}")
        if len(self.marks) == 2:
            first, second = self.marks.values()
            self.problems.append(f"{second}, but {first}; write all numbers with a decimal point, or all with a comma")
            return ""
        number = float(digits.replace(",", ".")) * (0.5 if half else 1.0)
        if column.kind is None:
            if own:
                self.refuse(row, name, f"{here}; it is a plain number: write {digits}")
            return plain_number(number)
        unit = own or unit or ("deg" if column.kind is QuantityKind.PHASE else "")  # that of the cell counts for it
        if number == 0.0 and not unit:
            return "0.0"
        if column.kind is not QuantityKind.PHASE:
            if self.has_units not in (None, bool(unit)):
                what = "has no unit, but others have one" if self.has_units else "has a unit, but others have none"
                heading = f"{column.name} [{column.kind.usual[0]}]"
                self.refuse(row, name, f"{here} and {what}; write all units in the headings, as in {heading}")
            self.has_units = bool(unit) if self.has_units is None else self.has_units
        if not unit:
            return plain_number(number)
        try:
            read_quantity(f"{plain_number(number)} {unit}", column.kind)
        except ValueError as error:
            self.refuse(row, name, str(error))
        return f'"{plain_number(number)} {unit}"'

    def text(self, rows: Sequence[_Row]) -> tuple[str, dict[str, str]]:
        """Return the model file, and the rows of its parts."""
        known = {row.cells.get("name", "") for row in rows if row.part == "inertia"}
        names: dict[str, _Row] = {}
        links: list[_Row] = []
        for row in rows:
            if row.part == "stage":
                self._join(row, links)
                continue
            self._check_name(row, names)
            links += [row] * (row.part in ("shaft", "gear"))
            for column in [name for name in ("from", "to") if name in _ALLOWED[row.part]]:
                end = row.cells.get(column, "")
                if end not in known and (end != GROUND or column == "from"):
                    what = f"is {given(end)}, which is the name of no inertia" if end else "is empty"
                    ground = ", or ground" * (column == "to")
                    listed = ", ".join(sorted(known)) or "the inertias"
                    self.refuse(row, column, f"{what}; write one of {listed}{ground}")
        parts: list[str] = []
        places: dict[str, str] = {}
        counts: Counter[str] = Counter()
        for row in rows:
            if row.part == "stage":
                continue
            key = "harmonic" if row.part == "load" else row.part
            path = f"{key}[{counts[key]}]"
            counts[key] += 1
            places[path] = f"row {row.number}"
            places |= {f"{path}.stage[{k}]": f"row {stage.number}" for k, stage in enumerate(row.stages)}
            parts.append("\n".join(_MAKERS[row.part](self, row)))
        return "\n".join((*self._head(rows), "", "\n\n".join(parts), *self._study(rows), "")), places

    def _join(self, row: _Row, links: list[_Row]) -> None:
        named = row.cells.get("name")
        found = [link for link in links if named in (None, link.cells.get("name"))]
        if found:
            found[-1].stages.append(row)
            return
        hint = "write the name of the shaft or gear above it" if named else "write it below its shaft or gear"
        self.refuse(row, "name", f"is {given(named or '')}: there is no such shaft; {hint}")

    def _check_name(self, row: _Row, names: dict[str, _Row]) -> None:
        name = row.cells.get("name", "")
        if not name:
            self.refuse(row, "name", f"is empty; write a word, as in {row.part}{row.number}")
        elif not name.isidentifier():
            word = re.sub(r"\W+", "_", name).strip("_") or "part"
            word = word if word.isidentifier() else f"{row.part}_{word}"
            self.refuse(row, "name", f"is {given(name)}; write one word of letters, digits and underscores: {word}")
        elif name in names:
            self.refuse(row, "name", f"is {given(name)}, as in row {names[name].number}; write another name")
        names.setdefault(name, row)

    def _head(self, rows: Sequence[_Row]) -> Iterator[str]:
        yield f"# Made from {os.path.basename(self.name)}, whose rows the comments name. Check it with gapwalk check."
        yield "#"
        yield "# Clearances are half the backlash: from the middle to either side. All angles grow together as the"
        yield "# train turns; the deflection of a gear is the first angle less the ratio times the second."
        yield ""
        yield f"title = {_quoted(os.path.splitext(os.path.basename(self.name))[0])}"
        speeds = [row for row in rows if "speed" in row.cells]
        for row in speeds[1:]:
            self.refuse(row, "speed", "is given again; write the speed in one row")
        if speeds:
            value = self.number(speeds[0], "speed")
            yield f"{'speed' if value.startswith(chr(34)) and 'Hz' not in value else 'frequency'} = {value}"
        means, reaction = {}, ""
        for row in (row for row in rows if "torque" in row.cells):
            if row.cells["torque"].lower() == "reaction":
                if reaction:
                    self.refuse(row, "torque", "is reaction again; write it for one inertia")
                reaction = row.cells.get("name", "")
            elif value := self.number(row, "torque"):
                means[row.cells.get("name", "")] = value
        first = next((row for row in rows if "inertia" in row.cells), None)
        if first is not None and self.number(first, "inertia").startswith('"') and not speeds:
            yield 'speed = "1000 rpm"            # not in the table; orders count turns of this shaft'
        if means:
            yield f"mean = {{ {', '.join(f'{name} = {value}' for name, value in means.items())} }}"
        if reaction:
            yield f"reaction = {_quoted(reaction)}  # takes the mean torque of all others"

    def _study(self, rows: Sequence[_Row]) -> Iterator[str]:
        if not any(row.part == "load" for row in rows):
            yield "\n# A load oscillates; without one nothing moves. Its order counts oscillations per turn.\n#"
            amplitude = '"50 N m"' if self.has_units else "1.0"
            first = next((row.cells.get("name", "") for row in rows if row.part == "inertia"), "")
            yield "# [[harmonic]]\n# order = 2\n# amplitude = " + amplitude + f"\n# acts_on = {{ {first} = 1.0 }}"
            return
        ends = ("speed", '"3000 rpm"', '"800 rpm"') if self.has_units else ("frequency", "2.0", "0.2")
        unit = self.columns[self.places["speed"]][1] if "speed" in self.places else ""
        if any("Hz" in row.cells.get("speed", "") for row in rows) or unit in ("Hz", "rad/s"):
            ends = ("frequency", '"50 Hz"', '"10 Hz"')
        yield "\n# The steady motions over a range of the speed; change the range, or the kind of the study."
        yield f'[study]\nkind = "response"\nparameter = "{ends[0]}"\nfrom = {ends[1]}\nto = {ends[2]}'

    def lines(self, row: _Row, *names: str) -> Iterator[str]:
        """Yield the lines of the quantities of a row; a clearance may be given as the whole backlash."""
        for name in names:
            if name == "clearance" and "backlash" in row.cells:
                if name in row.cells:
                    told = "is given beside the clearance, which is half of it; leave one of them empty"
                    self.refuse(row, "backlash", told)
                    continue
                value = self.number(row, "backlash", half=True)
                yield f"clearance = {value}  # half the backlash of {row.cells['backlash']}"
            elif name in row.cells and (value := self.number(row, name)):
                yield f"{_KEYS.get(name, name)} = {value}"


def _opening(row: _Row, table: str) -> Iterator[str]:
    note = f": {row.cells['note']}" if "note" in row.cells else ""
    yield f"[[{table}]]  # row {row.number}{note}"
    if not table.endswith("stage"):
        yield f"name = {_quoted(row.cells.get('name', ''))}"


def _inertia(sheet: _Sheet, row: _Row) -> Iterator[str]:
    yield from _opening(row, "inertia")
    if "inertia" not in row.cells:
        sheet.refuse(row, "inertia", "is empty; write the moment of inertia, as in 0.14")
    yield from sheet.lines(row, "inertia", "radius")


def _link(sheet: _Sheet, row: _Row) -> Iterator[str]:
    yield from _opening(row, row.part)
    yield _between(row)
    if row.part == "gear":
        both = [row.cells[name] for name in ("teeth 1", "teeth 2") if name in row.cells]
        for name in ("teeth 1", "teeth 2"):
            if not row.cells.get(name, "1").isdecimal():
                sheet.refuse(row, name, f"is {given(row.cells[name])}; write the number of teeth, as in 27")
        if not both[1:] and "ratio" not in row.cells:
            sheet.refuse(row, "ratio", "is empty; write the ratio, as in 1.52, or the teeth of both gears")
        elif both:
            yield f"teeth = [{', '.join(both)}]" if both[1:] else f"teeth = {both[0]}"
        yield from sheet.lines(row, "ratio")
    yield from sheet.lines(row, "stiffness", "clearance", "damping", "impact damping")
    for stage in row.stages:
        yield ""
        yield from _opening(stage, f"{row.part}.stage")
        if "side" in stage.cells:
            yield f"side = {_quoted(stage.cells['side'].lower())}"
        yield from sheet.lines(stage, "clearance", "stiffness")


def _drag(sheet: _Sheet, row: _Row) -> Iterator[str]:
    yield from _opening(row, "drag")
    yield _between(row)
    if not {"constant", "linear"} & row.cells.keys():
        sheet.refuse(row, "constant", "is empty; write its torque, as in 1.2, or under linear that over its speed")
    yield from sheet.lines(row, "constant", "linear")


def _between(row: _Row) -> str:
    return f"between = [{_quoted(row.cells.get('from', ''))}, {_quoted(row.cells.get('to', ''))}]"


def _load(sheet: _Sheet, row: _Row) -> Iterator[str]:
    yield from _opening(row, "harmonic")
    for name, example in (("order", "2"), ("amplitude", "50")):
        if name not in row.cells:
            sheet.refuse(row, name, f"is empty; write the {name}, as in {example}")
    yield from sheet.lines(row, "order", "amplitude", "phase")
    yield f"acts_on = {{ {row.cells.get('from', '')} = 1.0 }}"


_MAKERS = {"inertia": _inertia, "shaft": _link, "gear": _link, "drag": _drag, "load": _load}


def _quoted(text: str) -> str:
    return '"' + "".join(f"\\{c}" if c in '"\\' else c if c.isprintable() else " " for c in text) + '"'

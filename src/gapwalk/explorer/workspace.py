"""The workspace: the one folder whose model files and results the explorer may read, and where it writes."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from gapwalk.errors import ModelError, StoreError

MODEL, RESULT = ".toml", ".gapwalk"
_MOST = 500  # files that are listed, and results of one exploration
_RECORD_BYTES = 100_000


class Workspace:
    """A folder, and the exploration of one file in it.

    An exploration is a folder beside that file, such as ``clutch.explorer`` for ``clutch.toml``. It holds a result file
    for each job, and beside it a record of what was asked, in JSON.

    Parameters
    ----------
    root
        The folder; nothing outside of it is read or written.
    """

    def __init__(self, root: Path) -> None:
        self.root = root.resolve()

    def files(self) -> list[str]:
        """Model files and results in the folder, sorted, as names that `path` takes."""
        found = [
            path.name
            for path in self.root.iterdir()
            if path.suffix in (MODEL, RESULT)
            and path.is_file()
            and not path.name.startswith(".")
            and _can_be_asked(path.name)
        ]
        return sorted(found)[:_MOST]

    def path(self, name: str) -> Path:
        """The file of a name that a request gives.

        Raises
        ------
        ModelError
            If it lies outside of the workspace, is hidden, or is neither a model nor a result.
        """
        given = f"{name[:100]!r}"
        if not name or "\0" in name or len(name) > 300 or not _can_be_asked(name):
            raise ModelError(f"{given} is no name of a file; write that of a file in {self.root.name}")
        path = (self.root / name).resolve()
        inside = path.is_relative_to(self.root)
        if not inside or any(part.startswith(".") for part in path.relative_to(self.root).parts):
            raise ModelError(f"{given} lies outside of the workspace; only files in {self.root.name} can be opened")
        if path.suffix not in (MODEL, RESULT):
            raise ModelError(f"{given} is neither a model ({MODEL}) nor a result ({RESULT})")
        return path

    def exploration(self, file: Path) -> Path:
        """The folder that the exploration of a file writes into; it need not be there yet."""
        return file.with_name(f"{file.name.removesuffix(RESULT).removesuffix(MODEL)}.explorer")

    def claim(self, file: Path, word: str) -> Path:
        """A new name for the result of a job on a file: nobody else gets it, in this process or another.

        Raises
        ------
        StoreError
            If nothing can be written there, or it is full.
        """
        folder = self.exploration(file)
        try:
            folder.mkdir(exist_ok=True)
            if not folder.resolve().is_relative_to(self.root):
                raise StoreError(f"{folder.name} leads out of the workspace; remove the link")
            taken = [int(head) for each in folder.iterdir() if (head := each.name.partition("-")[0]).isdigit()]
            for number in range(max(taken, default=0) + 1, _MOST + 1):
                try:
                    # the number is what is claimed, whatever the word
                    os.close(os.open(folder / f"{number:02d}-claim", os.O_CREAT | os.O_EXCL | os.O_WRONLY))
                except FileExistsError:
                    continue
                return folder / f"{number:02d}-{word}{RESULT}"
        except OSError as error:
            raise StoreError(f"nothing can be written into {folder}: {error.strerror}") from None
        raise StoreError(f"{folder.name} holds {_MOST} results; move some of them elsewhere")


def _can_be_asked(name: str) -> bool:
    """Whether a page can name a file: it writes UTF-8, which the bytes of a name may not be."""
    return not any("\ud800" <= char <= "\udfff" for char in name)


def write_record(output: Path, record: dict[str, Any]) -> None:
    """Write what was asked beside the result that answers it: whole, or not at all.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    new = output.with_suffix(".json-new")
    try:
        new.write_text(json.dumps(record, indent=1), encoding="utf-8")
        os.replace(new, output.with_suffix(".json"))
    except OSError as error:
        raise StoreError(f"{output.with_suffix('.json')} cannot be written: {error.strerror}") from None


def read_records(folder: Path) -> dict[Path, dict[str, Any]]:
    """What was asked in an exploration, by the result files, in order; what cannot be read is left out."""
    records = {}
    for path in sorted(folder.glob("*.json")) if folder.is_dir() else []:
        try:
            if not path.is_file() or path.stat().st_size > _RECORD_BYTES:
                continue
            record = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError):
            continue
        if isinstance(record, dict):
            records[path.with_suffix(RESULT)] = record
    return records

"""The stub of the functions of studies, for editors and type checkers: `python -m tests.release.stubs` writes it."""

from __future__ import annotations

import inspect
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

from gapwalk.studies import functions
from gapwalk.studies.study_kind import kind_of

STUB = Path(functions.__file__).with_suffix(".pyi")
_HEAD = '"""Signatures of the functions of studies; ``python -m tests.release.stubs`` writes this file."""\n'

_OTHERS = """FUNCTIONS: dict[str, str]

def keywords_of(kind: type[StudyKind]) -> Iterator[Any]: ...
def function_of(kind: type[StudyKind], name: str) -> Callable[..., Any]: ...
"""


def text() -> str:
    """Return the stub: a signature for each function, with what its types are imported from."""
    homes: dict[str, str] = {"System": "gapwalk.model.system", "Workers": "gapwalk.parallel.workers"}
    homes |= {"Report": "gapwalk.studies.runner", "StudyKind": "gapwalk.studies.study_kind"}
    lines = []
    for name in sorted(functions.FUNCTIONS):
        signature = inspect.signature(getattr(functions, name))
        shown = [_shown(each, homes) for each in signature.parameters.values()]
        place = next(k for k, each in enumerate(signature.parameters.values()) if each.kind is each.KEYWORD_ONLY)
        record = functions.record_of(kind_of(functions.FUNCTIONS[name]))
        homes[record.__name__] = record.__module__
        lines.append(f"def {name}({', '.join([*shown[:place], '*', *shown[place:]])}) -> {record.__name__}: ...\n")
    imports = [f"from {home} import {name}\n" for name, home in homes.items()]
    head = "import os\nfrom collections.abc import Callable, Iterator, Mapping, Sequence\nfrom typing import Any\n"
    return _formatted(_HEAD + head + "".join(imports) + _OTHERS + "".join(lines))


def _shown(each: inspect.Parameter, homes: dict[str, str]) -> str:
    default = "" if each.default is each.empty else " = ..."
    return f"{each.name}: {_words(each.annotation, homes)}{default}"


def _words(hint: Any, homes: dict[str, str]) -> str:
    """Return a type as it is written, and note the modules of the classes in it."""
    if isinstance(hint, str):
        return hint
    words = hint.__qualname__ if isinstance(hint, type) and "[" not in repr(hint) else repr(hint)
    if isinstance(hint, type) and hint.__module__.startswith("gapwalk"):
        homes[hint.__name__] = hint.__module__
    for whole in set(re.findall(r"gapwalk(?:\.\w+)+", words)):
        module, _, name = whole.rpartition(".")
        homes[name] = module
        words = words.replace(whole, name)
    return words.replace("typing.", "").replace("collections.abc.", "")


def _formatted(source: str) -> str:
    for command in (["check", "--fix", "--select", "I,F401", "--quiet", "-"], ["format", "-"]):
        run = [sys.executable, "-m", "ruff", *command, "--stdin-filename", str(STUB)]
        source = subprocess.run(run, input=source, capture_output=True, text=True, check=True).stdout
    return source


if __name__ == "__main__":
    STUB.write_text(text(), encoding="utf-8")

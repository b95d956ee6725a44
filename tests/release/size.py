"""The size of the house beside a reference (later the last release): `make lint` prints it, and fails over a budget.

A commit that adds a capability raises the budget in size.json, and says in its body what the lines are for.
"""

from __future__ import annotations

import ast
import io
import json
import sys
import tokenize
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "src" / "gapwalk"
RECORD = Path(__file__).with_suffix(".json")
NO_CODE = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENCODING,
    tokenize.ENDMARKER,
}


def size() -> dict[str, int]:
    """Count lines, files and public names: of the sources without blanks, imports and comments, and of the tests."""
    files = sorted(SOURCE.rglob("*.py"))
    texts = [file.read_text(encoding="utf-8") for file in files]
    counts = [lines_of(text) for text in texts]
    tests = [file.read_text(encoding="utf-8") for file in (ROOT / "tests").rglob("*.py")]
    names = json.loads(Path(__file__).with_name("names.json").read_text(encoding="utf-8"))["names"]
    return {
        "code": sum(code for code, _ in counts),
        "docstrings": sum(docs for _, docs in counts),
        "lines": sum(text.count("\n") for text in texts),
        "files": len(files),
        "public names": len(names),
        "lines of tests": sum(text.count("\n") for text in tests),
    }


def lines_of(text: str) -> tuple[int, int]:
    """Return how many lines of a module have code other than imports, and how many are docstrings."""
    tree = ast.parse(text)
    others: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            others |= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    docs: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, documented) and ast.get_docstring(node) is not None:
            first = node.body[0]
            docs |= set(range(first.lineno, (first.end_lineno or first.lineno) + 1))
    code: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in NO_CODE:
            code |= set(range(token.start[0], token.end[0] + 1))
    return len(code - others - docs), len(docs)


def main() -> int:
    """Print the sizes, and return 1 if one of them exceeds its budget."""
    record = json.loads(RECORD.read_text(encoding="utf-8"))
    now, last, budget = size(), record["reference"], record["budget"]
    print(f"{'':16}{'reference':>11}{'now':>9}{'budget':>9}")
    for name, count in now.items():
        print(f"{name:16}{last[name]:11,}{count:9,}{budget[name]:9,}")
    over = [name for name, count in now.items() if count > budget[name]]
    for name in over:
        print(
            f"{name}: {now[name]:,} is {now[name] - budget[name]:,} over the budget. If a capability needs this, raise "
            "the budget in tests/release/size.json in its commit, and say there what it is for."
        )
    return 1 if over else 0


if __name__ == "__main__":
    sys.exit(main())

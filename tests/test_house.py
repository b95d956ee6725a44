"""The rules of the house: imports go downwards, files stay small and say what they are for."""

import ast
import re
import subprocess
from collections.abc import Iterator
from fnmatch import fnmatch
from functools import cache
from pathlib import Path
from types import ModuleType

import pytest

import gapwalk
from gapwalk.orbit.harmonic_balance.compile_kernels import MODULES
from tests.tiers import QUICK, TESTS

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "src" / "gapwalk"
FILES = sorted(SOURCE.rglob("*.py"))
REPRODUCTIONS = sorted((ROOT / "reproductions").rglob("*.py"))

# From the lowest to the highest. A module may import from its own package and from any before it.
ORDER = (
    "field_docs",
    "lazy_names",
    "errors",
    "pieces",
    "interrupts",
    "files",
    "cache_folder",
    "machine_code",
    "late_scipy",
    "late_fields",
    "taylor",
    "bracketed_root",
    "summary",
    "notebook",
    "meanings",
    "picture_parts",
    "model",
    "paper",
    "flow",
    "ensemble",
    "orbit",
    "continuation",
    "bifurcation",
    "verification",
    "reduction",
    "attractors",
    "free",
    "tori",
    "measurement",
    "answers",
    "results",
    "parallel",
    "studies",
    "plot",
    "explorer",
    "cli",
)

# Namespaces: modules directly in gapwalk/ that have public names of one subject.
NAMESPACES = ("analysis", "ask", "laws", "loads", "measure", "methods", "special_points", "train")

# Modules directly in gapwalk/ that stand above all packages.
ABOVE_ALL = ("__init__", "__main__", *NAMESPACES)

# Names of gapwalk/__init__.py that any module may ask for.
ROOT_NAMES = ("__version__",)

# (file, function that holds the import, package imported): why.
PERMITTED = {
    ("bifurcation/follow.py", "follow", "verification"): "follow(verify=True) is a convenience; walking never verifies",
    ("bifurcation/branch.py", "unexplained", "bifurcation"): "derived when it is asked for; walking never looks at it",
    ("bifurcation/branch.py", "basins", "studies"): "basins() of a branch is a convenience; walking never settles",
    ("bifurcation/branch.py", "live", "plot"): "live() of a branch is a convenience; walking never draws",
    ("bifurcation/loci/locus.py", "live", "plot"): "live() of a locus is a convenience; following never draws",
    ("attractors/basins.py", "live", "plot"): "live() of shares is a convenience; sorting never draws",
    ("notebook.py", "plot", "plot"): "plot() of a record is a convenience; what makes records never draws",
    ("notebook.py", "_repr_html_", "plot"): "a card is a convenience of notebooks; its value never draws",
    ("summary.py", "to_dict", "results"): "plain values follow the type hints that the codec of results knows",
    ("summary.py", "to_xarray", "results"): "labelled arrays know the units of measures and states, as files do",
}

# Of code and comments: docstrings, of which the reference is made, are not counted.
MAX_LINES = 900

# File names that occur more than once below src/gapwalk: why.
SAME_NAMES = {
    "load.py": "a load of a model, and the loading of a result: each is what its folder calls it",
    "measure.py": "the namespace of measurements, and the comparison that `gapwalk measure` prints",
    "train.py": "the namespace of drive trains, and the train itself",
    "units.py": "units of a model, and of a study's quantities",
}

# Folders of the machine that the software was written on. Put together here so that this file names none.
LOCAL_PATH = re.compile(rb"(?<![\w.])/(?:" + b"|".join((b"work", b"root", b"tmp/play")) + rb")/")


@pytest.mark.parametrize("package", sorted({file.relative_to(SOURCE).parts[0] for file in FILES}))
def test_imports_go_downwards(package: str) -> None:
    upward = [
        complaint
        for file in FILES
        if file.relative_to(SOURCE).parts[0] == package
        for complaint in upward_imports(file.relative_to(SOURCE).as_posix(), file.read_text(encoding="utf-8"))
    ]
    assert not upward, "\n" + "\n".join(upward)


def test_reproductions_use_the_public_api_only() -> None:
    complaints = [
        complaint
        for file in REPRODUCTIONS
        for complaint in private_uses(file.relative_to(ROOT).as_posix(), file.read_text(encoding="utf-8"))
    ]
    assert REPRODUCTIONS
    assert not complaints, "\n" + "\n".join(complaints)


@pytest.mark.parametrize(
    "source",
    [
        "from gapwalk.studies.runner import run",
        "from gapwalk import follow",
        "import gapwalk.plot.style",
        "import gapwalk",
        "import gapwalk as gw\ngw.model.System",
        "import gapwalk as gw\ngw.no_such_name",
        "import gapwalk as gw\ngw.plot.style",
        "import gapwalk as gw\ngw.train.System",
        "import gapwalk as gw\ngw.paper._CASES",
        "import gapwalk as gw\ndef f(x: gw.study.file.Study): ...",
        "from importlib import import_module\nimport_module('gapwalk.model')",
    ],
)
def test_a_private_use_is_seen(source: str) -> None:
    assert len(list(private_uses("x.py", source))) == 1


def test_a_public_use_passes() -> None:
    source = "import gapwalk as gw\ngw.run(gw.Study(gw.paper.case('13'), 0))\ngw.plot.figure\ngw.train.Shaft"
    assert list(private_uses("x.py", source)) == []


def test_every_file_says_what_it_is_for() -> None:
    silent = [
        file.relative_to(ROOT).as_posix()
        for file in FILES + REPRODUCTIONS
        if not re.match(r'"""\w', text := file.read_text(encoding="utf-8")) and not ast.get_docstring(tree_of(text))
    ]
    assert not silent, f"open these with a docstring of one sentence on what they are for: {silent}"


def test_no_file_is_crowded() -> None:
    files = FILES + REPRODUCTIONS
    lengths = {file.relative_to(ROOT).as_posix(): lines_of_code(file) for file in files}
    crowded = {name: length for name, length in lengths.items() if length > MAX_LINES}
    assert not crowded, f"more than {MAX_LINES} lines, so probably more than one noun: {crowded}"


@cache
def tree_of(text: str) -> ast.Module:
    return ast.parse(text)


def lines_of_code(file: Path) -> int:
    """Count the lines of a file without its docstrings, where there may be too many."""
    text = file.read_text(encoding="utf-8")
    if text.count("\n") <= MAX_LINES:
        return 0
    places = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    bodies = [node.body for node in ast.walk(tree_of(text)) if isinstance(node, places) and ast.get_docstring(node)]
    return len(text.splitlines()) - sum((body[0].end_lineno or 0) - body[0].lineno + 1 for body in bodies)


def test_a_file_name_occurs_once() -> None:
    places: dict[str, list[str]] = {}
    for file in FILES:
        places.setdefault(file.name, []).append(file.relative_to(SOURCE).as_posix())
    repeated = {
        name: files
        for name, files in places.items()
        if len(files) > 1 and name != "__init__.py" and name not in SAME_NAMES
    }
    assert not repeated, f"give each of these files a name of its own: {repeated}"


def test_the_modules_with_kernels_are_there() -> None:
    folder = SOURCE / "orbit" / "harmonic_balance"
    assert all((folder / f"{name}.py").is_file() for name in MODULES)


def test_every_pattern_of_quick_tests_names_a_file() -> None:
    files = [file.relative_to(TESTS).as_posix() for file in TESTS.rglob("test_*.py")]
    stale = [pattern for pattern in QUICK if not any(fnmatch(file, pattern) for file in files)]
    assert not stale, f"rename these in tests/tiers.py too, or make quick leaves their tests out: {stale}"


def test_no_committed_file_names_a_path_of_one_machine() -> None:
    hits = [
        f"{name}:{number}: {line.decode(errors='replace').strip()[:120]}"
        for name in tracked_files()
        if (ROOT / name).is_file()  # tracked, but perhaps just deleted
        for number, line in enumerate((ROOT / name).read_bytes().splitlines(), start=1)
        if LOCAL_PATH.search(line)
    ]
    assert not hits, "paths of one machine in committed files:\n" + "\n".join(hits)


@pytest.mark.parametrize(
    ("file", "source"),
    [
        ("orbit/orbit_equation.py", "from gapwalk.continuation import walk"),
        ("orbit/orbit_equation.py", "import gapwalk.plot.style"),
        ("orbit/orbit_equation.py", "from gapwalk import study"),
        ("orbit/orbit_equation.py", "from gapwalk import Branch"),
        ("orbit/orbit_equation.py", "import gapwalk"),
        ("orbit/orbit_equation.py", "from ..continuation.walk import follow"),
        ("orbit/orbit_equation.py", "from .. import plot"),
        ("orbit/__init__.py", "from ..cli import main"),
        ("orbit/orbit_equation.py", "def f():\n    from gapwalk.plot import draw"),
        ("errors.py", "from gapwalk.model import System"),
        ("orbit/orbit_equation.py", "from gapwalk.attic import x"),
        ("attic/box.py", "import numpy"),
        ("bifurcation/branch.py", "from gapwalk.plot import draw"),
        ("bifurcation/branch.py", "def show():\n    from gapwalk.plot import draw"),
        ("continuation/walk.py", "def plot():\n    from gapwalk.plot import draw"),
    ],
)
def test_an_upward_import_is_seen(file: str, source: str) -> None:
    assert len(list(upward_imports(file, source))) == 1


@pytest.mark.parametrize(
    ("file", "source"),
    [
        ("orbit/orbit_equation.py", "import numpy as np\nfrom scipy import linalg"),
        ("orbit/orbit_equation.py", "from gapwalk.flow.flow import Flow\nfrom gapwalk.errors import GapwalkError"),
        ("orbit/orbit_equation.py", "from gapwalk import model, __version__"),
        ("orbit/orbit_equation.py", "from .floquet import multipliers\nfrom . import equation"),
        ("orbit/orbit_equation.py", "from ..model import System\nfrom .. import flow"),
        ("orbit/__init__.py", "from .newton import find_orbit"),
        ("cli.py", "from gapwalk.explorer import serve\nfrom .plot import draw"),
        ("__init__.py", "from .cli import main\nfrom .orbit import Orbit"),
        ("__main__.py", "from gapwalk.cli import main"),
        ("notebook.py", "class Shown:\n    def plot(self):\n        from gapwalk import plot"),
    ],
)
def test_a_downward_import_passes(file: str, source: str) -> None:
    assert list(upward_imports(file, source)) == []


def upward_imports(file: str, source: str) -> Iterator[str]:
    """Complain about each import in `file` (a path below gapwalk/) that does not go downwards."""
    parts = file.removesuffix(".py").split("/")
    here = parts[0]
    if here in ABOVE_ALL:
        return
    if here not in ORDER:
        yield f"{file}: give gapwalk.{here} a place in ORDER"
        return
    stated = re.findall(r"^ *(?:from|import) .*", source, re.MULTILINE)
    names = re.findall(r"(?:\bgapwalk\b\.?|from \.)(\w*)", "\n".join(stated))
    if {*names} <= {*ORDER[: ORDER.index(here) + 1]}:
        return  # most files: to read their trees takes seconds
    for line, function, target in imports(["gapwalk", *parts[:-1]], tree_of(source)):
        if (file, function, target) in PERMITTED or target in ROOT_NAMES:
            continue
        if target not in ORDER:
            name = f"gapwalk.{target}" if target else "gapwalk itself"
            yield f"{file}:{line}: imports {name}, which has no place in ORDER"
        elif ORDER.index(target) > ORDER.index(here):
            yield f"{file}:{line}: {here} imports {target}, which is above it"


def imports(package: list[str], node: ast.AST, function: str = "") -> Iterator[tuple[int, str, str]]:
    """Yield (line, enclosing function, what follows `gapwalk.`) for each import of gapwalk below `node`."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import):
            modules = [alias.name.split(".") for alias in child.names]
        elif isinstance(child, ast.ImportFrom):
            base = package[: len(package) - child.level + 1] if child.level else []
            module = base + (child.module.split(".") if child.module else [])
            modules = [[*module, alias.name] for alias in child.names] if module == ["gapwalk"] else [module]
        elif isinstance(child, ast.expr):
            continue  # holds no statement
        else:
            inner = child.name if isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef)) else function
            yield from imports(package, child, inner)
            continue
        for path in modules:
            if path[0] == "gapwalk":
                yield child.lineno, function, path[1] if len(path) > 1 else ""


def private_uses(file: str, source: str) -> Iterator[str]:
    """Complain about each use of gapwalk that is not `gw.name` or `gw.module.name` with public names."""
    tree = tree_of(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "gapwalk":
            yield f"{file}:{node.lineno}: write `import gapwalk as gw`, and its public names as gw.name"
        elif isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name.partition(".")[0] == "gapwalk" and (alias.name, alias.asname) != ("gapwalk", "gw"):
                    yield f"{file}:{node.lineno}: write `import gapwalk as gw`, and its public names as gw.name"
        elif isinstance(node, ast.Constant) and re.fullmatch(r"gapwalk(\.\w+)+", str(node.value)):
            yield f"{file}:{node.lineno}: {node.value!r} looks like a module that is imported by its name"
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "gw":
            if node.attr not in public_names(gapwalk):
                yield f"{file}:{node.lineno}: gw.{node.attr} is not public"
        elif isinstance(node, ast.Attribute) and ast.unparse(node.value).removeprefix("gw.") in gapwalk.__all__:
            module = getattr(gapwalk, ast.unparse(node.value).removeprefix("gw."))
            if isinstance(module, ModuleType) and node.attr not in public_names(module):
                yield f"{file}:{node.lineno}: {ast.unparse(node)} is not public"


def public_names(module: ModuleType) -> set[str]:
    """Return the names that a module promises."""
    if module is gapwalk:
        return {*gapwalk.__all__, "__version__", "__file__"}
    return {*getattr(module, "__all__", [name for name in vars(module) if not name.startswith("_")])}


def tracked_files() -> list[str]:
    """Return the files that git tracks; skip the test where there is no git or no checkout."""
    try:
        listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("not a git checkout, or no git")
    return [name for name in listing.stdout.decode().split("\0") if name]

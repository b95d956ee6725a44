"""Processes that start before a run has loaded what it needs: for which files, and with what."""

import inspect
import subprocess
import sys
from dataclasses import fields

import pytest

from gapwalk.cli import foreseen
from gapwalk.cli.foreseen import foresee, foreseen_modules
from gapwalk.parallel import processes
from gapwalk.studies.study_kind import kind_of, kinds

OWN = [name for name in kinds() if kind_of(name).__module__.startswith("gapwalk.")]


def test_kinds_that_several_processes_share_are_foreseen() -> None:
    shared = [name for name in OWN if any(field.name == "workers" for field in fields(kind_of(name)))]
    expected = {name: inspect.getmodule(kind_of(name)).__name__.rpartition(".")[2] for name in shared}  # type: ignore[union-attr]
    assert expected == foreseen._SHARED


@pytest.mark.parametrize(
    ("text", "modules"),
    [
        ('[study]\nkind = "map"\n', ["gapwalk.studies.map_study"]),
        (
            "[[study]]\n kind='sweep' # many\n[[study]]\nkind = \"basins\"\n[[study]]\nkind = 'sweep'\n",
            ["gapwalk.studies.sweep_study", "gapwalk.studies.basin_study"],
        ),
        ('[study]\nkind = "response"\n', []),
        ('[study]\nkind = "map"\nworkers = 1  # alone\n', []),
        ('[study]\nkind = "map"\nworkers = 12\n', ["gapwalk.studies.map_study"]),
        ('[study]\n# kind = "map"\nkind = "mapp"\n', []),
        ("", []),
    ],
)
def test_the_text_of_a_file_says_what_its_processes_load(text, modules) -> None:
    assert foreseen_modules(text) == modules


def test_only_files_for_which_there_are_cores_are_foreseen(tmp_path, monkeypatch) -> None:
    started: list[object] = []
    monkeypatch.setattr(processes, "start_server", started.append)
    file = tmp_path / "model.toml"
    file.write_text('[study]\nkind = "map"\n')
    for cores, path in ((1, file), (2, tmp_path), (2, tmp_path / "missing.toml"), (2, file)):
        assert not started
        monkeypatch.setattr(processes, "local_cores", lambda cores=cores: cores)
        foresee(path)
    assert started == [["gapwalk.studies.runner", "gapwalk.studies.map_study"]]
    file.write_bytes(b'kind = "map"\n\xff')  # not even text
    foresee(file)
    assert len(started) == 1


def test_a_run_foresees_its_processes_before_it_loads_what_it_needs(tmp_path) -> None:
    file = tmp_path / "model.toml"
    file.write_text('[study]\nkind = "regimes"\n')
    script = (
        "import sys, gapwalk.parallel.processes as processes\n"
        "from gapwalk.cli import main\n"
        "processes.local_cores = lambda: 2\n"
        "processes.start_server = lambda names: print(names[1:], 'numpy' in sys.modules)\n"
        f"main(['run', {str(file)!r}])\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["['gapwalk.studies.regime_study'] False"]


def modules_of(_: object) -> list[str]:
    """The modules of the process that does it."""
    return list(sys.modules)


@pytest.mark.slow
def test_foreseen_processes_have_what_their_work_needs() -> None:
    """They have it before this process has, with the packages that the batch integrator loads when it works."""
    script = (
        "import sys\n"
        "from gapwalk.parallel.processes import start_server\n"
        "start_server(['gapwalk.studies.runner', 'gapwalk.studies.regime_study'])\n"
        "import gapwalk as gw\n"
        "from tests.cli.test_foreseen import modules_of\n"
        "with gw.parallel.local_workers(1 + 1) as workers:\n"
        "    import gapwalk.studies.regime_study\n"
        "    import gapwalk.studies.runner\n"
        "    own = {name for name in sys.modules if name.startswith('gapwalk.studies')}\n"
        "    for _, found in workers.each(modules_of, [0, 1]):\n"
        "        print(sorted(own - set(found)), 'numba' in found, 'numba' in sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["[] True False"] * 2

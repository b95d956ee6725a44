"""gapwalk is imported where Python has nothing of Unix alone: on Windows, and on macOS."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import gapwalk

SOURCE = Path(gapwalk.__file__).parent
UNIX = {"fcntl", "grp", "posix", "pty", "pwd", "resource", "syslog", "termios", "tty"}
"""Modules that Windows does not have."""
IMPORT = re.compile(rf"^(?:import|from) .*\b(?:{'|'.join(UNIX)})\b", re.MULTILINE)


def test_no_module_imports_what_windows_lacks() -> None:
    found = []
    for file in SOURCE.rglob("*.py"):
        if not IMPORT.search(file.read_text(encoding="utf-8")):
            continue  # most files: to read their trees takes seconds
        for node in ast.parse(file.read_bytes()).body:  # a function guards what it imports
            names = [each.name for each in node.names] if isinstance(node, ast.Import) else []
            names += [str(node.module)] if isinstance(node, ast.ImportFrom) else []
            found += [f"{file.name}: {name}" for name in names if name.partition(".")[0] in UNIX]
    assert found == []


def test_the_flow_is_kept_and_loaded_without_them() -> None:
    """Modules of Unix are refused from the start, as far as the packages below allow it."""
    script = (
        "import subprocess, multiprocessing.util, tempfile, sys\n"  # they import it where they can
        f"sys.modules.update(dict.fromkeys({sorted(UNIX - {'posix'})}))\n"
        "import gapwalk as gw, numpy as np\n"
        "import gapwalk.model.channels.channel_process, gapwalk.parallel.processes, gapwalk.explorer.engine\n"
        "stop = gw.Contact('stop', {'x': 1.0}, [gw.Stage(0.1, 5.0)])\n"
        "system = gw.System(['x'], [[1.0]], [[0.1]], contacts=[stop], harmonics=[gw.Harmonic(0.7, {'x': 1.0})])\n"
        "print(len(gw.integrate(system, [0.0, 0.0], periods=2).events) > 2)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("True\n", "")

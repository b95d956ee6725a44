"""Code of pages, run before the pages are read: each page in a process of its own, into myst_nb's cache.

The processes of Sphinx (`--jobs`), which read and write the pages, cannot run the code instead: they would create
the cache at once, and each gets a fixed share of the pages, the dearest ones among them or not. Nor do
kernels of Jupyter run it: each would import gapwalk and read its compiled code again, for three seconds of a core; a
fork has both.
"""

from __future__ import annotations

import os
import sys
import time
import traceback
from collections.abc import Sequence
from contextlib import chdir
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from pathlib import Path

from IPython.core.displayhook import DisplayHook
from IPython.core.interactiveshell import InteractiveShell
from IPython.utils.capture import capture_output
from jupyter_cache import get_cache
from jupyter_cache.base import CacheBundleIn
from jupyter_cache.cache.main import JupyterCacheBase
from myst_nb.core.read import create_nb_reader
from myst_nb.sphinx_ import SphinxEnvType
from nbformat import NotebookNode
from nbformat.v4 import new_output
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util import logging
from traitlets import Type
from traitlets.config import Config

LOG = logging.getLogger(__name__)
CONTEXT = get_context("fork" if sys.platform == "linux" else "spawn")


def run_all(app: Sphinx, env: SphinxEnvType, docnames: Sequence[str]) -> None:
    """Run the code of all pages that will be read and whose results are not in the cache."""
    settings = env.mystnb_config
    if settings.execution_mode != "cache":
        return
    cache = get_cache(settings.execution_cache_path)
    pages = [(path, book) for path in map(str, map(env.doc2path, docnames)) if (book := _notebook(Path(path), env))]
    missing = [each for each in pages if not _is_known(cache, each[1])]
    missing.sort(key=lambda each: sum(len(cell.source) for cell in each[1].cells if cell.cell_type == "code"))
    if missing:
        _warm_up()
    cores = sorted(os.sched_getaffinity(0)) if sys.platform == "linux" else [*range(os.cpu_count() or 1)]
    number, running = len(missing), {}
    while missing or running:
        while missing and cores:
            path, book = missing.pop()
            here, there = CONTEXT.Pipe(duplex=False)
            process = CONTEXT.Process(target=_run, args=(there, path, book, core := cores.pop()))
            process.start()
            there.close()
            running[here] = path, process, core
        for here in wait(list(running)):
            path, process, core = running.pop(here)
            try:
                book, seconds, failure = here.recv()
            except EOFError:
                failure = "its process ended"
            process.join()
            cores.append(core)
            if failure:
                raise ExtensionError(f"the code of {path} failed:\n{failure}")
            bundle = CacheBundleIn(book, path, data={"execution_seconds": seconds})
            cache.cache_notebook_bundle(bundle, check_validity=False, overwrite=True)
            left = len(missing) + len(running)
            LOG.info(f"ran the code of {env.path2doc(path)} in {seconds:.0f} s ({number - left} of {number})")


def _notebook(path: Path, env: SphinxEnvType) -> NotebookNode | None:
    """Return the notebook of a page; None for a page without code that is run."""
    text = path.read_text(encoding="utf-8")
    reader = create_nb_reader(str(path), env.myst_config, env.mystnb_config, text)
    book = reader and reader.read(text)
    return book if book and any(cell.cell_type == "code" for cell in book.cells) else None


def _is_known(cache: JupyterCacheBase, book: NotebookNode) -> bool:
    try:
        return bool(cache.match_cache_notebook(book))
    except KeyError:
        return False


def _warm_up() -> None:
    """Import what all pages need, and read the compiled code, for all processes that are forked from this one."""
    import matplotlib.pyplot as plt

    import gapwalk as gw

    parts = {"contacts": [gw.stop("stop", {"x": 1.0}, 1.0, 3.0)], "harmonics": [gw.Harmonic(0.3, {"x": 1.0})]}
    system = gw.System(["x"], stiffness=[[1.0]], damping=[[0.1]], **parts)
    gw.follow(gw.find_orbit(system, frequency=1.2), "frequency", to=1.0).plot()
    plt.close("all")


def _run(there: Connection, path: str, book: NotebookNode, core: int) -> None:
    """Run the code of a page in this process; send the page with its outputs, the time, and the error if any."""
    # processes and threads on all cores would cost more than they gain beside other pages
    if sys.platform == "linux":
        os.sched_setaffinity(0, {core})
    began, failure = time.monotonic(), ""
    try:
        with chdir(Path(path).parent):
            _fill(book)
    except Exception:
        failure = traceback.format_exc()
    there.send((book, time.monotonic() - began, failure))


class _Hook(DisplayHook):
    """The value of a cell is displayed, unless the cell ends with a semicolon."""

    def write_output_prompt(self) -> None:
        """Write no number of the cell."""

    def write_format_data(self, format_dict: dict, md_dict: dict | None = None) -> None:
        """Display the value in the forms that it has."""
        self.shell.display_pub.publish(format_dict, md_dict)


class _Shell(InteractiveShell):
    """The shell of a page."""

    displayhook_class = Type(_Hook)

    def enable_gui(self, gui: str | None = None) -> None:
        """Do nothing: there is no window."""


def _fill(book: NotebookNode) -> None:
    """Run all cells of a notebook, and add their outputs as a kernel of Jupyter does."""
    shell = _Shell.instance(config=Config(HistoryManager={"enabled": False}))
    shell.run_line_magic("matplotlib", "inline")
    book.metadata["language_info"] = {"name": "python", "pygments_lexer": "ipython3"}
    for cell in (each for each in book.cells if each.cell_type == "code"):
        with capture_output() as got:
            done = shell.run_cell(cell.source, store_history=True)
        done.raise_error()
        texts = {"stdout": got.stdout, "stderr": got.stderr}
        cell.outputs = [new_output("stream", name=name, text=text) for name, text in texts.items() if text]
        cell.outputs += [new_output("display_data", each.data, metadata=each.metadata) for each in got.outputs]


def setup(app: Sphinx) -> dict[str, bool]:
    """Run the code once Sphinx knows which pages it will read."""
    app.connect("env-before-read-docs", run_all)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

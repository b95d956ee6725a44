"""Code of pages, run before the pages are read: several at a time, each in a process of its own, into myst_nb's cache.

The processes of Sphinx (`--jobs`), which read and write the pages, cannot run the code instead: they would create
the cache at once, and each gets a fixed share of the pages, the dearest ones among them or not.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from jupyter_cache import get_cache
from jupyter_cache.base import CacheBundleIn
from jupyter_cache.cache.main import JupyterCacheBase
from jupyter_cache.executors.utils import ExecutionResult, single_nb_execution
from myst_nb.core.read import create_nb_reader
from myst_nb.sphinx_ import SphinxEnvType
from nbformat import NotebookNode
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util import logging

LOG = logging.getLogger(__name__)


def run_all(app: Sphinx, env: SphinxEnvType, docnames: Sequence[str]) -> None:
    """Run the code of all pages that will be read and whose results are not in the cache."""
    settings = env.mystnb_config
    if settings.execution_mode != "cache":
        return
    cache = get_cache(settings.execution_cache_path)
    pages = [(path, book) for path in map(str, map(env.doc2path, docnames)) if (book := _notebook(Path(path), env))]
    missing = [each for each in pages if not _is_known(cache, each[1])]
    missing.sort(key=lambda each: -sum(len(cell.source) for cell in each[1].cells if cell.cell_type == "code"))
    cores = sorted(os.sched_getaffinity(0)) if sys.platform == "linux" else [*range(os.cpu_count() or 1)]
    with ThreadPoolExecutor(len(cores), initializer=_take_core, initargs=(cores,)) as threads:
        work = {threads.submit(_run, path, book, settings.execution_timeout): path for path, book in missing}
        for number, done in enumerate(as_completed(work), 1):
            path, result = work[done], done.result()
            if result.err is not None:
                threads.shutdown(cancel_futures=True)
                raise ExtensionError(f"the code of {path} failed:\n{result.exc_string}")
            data = {"execution_seconds": result.time}
            cache.cache_notebook_bundle(CacheBundleIn(result.nb, path, data=data), check_validity=False, overwrite=True)
            LOG.info(f"ran the code of {env.path2doc(path)} in {result.time:.0f} s ({number} of {len(work)})")


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


def _take_core(cores: list[int]) -> None:
    """Give this thread, which waits for the process of a notebook, and that process one of the cores."""
    core = cores.pop()
    # processes and threads on all cores would cost more than they gain beside other notebooks
    if sys.platform == "linux":
        os.sched_setaffinity(0, {core})


def _run(path: str, book: NotebookNode, timeout: int) -> ExecutionResult:
    return single_nb_execution(book, cwd=str(Path(path).parent), allow_errors=False, timeout=timeout)


def setup(app: Sphinx) -> dict[str, bool]:
    """Run the code once Sphinx knows which pages it will read."""
    app.connect("env-before-read-docs", run_all)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

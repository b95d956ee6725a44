"""Workers of a Dask cluster that runs already; for `docs/howto/cluster.md`."""

from __future__ import annotations

import os
import re
import time
import warnings
from collections.abc import Callable
from concurrent.futures import Future, wait
from functools import partial
from textwrap import shorten
from typing import Any
from weakref import WeakKeyDictionary

from gapwalk.errors import GapwalkError, ModelError, WorkError
from gapwalk.model.registry import extensions
from gapwalk.parallel.shared import Shared, do_shared
from gapwalk.results.result_file import sources, versions

_CONNECT = 10.0  # seconds
_LOOK = 2.0  # seconds from one look at the cluster to the next
_TELL = 10.0  # seconds after which it is reported that all workers have gone; one that died is back sooner
_PATIENCE = 120.0  # seconds after which the work ends if all workers have gone
_AHEAD = 2  # pieces under way for each worker: the next one waits there while the last one's result travels
_EXAMPLE = "such as tcp://node7:8786"
_DECISIVE = ("gapwalk", "sources", "llvmlite", "numba")  # the code that does the work; other versions only warn


class Cluster:
    """The workers of a Dask cluster; a `Executor`.

    Workers may come and go while it is used. Each is asked for its software before it gets any work: one whose results
    may differ is named and left out. Dask itself does a piece of work again whose worker has died.
    """

    tries = 3
    """Each counts for several deaths, Dask's ``allowed-failures`` and one, but perhaps of another piece's making; or
    for the death of all workers that might do the piece."""

    patience = _LOOK

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client, KilledWorker
        except ModuleNotFoundError:
            raise ModelError("work on a cluster needs Dask; install it: pip install 'gapwalk[cluster]'") from None
        self.address, self._killed = address, KilledWorker
        self._modules = tuple(name for name in extensions() if name != "__main__")
        self._ours = software(self._modules)
        self._client = _connect(Client, address)
        self._executor = self._client.get_executor(pure=False)
        self._asked: dict[str, Future[dict[str, str]]] = {}  # the coming answers of new workers
        self._faults: dict[str, str] = {}  # of the workers that have answered; "" for none
        self._good: frozenset[str] = frozenset()  # the workers that may do the work
        self._sent: WeakKeyDictionary[Future[Any], frozenset[str]] = WeakKeyDictionary()  # which of them may do each
        self._function = b"", None  # what is there: its key, and its bytes as a task, which the scheduler can repeat
        self._seen = self._last_good = 0.0  # times; the latter is 0 until there is a worker
        self._is_told = False
        try:
            self._meet()
        except BaseException:
            self._client.close()
            raise

    @property
    def size(self) -> int:
        """Number of pieces that should be in progress, for the present size of the cluster."""
        if time.monotonic() - self._seen > _LOOK:
            self.check()
        return _AHEAD * len(self._good)

    def prepare(self) -> None:
        """Do nothing, because the workers run already."""

    def begin(self, function: Shared, piece: Any) -> Future[Any]:
        """Have a worker do a piece; the function goes to the workers apart, from one to the other."""
        if self._function[0] != function.key:
            self._function = function.key, self._client.submit(bytes, function.packed, pure=False)
        task = *self._function, piece, self._modules, self._ours
        future = self._executor.submit(_do_shared_piece, *task, workers=sorted(self._good))
        self._sent[future] = self._good
        return future

    def is_loss(self, error: BaseException) -> bool:
        """Return True if workers died over a piece, or one with other software came to the address of a worker."""
        if isinstance(error, ReplacedError):
            self._faults.clear()  # all of them are asked again, from now on
            self._last_good = time.monotonic()
            self.check()
        return isinstance(error, (self._killed, ReplacedError))

    def check(self) -> None:
        """See who is there; raise a WorkError if the scheduler is lost, or all workers have been away for long."""
        if self._client.status != "running":
            raise WorkError(
                f"the Dask scheduler at {self.address} has stopped; finished work is kept. Start it again and resume"
            )
        self._look()
        self._seen = now = time.monotonic()
        if self._good or not self._last_good:
            self._last_good, self._is_told = now if self._good else 0.0, False
        elif not self._is_told and now - self._last_good > _TELL:
            self._is_told = True
            warnings.warn(
                f"no worker of the cluster at {self.address} is left. The work goes on when others come; if none comes "
                f"within {_PATIENCE - _TELL:g} s, it ends, and what is finished is kept",
                stacklevel=4,
            )
        elif now - self._last_good > _PATIENCE:
            raise WorkError(
                f"no worker of the cluster at {self.address} has been there for {_PATIENCE:g} s; finished work is "
                "kept. Start workers and resume"
            )

    def close(self, *, at_once: bool) -> None:
        """Leave the cluster, which keeps running; results that were not fetched are forgotten there."""
        self._executor.shutdown(wait=not at_once)
        self._client.close()

    def _look(self) -> None:
        """Find out who may do the work, and take back what nobody is left to do."""
        living = set(self._client.nthreads())
        for known in (self._faults, self._asked):
            for gone in known.keys() - living:
                del known[gone]
        for new in living - self._faults.keys() - self._asked.keys():
            self._asked[new] = self._executor.submit(software, self._modules, workers=[new], priority=1)
        for worker in [each for each, answer in self._asked.items() if answer.done()]:
            self._faults[worker] = self._fault(worker, self._asked.pop(worker))
        self._good = frozenset(worker for worker, fault in self._faults.items() if not fault)
        for future, able in list(self._sent.items()):
            if not able & living:
                future.cancel()

    def _fault(self, worker: str, answer: Future[dict[str, str]]) -> str:
        """Return why a worker is left out, and say so; empty if it may do the work."""
        if error := answer.exception():  # what goes wrong there comes in many types
            fault = f"the worker {worker} cannot do the work ({shorten(str(error), 140)})"
        else:
            fault = difference(self._ours, answer.result(), f"the worker {worker}")
        if fault:
            warnings.warn(f"{fault}; it is left out. {self._advice}", stacklevel=5)
        return fault

    @property
    def _advice(self) -> str:
        here = f"gapwalk {self._ours['gapwalk']}, with its extra [cluster]"
        return f"Install there, and where the scheduler runs, what is installed here ({here})"

    def _meet(self) -> None:
        """Wait until the workers that are there have answered; raise a ModelError if none of them may do the work."""
        self.check()
        wait(self._asked.values(), timeout=_CONNECT)
        self.check()
        threads = self._client.nthreads()
        if self._faults and not self._good and not self._asked:
            fault = next(iter(self._faults.values()))
            raise ModelError(f"none of {len(self._faults)} workers may do the work: {fault}. {self._advice}")
        if not threads:
            warnings.warn(
                f"the cluster at {self.address} has no workers yet; the work begins when they come", stacklevel=4
            )
        if any(count > 1 for count in threads.values()):
            warnings.warn(
                f"workers of the cluster at {self.address} have several threads, which are hardly faster than one, for "
                "they share an interpreter; start them with one each, and as many as there are cores: dask worker "
                "--nworkers -1 --nthreads 1",
                stacklevel=4,
            )


class ReplacedError(GapwalkError):
    """A worker was replaced at its address by one with other software."""


def software(modules: tuple[str, ...]) -> dict[str, str]:
    """Return the versions of the software of this process, and the hash of gapwalk's sources and of modules."""
    return {**versions(), "sources": sources(modules)}


def do_piece(function: Callable[[Any], Any], piece: Any, modules: tuple[str, ...], expected: dict[str, str]) -> Any:
    """Do a piece on a worker, unless its software is not that of the worker which was asked."""
    if fault := difference(expected, software(modules), "the worker"):
        raise ReplacedError(fault)
    return function(piece)


def _do_shared_piece(key: bytes, packed: bytes, *task: Any) -> Any:
    return do_piece(partial(do_shared, key, packed), *task)


def difference(ours: dict[str, str], theirs: dict[str, str], worker: str) -> str:
    """Say which difference of a worker's software may change the result; warn if only the last digits may differ."""
    for name, version in ours.items():
        if theirs.get(name) != version:
            text = f"{worker} has {name} {theirs.get(name)}, and here it is {version}"
            if name == "sources":
                text = f"{worker} has other code of this version of gapwalk (hash {theirs.get(name)}, here {version})"
            if name in _DECISIVE:
                return f"{text}, so its results may differ"
            warnings.warn(f"{text}; results may differ in the last digits", stacklevel=2)
    return ""


def _connect(client: Callable[..., Any], address: str) -> Any:
    options: dict[str, Any] = {"timeout": _CONNECT, "set_as_default": False, "name": "gapwalk"}
    is_file = address.endswith(".json")
    if is_file and not os.path.exists(address):
        raise ModelError(f"there is no scheduler file {address}; it is what `dask scheduler --scheduler-file` writes")
    if not is_file and not re.fullmatch(r"([a-z+]+://)?\S+:\d+/?", address):
        raise ModelError(f"scheduler is {address!r}; write the address that `dask scheduler` prints, {_EXAMPLE}")
    try:
        return client(scheduler_file=address, **options) if is_file else client(address, **options)
    except (OSError, ValueError) as error:
        raise ModelError(
            f"no Dask scheduler answers at {address} ({error}); start one with `dask scheduler`, and write the address "
            f"that it prints, {_EXAMPLE}"
        ) from None

"""Workers of a Dask cluster that runs already; for `docs/howto/cluster.md`."""

from __future__ import annotations

import os
import re
import time
import warnings
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from gapwalk.errors import ModelError, WorkError
from gapwalk.results.versions import versions

_CONNECT = 10.0  # seconds
_LOOK = 2.0  # seconds from one look at the cluster to the next
_AHEAD = 2  # pieces under way for each worker: the next one waits there while the last one's result travels
_EXAMPLE = "such as tcp://node7:8786"
_DECISIVE = ("gapwalk", "heyoka")  # another version may give another result


class Cluster:
    """The workers of a Dask cluster; a `Executor`.

    Workers may come and go while it is used. Dask itself does a piece of work again whose worker has died.

    Parameters
    ----------
    address
        Address of the scheduler, such as ``tcp://node7:8786``; or the name of its scheduler file, which ends with
        ``.json``.

    Raises
    ------
    ModelError
        If Dask is not installed, no scheduler answers, or its workers cannot do the work of this version.
    """

    tries = 2
    """Each counts for several deaths, Dask's ``allowed-failures`` and one, but perhaps of another piece's making."""

    patience = _LOOK

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client, KilledWorker
        except ModuleNotFoundError:
            raise ModelError("work on a cluster needs Dask; install it: pip install 'gapwalk[cluster]'") from None
        self.address, self._killed = address, KilledWorker
        self._client = _connect(Client, address)
        try:
            self._versions = versions()
            self._check_workers()
            self._executor = self._client.get_executor(pure=False)
            self._size, self._seen = self._count(), time.monotonic()
        except BaseException:
            self._client.close()
            raise

    @property
    def size(self) -> int:
        """Number of pieces that should be in progress, for the present size of the cluster."""
        if time.monotonic() - self._seen > _LOOK:
            self._size, self._seen = self._count(), time.monotonic()
        return self._size

    def prepare(self) -> None:
        """Do nothing, because the workers run already."""

    def begin(self, function: Callable[[Any], Any], piece: Any) -> Future[Any]:
        """Have a worker do a piece."""
        return self._executor.submit(do_piece, function, piece, self._versions)

    def is_loss(self, error: BaseException) -> bool:
        """Return True if workers died over a piece."""
        return isinstance(error, self._killed)

    def check(self) -> None:
        """Raise a WorkError if the connection to the scheduler is lost."""
        if self._client.status != "running":
            raise WorkError(
                f"the Dask scheduler at {self.address} has stopped; finished work is kept. Start it again and resume"
            )

    def close(self, *, at_once: bool) -> None:
        """Leave the cluster, which keeps running; results that were not fetched are forgotten there."""
        self._executor.shutdown(wait=not at_once)
        self._client.close()

    def _count(self) -> int:
        self.check()
        return _AHEAD * max(1, len(self._client.nthreads()))

    def _check_workers(self) -> None:
        """Check that there are workers, with this version of gapwalk and one thread each."""
        try:
            found = self._client.run(versions)
        except Exception as error:  # what goes wrong there comes in many types
            raise ModelError(
                f"the workers of the cluster at {self.address} cannot do the work ({error}); install gapwalk "
                f"{self._versions['gapwalk']} with its extra [cluster] there too"
            ) from None
        # one worker of each kind is enough to tell
        for worker, theirs in {tuple(theirs.items()): (worker, theirs) for worker, theirs in found.items()}.values():
            check_versions(self._versions, theirs, worker)
        threads = self._client.nthreads()
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


def do_piece(function: Callable[[Any], Any], piece: Any, expected: dict[str, str]) -> Any:
    """Do a piece on a worker after a check of its versions, because it may be new; errors as the function."""
    check_versions(expected, versions(), "one of them")
    return function(piece)


def check_versions(ours: dict[str, str], theirs: dict[str, str], worker: str) -> None:
    """Compare the versions of the software here and on a worker.

    Raises
    ------
    ModelError
        If the difference may change the result.
    """
    for name, version in ours.items():
        if theirs.get(name) != version:
            text = f"the workers of the cluster have {name} {theirs.get(name)} ({worker}), and here it is {version}"
            if name in _DECISIVE:
                raise ModelError(f"{text}; results may differ, so install the same version on both")
            warnings.warn(f"{text}; results may differ in the last digits", stacklevel=2)


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

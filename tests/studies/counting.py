"""An executor in this process that counts tasks, as if it were some processes."""

import pickle
from collections import Counter
from concurrent.futures import Future
from typing import Any

from gapwalk.parallel.shared import Shared
from gapwalk.parallel.workers import Workers


class Counting:
    """Several tasks in progress, each done when it begins; everything that is sent goes through bytes."""

    tries, patience = 3, None

    def __init__(self, size: int = 2) -> None:
        self.size, self.counts, self.shared, self.bytes = size, Counter[str](), set[bytes](), 0

    def prepare(self) -> None:
        pass

    def check(self) -> None:
        pass

    def is_loss(self, error: BaseException) -> bool:
        return False

    def close(self, *, at_once: bool) -> None:
        pass

    def begin(self, function: Shared, piece: Any) -> Future[Any]:
        packed, future = pickle.dumps(piece), Future[Any]()
        self.bytes += len(packed)
        self.shared.add(function.key)
        work = pickle.loads(function.packed)
        self.counts[name_of(work)] += 1
        try:
            future.set_result(pickle.loads(pickle.dumps(work(pickle.loads(packed)))))
        except Exception as error:
            future.set_exception(error)
        return future


def name_of(function: Any) -> str:
    """The name of the function of the pieces, without what is around it."""
    if hasattr(function, "func"):
        inner = name_of(function.func)
        return name_of(function.args[-1]) if inner in ("_attempt", "_do_several", "_do_with") else inner
    return function.__name__


def counting(size: int = 2) -> tuple[Workers, Counting]:
    executor = Counting(size)
    return Workers(executor), executor

"""The workers of a real Dask cluster: the same results, also when one of them is killed, and teaching errors."""

import json
import os
import shutil
import signal
import subprocess
import sys
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import ModelError, WorkError
from gapwalk.flow import Flow
from gapwalk.parallel import cluster as module
from gapwalk.parallel.cluster import Cluster, ReplacedError, difference, do_piece, software
from gapwalk.parallel.workers import Workers, local_workers, on_cluster
from gapwalk.results.result_file import sources
from tests.studies.diagrams import clutch_diagram
from tests.studies.pieces import die_at_three, fail_at_three, slow_double, slow_pid
from tests.studies.same import assert_same_result
from tests.studies.sweeps import FOLDS, options
from tests.tiers import in_campaign, keeps
from tests.waiting import PATIENCE, until

distributed = pytest.importorskip("distributed", reason="needs the extra gapwalk[cluster]")


@pytest.fixture(scope="module")
def cluster():
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs=50
    ) as found:
        yield found


@pytest.fixture(scope="module")
def workers(cluster):
    executor = Cluster(cluster.scheduler_address)
    yield Workers(executor)
    executor.close(at_once=False)


@keeps("False")
@pytest.mark.parametrize("in_order", [True, False])
def test_results_are_those_of_one_process(workers, in_order) -> None:
    accepted = []
    workers.run(slow_double, list(range(6)), lambda index, result: accepted.append((index, result)), in_order=in_order)
    assert sorted(accepted) == [(number, 2 * number) for number in range(6)]
    assert not in_order or accepted == sorted(accepted)


def test_superfluous_pieces_are_left_out(workers) -> None:
    accepted = []
    workers.run(slow_double, list(range(6)), lambda index, result: accepted.append(index), lambda index: index != 3)
    assert accepted == [0, 1, 2, 4, 5]


@pytest.mark.slow
def test_a_worker_that_is_killed_costs_nothing_but_time(workers) -> None:
    pids = {}

    def accept(index: int, pid: int) -> None:
        pids[index] = pid
        if len(pids) == 3:
            os.kill(pid, signal.SIGKILL)

    workers.run(slow_pid, list(range(16)), accept, in_order=False)
    assert sorted(pids) == list(range(16))
    assert len(set(pids.values()) - {os.getpid()}) >= 2


@pytest.mark.slow
def test_a_sweep_with_a_killed_worker_is_that_of_one_process(cluster, workers) -> None:
    alone = gw.sweep(*FOLDS, **options(starts=2))
    pids = list(workers.executor._client.run(os.getpid).values())[:1]

    def report(stretch, pace) -> None:
        if pids:
            os.kill(pids.pop(), signal.SIGKILL)

    shared = gw.sweep(*FOLDS, **options(starts=2, workers=workers), report=report)
    assert shared.complete
    for name in ("sections", "transients", "settled", "regimes"):
        np.testing.assert_array_equal(getattr(shared, name), getattr(alone, name))


def test_every_study_runs_on_a_cluster_that_is_named_around_it(cluster) -> None:
    before = Flow.calls
    alone = gw.run(clutch_diagram())
    calls = Flow.calls
    with gw.parallel.on_cluster(cluster.scheduler_address) as workers:
        assert isinstance(workers.executor, Cluster)
        shared = gw.run(clutch_diagram(workers=2))
        assert Flow.calls - calls < 0.5 * (calls - before)  # but for the first orbit and what tells branches apart
        with local_workers(2) as inner:
            assert inner is workers
    assert_same_result(shared, alone)
    with local_workers(1) as inner:
        assert inner.executor is None


def test_an_error_of_a_piece_comes_in_its_turn(workers) -> None:
    accepted = []
    with pytest.raises(ZeroDivisionError, match="three"):
        workers.run(fail_at_three, range(6), lambda index, result: accepted.append(result))
    assert accepted == [0, 1, 2]


def test_ctrl_c_cancels_what_is_under_way(cluster, workers) -> None:
    accepted = []

    def accept(index: int, result: int) -> None:
        accepted.append(index)
        signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        workers.run(slow_double, list(range(20)), accept)
    assert accepted == [0]
    workers.run(slow_double, [0, 1], lambda index, result: accepted.append(index))  # and it can be used again
    assert accepted == [0, 0, 1]


def test_a_scheduler_file_names_the_cluster_too(cluster, tmp_path) -> None:
    path = tmp_path / "scheduler.json"
    path.write_text(json.dumps({"address": cluster.scheduler_address}))
    accepted = []
    with on_cluster(str(path)) as workers:
        workers.run(abs, [-1, -2], lambda index, result: accepted.append(result))
    assert accepted == [1, 2]


def test_a_scheduler_that_does_not_answer(monkeypatch) -> None:
    monkeypatch.setattr(module, "_CONNECT", 0.5)
    with pytest.raises(ModelError, match="no Dask scheduler answers at"), on_cluster("tcp://127.0.0.1:9"):
        pass
    with pytest.raises(ModelError, match=r"such as tcp://node7:8786"), on_cluster("somewhere"):
        pass
    with pytest.raises(ModelError, match=r"no scheduler file .*nowhere\.json"), on_cluster("nowhere.json"):
        pass


def test_without_dask_the_error_says_what_to_install(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ModelError, match=r"pip install 'gapwalk\[cluster\]'"), on_cluster("tcp://a:1"):
        pass


def test_software_that_may_change_results_is_told() -> None:
    ours = {"gapwalk": "1", "llvmlite": "0.50.0", "numpy": "2", "python": "3.11.7", "sources": "a"}
    assert difference(ours, dict(ours), "it") == ""
    assert "it has gapwalk 2, and here it is 1" in difference(ours, ours | {"gapwalk": "2"}, "it")
    assert "it has llvmlite None" in difference(ours, {"gapwalk": "1", "sources": "a"}, "it")
    assert "other code of this version" in difference(ours, ours | {"sources": "b"}, "it")
    with pytest.warns(UserWarning, match=r"numpy 3, .* last digits"):
        assert difference(ours, ours | {"numpy": "3"}, "it") == ""


def test_a_hash_tells_apart_two_states_of_the_code(tmp_path, monkeypatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "a_law_of_mine.py").write_text("STIFFNESS = 1.0\n")
    before = sources(("a_law_of_mine",))
    sources.cache_clear()
    assert sources(("a_law_of_mine",)) == before != sources()
    assert sources(("builtins",)) == sources()  # a law of an interactive session has no file
    (tmp_path / "a_law_of_mine.py").write_text("STIFFNESS = 1.1\n")
    sources.cache_clear()
    assert sources(("a_law_of_mine",)) != before


@contextmanager
def foreign_worker(address: str, folder: Path) -> Iterator[None]:
    """A worker with a copy of the code in which one constant differs."""
    shutil.copytree(Path(gw.__file__).parent, folder / "gapwalk", ignore=shutil.ignore_patterns("__pycache__"))
    with (folder / "gapwalk" / "paper.py").open("a") as file:
        file.write("_ONE = 1\n")
    command = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-nanny"]
    environment = {**os.environ, "PYTHONPATH": f"{folder}{os.pathsep}{Path(__file__).parents[2]}"}
    with subprocess.Popen([*command, "--no-dashboard"], env=environment, stderr=subprocess.DEVNULL) as worker:
        try:
            yield
        finally:
            worker.kill()


@pytest.mark.slow
@pytest.mark.parametrize("is_late", [in_campaign(False), True])
def test_a_worker_with_other_code_is_named_and_left_out(cluster, tmp_path, is_late, monkeypatch) -> None:
    monkeypatch.setattr(module, "_LOOK", 0.1)
    monkeypatch.setattr(Cluster, "patience", 0.1)
    with ExitStack() as stack:
        client = stack.enter_context(distributed.Client(cluster, set_as_default=False))
        own = client.run(os.getpid)

        def come() -> str:
            stack.enter_context(foreign_worker(cluster.scheduler_address, tmp_path))
            until(lambda: len(client.nthreads()) > len(own), "the other worker is there")
            (other,) = set(client.nthreads()) - set(own)
            return other

        told = stack.enter_context(pytest.warns(UserWarning, match="other code of this version .* is left out"))
        other = "" if is_late else come()
        workers = stack.enter_context(on_cluster(cluster.scheduler_address))
        other = other or come()
        pids = set()
        workers.run(slow_pid, range(20), lambda index, pid: pids.add(pid))
        executor = workers.executor
        assert isinstance(executor, Cluster)
        until(lambda: executor.check() or executor._faults.get(other), "it has answered")
        workers.run(slow_pid, range(20), lambda index, pid: pids.add(pid))
    assert f"the worker {other} has" in str(told[0].message)
    assert pids <= set(own.values())


def test_if_no_worker_may_do_the_work_the_reason_is_told(cluster, monkeypatch) -> None:
    monkeypatch.setattr(module, "sources", lambda modules: "another")
    with (
        pytest.warns(UserWarning, match="it is left out"),
        pytest.raises(ModelError, match=r"none of 2 workers .* other code .* Install there"),
        on_cluster(cluster.scheduler_address),
    ):
        pass


def test_a_worker_that_was_replaced_at_its_address_refuses_and_the_piece_is_done_again(workers, monkeypatch) -> None:
    assert do_piece(abs, -1, (), software(())) == 1
    with pytest.raises(ReplacedError, match="other code") as caught:
        do_piece(abs, -1, (), software(()) | {"sources": "another"})
    assert workers.executor.is_loss(caught.value)
    accepted = []
    workers.run(slow_double, list(range(4)), lambda index, result: accepted.append(result))
    assert accepted == [0, 2, 4, 6]


@pytest.mark.slow
@pytest.mark.parametrize("comes_back", [True, in_campaign(False)])
def test_if_all_workers_go_it_is_told_and_others_are_waited_for(comes_back, monkeypatch) -> None:
    monkeypatch.setattr(module, "_LOOK", 0.1)
    monkeypatch.setattr(module, "_TELL", 0.3)
    monkeypatch.setattr(module, "_PATIENCE", PATIENCE if comes_back else 1.0)
    monkeypatch.setattr(Cluster, "patience", 0.1)
    accepted = []
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs=50
    ) as own:

        def accept(index: int, result: int) -> None:
            accepted.append(index)
            if index == 1:
                own.scale(0)

        with ExitStack() as stack:
            told = stack.enter_context(pytest.warns(UserWarning, match="no worker of the cluster at .* is left"))
            if comes_back:
                real = warnings.warn
                monkeypatch.setattr(warnings, "warn", lambda *each, **how: (own.scale(1), real(*each, **how)))
            else:
                stack.enter_context(pytest.raises(WorkError, match=r"finished work is kept\. Start workers and resume"))
            workers = stack.enter_context(on_cluster(own.scheduler_address))
            workers.run(slow_double, list(range(8)), accept)
    assert len(told) == 1
    assert accepted == list(range(8 if comes_back else len(accepted)))
    assert 2 <= len(accepted) < 8 or comes_back


@pytest.mark.slow
def test_only_the_piece_that_kills_its_workers_is_named(workers) -> None:
    accepted = []
    with pytest.raises(WorkError, match="over piece 4 of 8") as caught:
        workers.run(die_at_three, range(8), lambda index, result: accepted.append(result), in_order=False)
    assert sorted(accepted) == [0, 1, 2, 4, 5, 6, 7]
    assert caught.value.pieces == (3,)

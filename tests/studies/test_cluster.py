"""The workers of a real Dask cluster: the same results, also when one of them is killed, and teaching errors."""

import json
import os
import signal
import sys

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import ModelError, WorkError
from gapwalk.flow import Flow
from gapwalk.parallel import cluster as module
from gapwalk.parallel.cluster import Cluster, check_versions
from gapwalk.parallel.workers import Workers, local_workers, on_cluster
from tests.studies.diagrams import clutch_diagram
from tests.studies.pieces import die_at_three, fail_at_three, slow_double, slow_pid
from tests.studies.same import assert_same_result
from tests.studies.sweeps import FOLDS, options

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
    alone = gw.sweep(*FOLDS, options=options(starts=2))
    pids = list(workers.executor._client.run(os.getpid).values())[:1]

    def report(stretch, pace) -> None:
        if pids:
            os.kill(pids.pop(), signal.SIGKILL)

    shared = gw.sweep(*FOLDS, options=options(starts=2), workers=workers, report=report)
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


def test_versions_that_change_results_are_refused() -> None:
    ours = {"gapwalk": "1", "heyoka": "7", "numpy": "2", "python": "3.11.7"}
    check_versions(ours, dict(ours), "tcp://a:1")
    with pytest.raises(ModelError, match=r"gapwalk 2 \(tcp://a:1\), and here it is 1"):
        check_versions(ours, ours | {"gapwalk": "2"}, "tcp://a:1")
    with pytest.raises(ModelError, match="heyoka None"):
        check_versions(ours, {"gapwalk": "1"}, "tcp://a:1")
    with pytest.warns(UserWarning, match=r"numpy 3 .* last digits"):
        check_versions(ours, ours | {"numpy": "3"}, "tcp://a:1")


@pytest.mark.slow
def test_only_the_piece_that_kills_its_workers_is_named(workers) -> None:
    accepted = []
    with pytest.raises(WorkError, match="over piece 4 of 8") as caught:
        workers.run(die_at_three, range(8), lambda index, result: accepted.append(result), in_order=False)
    assert sorted(accepted) == [0, 1, 2, 4, 5, 6, 7]
    assert caught.value.pieces == (3,)

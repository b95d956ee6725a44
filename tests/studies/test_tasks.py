"""The tasks of studies: what is independent is sent, with the same result; what all share is sent once."""

from functools import partial

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.model.model_source import parse_source
from gapwalk.parallel.shared import Shared, do_shared
from gapwalk.parallel.workers import Workers, for_all, local_workers, on_cluster, on_cores
from gapwalk.pieces import done
from gapwalk.studies import run_up_study
from gapwalk.studies.study_file import Study, check_study
from tests.studies import jobs
from tests.studies.counting import counting
from tests.studies.pieces import fail_at_three, slow_double, slow_pid
from tests.studies.same import assert_same_result
from tests.tiers import in_campaign, keeps

MAP = jobs.GEAR + (
    'kind = "rattle"\nparameter = "frequency"\nfrom = 0.9\nto = 1.5\nresolution = [8, 6]\ncheck = 4\n'
    'second = { parameter = "mean.x", from = 0.2, to = 0.7 }\n'
)
DESIGN = jobs.DESIGN.replace("starts = 0\n", "starts = 1\n")
MODELS = {**jobs.MODELS, "rattle map": MAP, "design": DESIGN}
SENT = {
    "threshold": {"judged": 4, "rattles_exactly": 8, "border": 2, "extremum": 1},
    "run-up": {"_runs": 2},
    "design": {"judged": 4, "search_chunk": 1},
    "backbone": {"_followed": 2},
    "self-excited": {"_line_from": 1, "cycle_from": 1},
    "rattle map": {"_judge_piece": 1, "_changes_from": 8, "_locus_of": 1, "_look": 4},
}
"""At least so many tasks of each kind are sent."""


@pytest.fixture(autouse=True)
def small_parts(monkeypatch) -> None:
    monkeypatch.setattr(run_up_study, "CHUNK", 4)


def study(name: str) -> Study:
    return check_study(parse_source(MODELS[name].replace("workers = 1\n", "")))


@pytest.mark.parametrize("name", list(SENT))
def test_what_is_independent_is_sent_and_the_result_is_that_of_one_process(name) -> None:
    workers, executor = counting(4)
    with for_all(workers):
        shared = gw.run(study(name))
    assert {each: min(count, executor.counts[each]) for each, count in SENT[name].items()} == SENT[name]
    with for_all(Workers()):
        assert_same_result(shared, gw.run(study(name)))


@keeps("backbone")
@pytest.mark.parametrize("name", ["backbone", "threshold", *map(in_campaign, ("design", "run-up", "rattle map"))])
def test_processes_come_to_the_result_of_one(name) -> None:
    with on_cores(2):
        shared = gw.run(study(name))
    with for_all(Workers()):
        assert_same_result(shared, gw.run(study(name)))


@pytest.mark.slow
def test_a_cluster_comes_to_the_result_of_one_process() -> None:
    distributed = pytest.importorskip("distributed", reason="needs the extra gapwalk[cluster]")
    cluster = distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0", silence_logs=50)
    with cluster, on_cluster(cluster.scheduler_address):
        shared = {name: gw.run(study(name)) for name in SENT}
    with for_all(Workers()):
        for name, found in shared.items():
            assert_same_result(found, gw.run(study(name)))


def test_a_search_is_done_by_the_workers_around() -> None:
    system = gw.paper.case("15")
    options = gw.SearchOptions(starts=4, newton_starts=0, block=2)
    workers, executor = counting()
    with for_all(workers):
        found = gw.search(system, "frequency", [0.45], options=options)
    assert executor.counts["search_chunk"] == 2
    alone = gw.search(system, "frequency", [0.45], options=options)
    np.testing.assert_array_equal(
        [each.orbit.state for each in found.found], [each.orbit.state for each in alone.found]
    )


def add(shared: bytes, number: int) -> int:
    return len(shared) + number


def test_what_all_pieces_share_is_sent_once() -> None:
    workers, executor = counting()
    with for_all(workers):
        assert done(partial(add, bytes(100_000)), range(20)) == [100_000 + number for number in range(20)]
    assert executor.counts["add"] == 20
    assert len(executor.shared) == 1
    assert executor.bytes < 1000


def test_a_process_is_sent_the_function_again_only_after_another_one() -> None:
    with local_workers(2) as workers:
        assert workers.executor is not None
        sent: list[bool] = []
        for pool in workers.executor._pools:  # pyright: ignore[reportAttributeAccessIssue]
            submit = pool.submit
            pool.submit = lambda work, key, packed, piece, submit=submit: (
                sent.append(packed is not None) or submit(work, key, packed, piece)
            )
        for function in (slow_pid, slow_pid, slow_double):
            list(workers.each(function, range(6)))
    assert len(sent) == 18
    assert sum(sent) == 4


def test_a_function_that_was_not_sent_is_missed() -> None:
    function = Shared(abs)
    assert do_shared(function.key, function.packed, -1) == do_shared(function.key, None, -1) == 1
    with pytest.raises(gw.errors.WorkError, match="lost the function"):
        do_shared(b"another", None, -1)


def test_short_pieces_are_sent_several_at_a_time() -> None:
    workers, executor = counting(2)
    found = dict(workers.several(abs, range(-1000, 0)))
    assert found == {place: 1000 - place for place in range(1000)}
    assert executor.counts["abs"] < 30
    assert list(Workers().several(abs, [-1, 2])) == [(0, 1), (1, 2)]


def test_an_error_of_a_piece_leaves_those_before_it() -> None:
    workers, _ = counting(1)
    each = workers.several(fail_at_three, [4, 5, 6, 7, 3, 8])
    assert [next(each) for _ in range(4)] == [(0, 4), (1, 5), (2, 6), (3, 7)]
    with pytest.raises(ZeroDivisionError, match="three"):
        next(each)


@pytest.mark.parametrize(
    ("name", "most"), [("settle", 1), ("backbone", 2), ("run-up", 2), ("rattle", 2), ("campbell", 1), ("sweep", None)]
)
def test_a_study_says_how_many_processes_it_can_use(name, most) -> None:
    asked = study(name).options
    assert asked.most_workers == most
    words = {1: " (one process)", 2: " (at most 2 processes)", None: ""}[most]
    assert asked.plan_with_workers == asked.plan + words

"""Workers: pieces in order, none that is superfluous, and no process that outlives its master."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from gapwalk.errors import WorkError
from gapwalk.parallel.workers import local_workers, on_cores
from tests.studies.pieces import die_at_three, die_once, fail_at_three, slow_double, slow_pid
from tests.tiers import in_campaign
from tests.waiting import children, until

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("count", [1, 2])
def test_results_come_in_order_and_superfluous_pieces_are_left_out(count) -> None:
    accepted = []

    def is_needed(index: int) -> bool:
        return index != 3 or 2 not in accepted

    with local_workers(count) as workers:
        workers.run(slow_double, [0, 1, 2, 3], lambda index, result: accepted.append(result), is_needed)
    assert accepted == [0, 2, 4]


def test_a_process_that_is_killed_costs_its_own_piece_only(tmp_path) -> None:
    pieces, accepted = [(str(tmp_path), number) for number in range(8)], []
    with local_workers(2) as workers:
        workers.run(die_once, pieces, lambda index, result: accepted.append((index, result)))
    assert accepted == [(number, number) for number in range(8)]
    tries = [int(mark.name.split("-")[0]) for mark in tmp_path.iterdir()]
    assert sorted(tries) == [0, 1, 2, 2, 3, 4, 5, 6, 7]  # the other process went on with what it was doing


def test_processes_are_shared_by_all_work_of_a_while() -> None:
    pids: list[set[int]] = []
    with on_cores(2) as shared:
        for count in (2, 1):
            found: set[int] = set()
            with local_workers(count) as workers:
                assert workers is shared
                workers.run(slow_pid, range(4), lambda index, pid, found=found: found.add(pid))
            pids.append(found)
    assert pids[0] == pids[1]
    assert len(pids[0]) == 2
    with local_workers(1) as workers:
        assert workers is not shared


@pytest.mark.slow
def test_a_process_that_is_killed_while_it_is_idle_is_replaced() -> None:
    pids = []
    with local_workers(2) as workers:
        workers.run(slow_pid, [0, 1], lambda index, pid: pids.append(pid))
        for pid in pids:
            os.kill(pid, signal.SIGKILL)
        workers.run(slow_pid, [0, 1], lambda index, pid: pids.append(pid))
    assert len(set(pids)) == 4


@pytest.mark.parametrize(("in_order", "kept"), [in_campaign(True, [0, 1, 2]), (False, [0, 1, 2, 4, 5, 6])])
def test_a_piece_that_kills_its_process_each_time_is_named(in_order, kept) -> None:
    accepted = []
    with local_workers(2) as workers, pytest.raises(WorkError, match="over piece 4 of 7 at each of 3 tries") as caught:
        workers.run(die_at_three, range(7), lambda index, result: accepted.append(result), in_order=in_order)
    assert sorted(accepted) == kept
    assert caught.value.pieces == (3,)


@pytest.mark.parametrize("count", [1, 2])
def test_an_error_of_a_piece_comes_in_its_turn(count) -> None:
    accepted = []
    with local_workers(count) as workers, pytest.raises(ZeroDivisionError, match="three"):
        workers.run(fail_at_three, range(8), lambda index, result: accepted.append(result))
    assert accepted == [0, 1, 2]


@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("bad", [fail_at_three, in_campaign(die_at_three)])
def test_what_fails_and_is_superfluous_in_its_turn_hinders_nothing(count, bad) -> None:
    accepted = []

    def is_needed(index: int) -> bool:
        return index != 1 or 0 not in accepted

    with local_workers(count) as workers:
        workers.run(bad, [0, 3, 1, 2], lambda index, result: accepted.append(result), is_needed)
    assert accepted == [0, 1, 2]


@pytest.mark.parametrize("count", [1, 2])
def test_out_of_order_each_result_is_accepted_when_it_comes(count) -> None:
    accepted = []
    with local_workers(count) as workers:
        workers.run(slow_double, [0] * count, lambda index, result: None)  # all processes have started
        workers.run(slow_double, [0, 1, 2, 3], lambda index, result: accepted.append((index, result)), in_order=False)
    assert sorted(accepted) == [(0, 0), (1, 2), (2, 4), (3, 6)]
    assert (accepted[0] == (0, 0)) is (count == 1)  # the second process was quicker


@pytest.mark.parametrize(("count", "in_order"), [(1, True), in_campaign(1, False), in_campaign(2, True), (2, False)])
def test_pieces_may_become_more_while_they_are_done(count, in_order) -> None:
    pieces, accepted = [1, 5], {}

    def accept(index: int, result: int) -> None:
        accepted[index] = result
        if result < 16:
            pieces.append(result)

    with local_workers(count) as workers:
        workers.run(slow_double, pieces, accept, in_order=in_order)
    assert sorted(accepted) == list(range(6))
    assert sorted(accepted.values()) == [2, 4, 8, 10, 16, 20]


SCRIPT = """
import os
from gapwalk.parallel.workers import local_workers

def ready(index, result):
    print(index, flush=True)

print("master", os.getpid(), flush=True)  # no guard: the processes must not run this script
with local_workers(2) as workers:
    workers.run({work}, [{pieces}], ready)
print("done", flush=True)
"""


def start(tmp_path, work: str, pieces: str) -> subprocess.Popen:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.format(work=work, pieces=pieces))
    environment = {**os.environ, "PYTHONPATH": f"{ROOT / 'src'}{os.pathsep}{ROOT}"}
    return subprocess.Popen(
        [sys.executable, str(script)], stdout=-1, stderr=-1, text=True, env=environment, start_new_session=True
    )


def test_a_script_needs_no_guard(tmp_path) -> None:
    program = start(tmp_path, "abs", "-1, -2")
    out, err = program.communicate()
    assert err == ""
    assert out.splitlines() == [f"master {program.pid}", "0", "1", "done"]


@pytest.mark.parametrize("how", ["ctrl-c", "kill"])
def test_no_process_outlives_its_master(tmp_path, how) -> None:
    program = start(tmp_path, "__import__('time').sleep", "0, 0, 60, 60")
    assert program.stdout is not None
    while program.stdout.readline() != "1\n":
        pass
    pids = children(program.pid)
    if how == "ctrl-c":
        os.killpg(program.pid, signal.SIGINT)  # as a terminal does
    else:
        program.kill()
    _, err = program.communicate()
    assert len(pids) == 2
    until(lambda: not [pid for pid in pids if os.path.exists(f"/proc/{pid}")], "they end")
    if how == "ctrl-c":
        assert err.count("Traceback") == 1  # that of the master alone

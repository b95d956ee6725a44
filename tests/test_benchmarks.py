"""The benchmarks run and say what they should; no times are asserted here."""

import json
import sys
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from benchmarks import history, mass, period, start, suite
from benchmarks.__main__ import main
from benchmarks.busy import MeasuredProcesses
from benchmarks.chain import ScipyChain, chain
from benchmarks.clutch import ScipyClutch
from benchmarks.diagram import count_periods, estimate
from benchmarks.effort import Effort
from benchmarks.row import Row, Target
from benchmarks.simd import SimdClutch
from benchmarks.table import as_json, as_table, cells, duration, notes
from gapwalk import find_orbit, paper
from gapwalk.bifurcation.isolated.search_starts import lanes_of
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model.coefficients import coefficients_of
from gapwalk.parallel.workers import Workers

LEAST = Effort(repeats=1, burst=0.0)


def test_the_cheapest_line_has_all_that_a_line_must_have():
    row = period.measure_state(find_orbit(paper.case("13"), frequency=0.5), LEAST)
    assert row.what == "state"
    assert row.seconds > 0
    assert row.ratio == row.baseline / row.seconds
    assert [target.kind for target in row.targets] == ["seconds", "ratio"]
    assert len(row.reached) == 2
    assert len(cells(row)) == len(as_table([row]).columns)
    (told,) = json.loads(as_json([row]))["rows"]
    assert set(told) == {
        "group", "what", "seconds", "baseline", "against", "ratio", "targets", "reached", "counts", "note",
    }  # fmt: skip


def test_an_estimate_by_numpy_is_plain_in_json():
    row = Row("group", "what", np.float64(2.0), np.float64(120.0), "estimate", (Target(60.0, "ratio"),))
    (told,) = json.loads(as_json([row]))["rows"]
    assert (told["ratio"], told["reached"]) == (60.0, [True])


def test_the_command_prints_a_table_and_writes_json(tmp_path, capsys):
    main(["period", "--quick", "--json", str(tmp_path / "rows.json")])
    printed = capsys.readouterr().out
    for word in ("gapwalk", "baseline", "ratio", "target", "reached", "DOP853"):
        assert word in printed
    written = json.loads((tmp_path / "rows.json").read_text(encoding="utf-8"))
    assert len(written["rows"]) == 3
    assert {"processor", "cores", "python", "llvmlite", "numba", "scipy"} <= set(written["machine"])


def test_the_history_shows_what_became_slower(tmp_path, capsys):
    file = tmp_path / "history.jsonl"
    before, now = Row("g", "w", 2.0, 6.0), Row("g", "w", 1.0, 2.0)  # half the time, on a machine thrice as fast
    other = Row("g", "no baseline", 1.0)
    history.append(history.entry_of([before], "full"), file)
    history.append(history.entry_of([Row("g", "w", 9.0)], "quick"), file)
    entries, entry = history.read(file), history.entry_of([now, other], "full")
    assert [each.effort for each in entries] == ["full", "quick"]
    last = history.last_like(entry, entries)
    assert last == entries[0]
    assert entry.change(now, last) == pytest.approx(2.0 / 3.0)
    assert entry.change(other, last) is None
    (told,) = history.regressions(entry, [now, other], last)
    assert told == f"slower: g: w has 67% of its speed on {last.date} ({last.commit})"
    assert cells(now, 2.0 / 3.0)[-1] == "-33%"
    assert history.last_like(replace(entry, machine="another"), entries) is None
    assert history.read(tmp_path / "none") == []


def test_a_run_is_recorded_only_if_it_is_asked_for(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(period, "rows", lambda effort: [Row("g", "w", 1.0, 2.0)])
    file = tmp_path / "history.jsonl"
    for words in ([], ["--record"], ["--record"]):
        main(["period", "--history", str(file), *words])
    assert len(history.read(file)) == 2
    assert "+0%" in capsys.readouterr().out


def test_the_start_of_a_process_is_measured():
    assert 0.0 < start.least(["-c", "sum(range(10**5))"], 1) < start.least(["-c", "import numpy"], 1)


def test_the_checks_are_measured_with_their_processes_and_one_that_fails_reaches_nothing():
    row = suite.measured([sys.executable, "-c", "sum(range(10**6))"], 90.0)
    assert row.seconds > 0.0
    assert row.reached == (True,)
    assert row.targets[0].limit == 180.0
    failed = suite.measured([sys.executable, "-c", "raise SystemExit(1)"], 90.0)
    assert failed.reached == ()
    assert "it failed" in failed.note


def test_an_unknown_group_is_refused(capsys):
    with pytest.raises(SystemExit):
        main(["speed"])
    assert "nothing called 'speed' to measure; write one of period, branch" in capsys.readouterr().err


def test_targets_are_judged():
    row = Row(
        "g", "w", 2e-5, 4e-3, targets=(Target(3e-5), Target(1e-5), Target(150.0, "ratio"), Target(300.0, "ratio"))
    )
    assert row.reached == (True, False, True, False)
    assert Row("g", "w", 1.0, targets=(Target(100.0, "ratio"),)).reached == (False,)
    assert Row("g", "w", 1.0, counts={"special points found": 13}, targets=(Target(14, "found"),)).reached == (False,)
    assert notes([row, Row("g", "w", 1.0, note="n")]) == ["g, w: n."]


@pytest.mark.parametrize(("seconds", "text"), [(2e-5, "20 us"), (0.0123, "12.3 ms"), (3.456, "3.46 s")])
def test_durations_are_told_in_their_unit(seconds, text):
    assert duration(seconds) == text


def test_periods_are_counted_as_they_are_integrated():
    orbit = find_orbit(paper.case("15"), frequency=0.5)
    coefficients, plain, full = (
        coefficients_of(orbit.system),
        flow_of(orbit.system),
        flow_of(orbit.system, transition=True),
    )

    def work() -> str:
        plain.integrate(coefficients, orbit.state)
        plain.integrate(coefficients, orbit.state, 0.0, 3 * PERIOD)
        plain.sample(coefficients, orbit.state, np.linspace(0.0, 8 * PERIOD, 9))
        full.integrate(coefficients, orbit.state, stop=2 * PERIOD)
        return "done"

    result, periods = count_periods(work)
    assert result == "done"
    assert periods == pytest.approx({"plain": 12.0, "sensitive": 2.0})
    assert estimate(periods, LEAST) > estimate(Counter(plain=1.0), LEAST) > 0.0
    assert count_periods(lambda: None)[1] == {}
    states = np.tile(orbit.state, (3, 1))
    lanes = lanes_of(orbit.system, states, np.ones(4))
    assert lanes is not None
    together = count_periods(lambda: (lanes.strobes(states, 8), lanes.evaluate(states, np.array([1, 2, 4]))))[1]
    assert together == pytest.approx({"plain": 24.0, "sensitive": 7.0})


@pytest.mark.parametrize("frequency", [0.5, 0.62, 1.3])
def test_the_baseline_of_the_clutch_is_the_same_motion(frequency):
    orbit = find_orbit(paper.case("13"), frequency=frequency)
    found = ScipyClutch(orbit.system).period_with_sensitivities(orbit.state, frequency)
    flow = flow_of(orbit.system, transition=True)
    assert found.state == pytest.approx(orbit.state, abs=1e-7)
    expected = flow.integrate(coefficients_of(orbit.system), orbit.state).transition
    assert found.transition == pytest.approx(expected, abs=1e-6)


def test_the_baseline_of_the_mass_flow_is_the_same_motion():
    system = paper.case("15").at(frequency=0.45)
    states = np.random.default_rng(0).uniform(-2, 2, (64, 4))
    flow, coefficients = flow_of(system), coefficients_of(system)
    exact = np.array([flow.integrate(coefficients, state).state for state in states])
    assert SimdClutch(system).run(states, 1) == pytest.approx(exact, abs=3e-3)
    row = mass.measure_core(system, states.repeat(4, axis=0), replace(LEAST, mass_periods=5))
    assert row.counts["stated error"] <= 1e-4
    assert row.ratio == row.baseline / row.seconds


def test_the_baseline_of_the_chain_is_the_same_motion():
    orbit = find_orbit(chain(3))
    assert orbit.events
    assert ScipyChain(3).period(orbit.state) == pytest.approx(orbit.state, abs=1e-7)


def test_the_busier_of_two_processes_is_measured():
    processes = MeasuredProcesses(2)
    try:
        found = dict(Workers(processes).each(abs, [-1.0, 2.0, -3.0], in_order=False))
    finally:
        processes.close(at_once=False)
    assert found == {0: 1.0, 1: 2.0, 2: 3.0}
    assert 1 <= len(processes.busy) <= 2
    assert all(used > 0.0 for used in processes.busy.values())

"""The second reading: other numbers with what they gain and cost, and explanations, on results that are numbers."""

from dataclasses import replace
from typing import Any

import pytest

from reproductions.padmanabhan_singh_1995.claims import (
    CLAIMS,
    Claim,
    Finding,
    Outcome,
    Verdict,
    claim,
    second_reading,
    trades,
)
from reproductions.padmanabhan_singh_1995.claims.second_reading import (
    CANDIDATES,
    EXPLANATIONS,
    Candidate,
    Explanation,
    readings_for,
)
from reproductions.padmanabhan_singh_1995.figures import FIGURES
from reproductions.padmanabhan_singh_1995.jobs import JOBS, LITERAL, USUAL, OtherNumber, Reading
from reproductions.padmanabhan_singh_1995.today import TODAY
from tests.reproductions.padmanabhan_singh_1995.expected import EXPECTED, verdict_of

NUMBER = Reading(number=OtherNumber("beta-0", (("stage2.impact_damping", 0.0),), ("12",)))
CLAIM = Claim(
    "12-above", "It is above 3.", ("12", "13"), lambda *results: Finding(max(results) > 3, f"found {max(results)}")
)


@pytest.fixture
def proposed(monkeypatch) -> None:
    candidates = (Candidate(NUMBER, ("12-above",), ("12-folds",)),)
    for module in (second_reading, trades):
        monkeypatch.setattr(module, "CANDIDATES", candidates)
    explanation = Explanation("it is a start", ("17",), lambda result: Finding(result > 3, f"and {result}"))
    monkeypatch.setattr(second_reading, "EXPLANATIONS", {"12-above": explanation})
    monkeypatch.setattr(claim, "EXPLANATIONS", {"12-above": explanation})


def outcome(printed: float, other: float, start: float) -> Outcome:
    return CLAIM.outcome({"12": printed, "12-beta-0": other, "13": 0, "17": start}, {})  # type: ignore[dict-item]


@pytest.mark.usefixtures("proposed")
@pytest.mark.parametrize(
    ("results", "words"),
    [
        ((4, 0, 0), "to the letter"),
        ((0, 4, 4), "one number changed (β = 0)"),
        ((0, 0, 4), "explained (it is a start)"),
        ((0, 0, 0), "not found"),
    ],
)
def test_a_verdict_is_the_first_that_holds_and_all_evidence_is_kept(results, words: str) -> None:
    assert [job.key for job in CLAIM.jobs] == ["12", "13", "12-beta-0", "17"]  # another set has its printed number
    found = outcome(*results)
    assert str(found) == words
    assert found.changed == ({"β": (0.05, 0.0)} if results == (0, 4, 4) else {})
    texts = "found {}", "[β = 0] found {}", "[it is a start] and {}"
    assert [str(each) for each in found.evidence] == [text.format(n) for text, n in zip(texts, results, strict=True)]


@pytest.mark.usefixtures("proposed")
def test_a_number_is_weighed_by_what_it_gains_and_costs() -> None:
    folds = Claim("12-folds", "Below 5.", ("12",), lambda result: Finding(result < 5, "found"))
    results: Any = {"12": 1, "12-beta-0": 6, "13": 0, "17": 0}
    checked = [(each, each.outcome(results, {})) for each in (CLAIM, folds)]
    (trade,) = trades.weigh(checked, results, {})
    assert (trade.gained, trade.kept, trade.lost, trade.missed) == (("12-above",), (), ("12-folds",), ())
    assert trade.words == "β = 0 (printed: 0.05)"


@pytest.mark.usefixtures("proposed")
def test_an_outcome_names_what_its_change_costs(monkeypatch) -> None:
    folds = Claim("12-folds", "Below 5.", ("12",), lambda result: Finding(result < 5, "found"))
    monkeypatch.setattr(trades, "ALL", [CLAIM, folds])
    results = {"12": 1, "12-beta-0": 6, "13": 0, "17": 0}
    ((_, above), (_, below)), _ = trades.decide([CLAIM, folds], results, {})  # type: ignore[arg-type]
    assert (above.verdict, above.costs) == (Verdict.OTHER_NUMBER, ("12-folds",))
    assert (below.verdict, below.costs) == (Verdict.LETTER, ())
    assert above.at_odds == ()  # no claim needs another value of it
    assert {job.key for job in trades.jobs_of([CLAIM, folds])} == set(results)
    checked, none = trades.decide([CLAIM], results, {})  # type: ignore[arg-type]
    assert (checked[0][1].costs, none) == ((), ())


def test_a_number_changes_the_system_and_its_result_file_only_where_it_stands() -> None:
    own, other = JOBS["12"].at(NUMBER), JOBS["13"].at(NUMBER)
    assert own.key == "12-beta-0"
    assert own.study.system["stage2.impact_damping"] == 0.0
    assert "β = 0" in own.study.title
    assert other == JOBS["13"]
    assert JOBS["13"].at(Reading(LITERAL.slope, number=NUMBER.number)).key == "13-literal"
    assert USUAL.differs == ""


def test_candidates_name_claims_jobs_and_parameters_that_exist() -> None:
    known = {each.name: each for each in CLAIMS}
    for each in CANDIDATES:
        assert set(each.claims) <= set(known)
        assert set(each.jobs) <= set(known)
        for name in each.claims:
            for job in known[name].jobs_in(each.reading, each.jobs_of(name)):
                assert job.study.system is not None
    assert set(EXPLANATIONS) <= set(known)
    assert readings_for("12-folds") == []


def test_what_the_paper_changes_without_printing_it_is_no_changed_number() -> None:
    """The dampers of 7-differ are raised by the paper itself, to values that it does not print."""
    claim = next(each for each in CLAIMS if each.name == "7-differ")
    ((reading, keys),) = readings_for(claim.name)
    changed = claim._changed(reading, keys)
    assert changed == {"Te1": (0.25, 0.37)}
    assert "does not print" in claim.place


@pytest.mark.usefixtures("proposed")
def test_what_is_missing_at_another_number_is_in_the_verdict(monkeypatch) -> None:
    check = lambda *results: Finding(max(results) > 3, "found", short="in a sliver")  # noqa: E731
    found = replace(CLAIM, check=check).outcome({"12": 0, "12-beta-0": 4, "13": 0, "17": 0}, {})  # type: ignore[dict-item]
    assert str(found) == "one number changed (β = 0, in a sliver)"


def test_a_walk_of_more_periods_serves_statements_on_period_1() -> None:
    """Where a figure shows longer periods at another number, no second job walks period 1 alone."""
    asked = {job.key for claim in CLAIMS for job in claim.jobs}
    asked |= {job.key for each in (*FIGURES, *TODAY) for job in each.jobs}
    asked |= {job.key for job in trades.jobs_of(CLAIMS)}
    assert {key.replace("-period-1", "") for key in asked if "-period-1-" in key} & asked == set()


def test_verdicts_name_the_candidates_and_the_explanations() -> None:
    """Each number or explanation that a verdict names exists, and the claim that it was made for has it."""
    for name, text in EXPECTED.items():
        rest = text.partition(" (")[2]
        if verdict_of(text) in (Verdict.OTHER_NUMBER, Verdict.OTHER_NUMBERS):
            assert any(reading.differs in rest for reading, _ in readings_for(name))
        if verdict_of(text) is Verdict.EXPLAINED:
            assert EXPLANATIONS[name].by == rest.rstrip(")")

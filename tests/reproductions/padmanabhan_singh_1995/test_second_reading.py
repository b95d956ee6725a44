"""The second reading: other numbers with what they gain and cost, and explanations, on results that are numbers."""

import pytest

from reproductions.padmanabhan_singh_1995.claims import CLAIMS, Claim, Outcome, Verdict, claim, second_reading, trades
from reproductions.padmanabhan_singh_1995.claims.second_reading import (
    CANDIDATES,
    EXPLANATIONS,
    Candidate,
    Explanation,
    readings_for,
)
from reproductions.padmanabhan_singh_1995.jobs import JOBS, LITERAL, USUAL, OtherNumber, Reading
from tests.reproductions.padmanabhan_singh_1995.expected import EXPECTED

NUMBER = Reading(number=OtherNumber("β = 0", "0.05", "beta-0", (("stage2.impact_damping", 0.0),), ("12",)))
CLAIM = Claim("12-above", "It is above 3.", ("12", "13"), lambda *results: (max(results) > 3, f"found {max(results)}"))


@pytest.fixture
def proposed(monkeypatch) -> None:
    candidates = (Candidate(NUMBER, ("12-above",), ("12-folds",)),)
    for module in (second_reading, trades):
        monkeypatch.setattr(module, "CANDIDATES", candidates)
    explanation = Explanation("it is a start", ("17",), lambda result: (result > 3, f"and {result}"))
    monkeypatch.setattr(second_reading, "EXPLANATIONS", {"12-above": explanation})
    monkeypatch.setattr(claim, "EXPLANATIONS", {"12-above": explanation})


def outcome(printed: float, other: float, start: float) -> Outcome:
    return CLAIM.outcome({"12": printed, "12-beta-0": other, "13": 0, "17": start}, {})  # type: ignore[dict-item]


@pytest.mark.usefixtures("proposed")
@pytest.mark.parametrize(
    ("results", "words"),
    [
        ((4, 0, 0), "reproduced"),
        ((0, 4, 4), "at one other number (β = 0)"),
        ((0, 0, 4), "explained (it is a start)"),
        ((0, 0, 0), "not reproduced"),
    ],
)
def test_a_verdict_is_the_first_that_holds_and_all_evidence_is_kept(results, words: str) -> None:
    assert [job.key for job in CLAIM.jobs] == ["12", "13", "12-beta-0", "17"]  # another set has its printed number
    found = outcome(*results)
    assert str(found) == words
    assert found.evidence == "found {}; [β = 0] found {}; [it is a start] and {}".format(*results)


@pytest.mark.usefixtures("proposed")
def test_a_number_is_weighed_by_what_it_gains_and_costs() -> None:
    folds = Claim("12-folds", "Below 5.", ("12",), lambda result: (result < 5, "found"))
    results = {"12": 1, "12-beta-0": 6, "13": 0, "17": 0}
    (trade,) = trades.weigh([CLAIM, folds], results, {})  # type: ignore[arg-type]
    assert (trade.gained, trade.kept, trade.lost, trade.missed) == (("12-above",), (), ("12-folds",), ())
    assert trade.words == "β = 0 (printed: 0.05)"
    assert {job.key for job in trades.jobs_of_trades([CLAIM, folds])} == {"12-beta-0", "13"}


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


def test_verdicts_name_the_candidates_and_the_explanations() -> None:
    """Each number or explanation that a verdict names exists, and the claim that it was made for has it."""
    for name, text in EXPECTED.items():
        verdict, _, rest = text.partition(" (")
        if Verdict(verdict) is Verdict.OTHER_NUMBER:
            assert rest.rstrip(")") in [reading.differs for reading, _ in readings_for(name)]
        if Verdict(verdict) is Verdict.EXPLAINED:
            assert EXPLANATIONS[name].by == rest.rstrip(")")

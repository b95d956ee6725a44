"""Scans: claims and their verdicts against closed forms, and the chance of luck against the binomial distribution."""

import io
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

import gapwalk as gw
from gapwalk.answers.scan import FAILS, HOLDS, UNKNOWN, Scan, Variations, VariedHow
from gapwalk.answers.scan_claims import Settled
from gapwalk.attractors.regimes import Regime
from gapwalk.errors import ModelError
from gapwalk.studies.scan_study import ScanStudy, _Scanner
from tests.studies.jobs import HEAD, SCAN

PERIODIC, TORUS, CHAOS = (int(kind) for kind in (Regime.PERIODIC, Regime.QUASI_PERIODIC, Regime.CHAOTIC))
CLUTCH = gw.paper.case("15").at(frequency=0.45)


def test_claims_about_motions() -> None:
    three = gw.ask.MotionClaim("period 3")
    motions = [Settled(PERIODIC, 3), Settled(PERIODIC, 1), Settled(TORUS, 0), Settled(CHAOS, 0)]
    assert three.judge(motions) == (True, 0.25)
    assert gw.ask.MotionClaim("periodic", share=0.5).judge(motions) == (True, 0.5)
    assert gw.ask.MotionClaim("periodic", share=1.0).judge(motions) == (False, 0.5)
    assert gw.ask.MotionClaim("quasi-periodic").judge(motions[:2]) == (False, 0.0)
    assert gw.ask.MotionClaim("chaotic", {"mean.q1": 0.5}, 1.0).words == "only chaotic at mean.q1 = 0.5"


def test_claims_about_points() -> None:
    branch = gw.follow(gw.find_orbit(gw.paper.case("12"), frequency=0.7), "frequency", 0.58)
    (high, low) = (point.value for point in branch.special("fold"))
    low, high = min(low, high), max(low, high)
    fold = gw.ask.PointClaim("fold", parameter="frequency", low=low - 0.001, high=high + 0.001, over=(0.7, 0.58))
    assert fold.judge([branch]) == (True, 2.0)
    none = gw.ask.PointClaim("fold", parameter="frequency", low=0.65, high=0.69, absent=True)
    assert none.judge([branch]) == (True, 0.0)
    # what the walk has not covered may hold a point
    assert gw.ask.PointClaim("fold", parameter="frequency", low=0.5, high=0.55, absent=True).judge([branch]) == (
        None,
        0.0,
    )
    assert gw.ask.PointClaim("fold", parameter="frequency", low=0.65, high=0.69).judge([branch]) == (False, 0.0)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: gw.ask.MotionClaim("period 0"), 'write "period 3"'),
        (lambda: gw.ask.PointClaim("fold", parameter="frequency", low=2.0, high=1.0), "lower end first"),
        (lambda: gw.ask.PointClaim("fold", parameter="frequency", low=1.0, high=2.0, over=(1.5, 1.0)), "must cover"),
        (
            lambda: gw.ask.PointClaim("fold", parameter="frequency", low=1.0, high=2.0, at={"frequency": 1.0}),
            "leave it out",
        ),
        (lambda: ScanStudy(claims=(), spread=0.0), "must be a number > 0"),
        (lambda: ScanStudy(claims=(), starts=0), "starts is 0"),
        (lambda: gw.ask.variations(CLUTCH, ["harmonic1.phase"], factors=[2.0]), "write it in listed"),
        (lambda: gw.ask.scan(CLUTCH, []), "there are no claims"),
        (lambda: gw.ask.scan(CLUTCH, [gw.ask.MotionClaim("chaotic", {"mean.q1": 1.0})], ["mean.q1"]), "cannot vary"),
        (lambda: gw.ask.scan(CLUTCH, [gw.ask.MotionClaim("chaotic", {"mean.q9": 1.0})]), "mean.q9"),
    ],
)
def test_errors_teach(make, text: str) -> None:
    with pytest.raises(ModelError, match=text):
        make()


def test_variations_are_the_product_of_parameters_and_factors() -> None:
    found = gw.ask.variations(
        CLUTCH, ["mean.q1", "mean.q3"], factors=[0.0, 1.0, 2.0], pairs=99, listed=[{"mean.q3": 0.7}], neighbours=500
    )
    assert [int((found.how == kind).sum()) for kind in VariedHow] == [1, 4, 4, 1, 500]
    pairs = {tuple(row) for row in found.values[found.how == VariedHow.PAIR].tolist()}
    assert pairs == {(a, b) for a in (0.0, 0.5) for b in (0.0, 0.5)}
    logarithms = np.log(found.values[found.neighbours] / found.values[0])
    assert abs(logarithms.mean()) < 4.0 * 0.1 / math.sqrt(1000.0)
    assert logarithms.std() == pytest.approx(0.1, rel=0.1)
    assert found.words(0) == "as in the model"
    assert found.words(1) == "mean.q1 = 0"


def test_variations_that_are_no_systems_are_named() -> None:
    found = gw.ask.variations(CLUTCH, ["mass.q1.q1"], factors=[0.0, 2.0])
    assert len(found) == 2
    assert "left out: mass.q1.q1 = 0 (mass is singular" in found.left_out[0]


def with_scores(*hits: int, neighbours: int, tried: int = 50) -> Scan:
    """A scan whose first variations that are tried, and random neighbours, fulfil so many of two claims."""
    how = np.array([0] + [1] * tried + [4] * neighbours)
    holds = np.zeros((len(how), 2), dtype=int)
    for place, score in enumerate(hits):
        holds[1 + tried + place, :score] = HOLDS
    holds[1, :] = HOLDS
    claims = (gw.ask.MotionClaim("chaotic"), gw.ask.MotionClaim("periodic"))
    return Scan(CLUTCH, claims, Variations(("mean.q1",), np.ones((len(how), 1)), how), holds, holds * 1.0)


def test_luck_is_that_of_a_binomial_distribution() -> None:
    luck = with_scores(2, 2, 1, neighbours=200).luck(2)
    assert (luck.hits, luck.neighbours, luck.tried, luck.share) == (2, 200, 50, 0.01)
    # so few hits are had with 5 % if the share is at the upper bound
    assert stats.binom.cdf(2, 200, luck.upper) == pytest.approx(0.05, abs=1e-9)
    assert luck.chance == pytest.approx(1.0 - stats.binom.pmf(0, 50, 0.01))
    assert luck.at_most == pytest.approx(1.0 - stats.binom.pmf(0, 50, luck.upper))
    none = with_scores(neighbours=300).luck(2)
    assert (none.hits, none.chance) == (0, 0.0)
    assert (1.0 - none.upper) ** 300 == pytest.approx(0.05)
    assert with_scores(2, 2, neighbours=2).luck(2).upper == 1.0
    assert "the chance of luck is unknown" in with_scores(neighbours=0).luck(2).words


def test_the_summary_names_the_best_and_the_chance_of_luck() -> None:
    found = with_scores(2, 2, 1, neighbours=200)
    text = str(found.summary())
    assert "0 of 2 claims hold in the model; 2 hold with" in text
    assert "2 of 200 random neighbours fulfil 2 claims or more (1.00%" in text
    assert found.best[0] == 1


def test_a_scan_finds_the_change_that_makes_a_claim_hold() -> None:
    """A mass on a spring between stops that it reaches only with the larger load; folds by the exact walk."""
    system = gw.System(
        ["x"],
        mass=[1.0],
        damping=[0.1],
        stiffness=[1.0],
        contacts=[gw.stop("stop", {"x": 1.0}, 1.0, 20.0)],
        harmonics=[gw.Harmonic(0.05, {"x": 1.0})],
        frequency=1.2,
    )
    claims = [
        gw.ask.PointClaim("grazing", parameter="frequency", low=0.9, high=1.6, over=(1.6, 0.6)),
        gw.ask.PointClaim("grazing", parameter="frequency", low=0.9, high=1.6, absent=True, over=(1.6, 0.6)),
    ]
    options = {"factors": (1.9, 2.1), "neighbours": 0, "starts": 1}
    found = gw.ask.scan(system, claims, ["harmonic1.amplitude"], **options, workers=1)
    # the linear response reaches the stop where F > c sqrt(1 - c^2/4) = 0.0999, that is 1.9975 times 0.05
    assert found.holds.tolist() == [[0, 1], [0, 1], [1, 0]]


def test_a_system_that_runs_away_fulfils_nothing_and_holds_up_nothing() -> None:
    claims = [gw.ask.MotionClaim("period 3", {"frequency": 0.45}), gw.ask.MotionClaim("chaotic", {"frequency": 0.3})]
    options = {"factors": (0.0,), "neighbours": 0, "starts": 2, "check": 1}
    found = gw.ask.scan(CLUTCH, claims, ["stiffness.q3.q3"], **options, workers=1)
    assert found.holds[0, 0] == HOLDS
    assert found.holds[1].tolist() == [FAILS, FAILS]
    assert found.check.different == ()


def test_verdicts_agree_with_the_exact_flow() -> None:
    """Each motion from rest is what `classify` finds by the exact flow."""
    claims = [gw.ask.MotionClaim(kind, {"frequency": 0.45}) for kind in ("period 1", "period 3", "chaotic")]
    options = {"factors": (0.8, 1.25), "neighbours": 2, "starts": 1, "check": 0}
    found = gw.ask.scan(CLUTCH, claims, ["mean.q1", "harmonic1.amplitude"], **options, workers=1)
    for index in range(len(found.variations)):
        exact = gw.classify(CLUTCH.at(found.variations.of(index)))
        label = f"period {exact.period}" if exact.orbit else str(exact.kind.value)
        expected = [int(claim.motion == label) for claim in claims]
        assert found.holds[index].tolist() == expected, (found.words(index), exact.label)


def test_a_walk_that_has_no_beginning_is_unknown(monkeypatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise gw.errors.ConvergenceError("no orbit")

    monkeypatch.setattr("gapwalk.studies.scan_study.find_orbit", fail)
    claims = [gw.ask.PointClaim("fold", parameter="frequency", low=0.5, high=0.6)]
    options = {"factors": (0.5,), "neighbours": 0}
    found = gw.ask.scan(CLUTCH, claims, ["mean.q1"], **options, workers=1)
    assert (found.holds == UNKNOWN).all()
    assert "2 of 2 verdicts are unknown" in found.notes[0]


def test_claims_in_a_file() -> None:
    text = SCAN.replace(
        "claim = [",
        'claim = [{ point = "flip", from = 0.6, to = 0.8, over = [2.0, 0.5], at = { mean = { q3 = 0.3 } } }, '
        '{ no = "fold", parameter = "harmonic1.amplitude", from = 0.1, to = 0.2 }, ',
    ).replace('listed = [{ "mean.q3" = 0.3 }]\n', "")
    claims = gw.read_study(io.StringIO(text)).options.claims
    assert [claim.words for claim in claims] == [
        "flip at frequency from 0.6 to 0.8 at mean.q3 = 0.3",
        "no fold at harmonic1.amplitude from 0.1 to 0.2",
        "period 3 at frequency = 0.45",
    ]


@pytest.mark.parametrize(
    ("claim", "text"),
    [
        ("{ from = 0.1 }", "names nothing"),
        ('{ motion = "period 3", point = "fold" }', "names motion and point"),
        ('{ point = "fold" }', "has no range"),
        ('{ motion = "period 3", from = 0.1 }', "has no range; write at"),
        ('{ motion = "period 3", at = 3 }', "at is 3"),
        ('{ motion = "period 3", at = { frequency = "fast" } }', "write a number"),
        ('{ point = "knot", from = 0.1, to = 0.2 }', "knot"),
        ('{ point = "fold", from = 0.1, to = 0.2, over = 3 }', "over is 3"),
    ],
)
def test_a_wrong_claim_in_a_file_is_explained(claim: str, text: str) -> None:
    with pytest.raises(ModelError, match=text):
        gw.read_study(io.StringIO(HEAD + f'kind = "scan"\nclaim = [{claim}]\n'))


def test_the_picture_has_the_answer_the_best_variations_and_both_groups() -> None:
    figure = with_scores(2, 2, 1, neighbours=200).plot(title="Clutch").figure
    texts = [text.get_text() for ax in figure.axes for text in ax.texts]
    assert texts.count("holds") == 2  # the one that is best
    assert texts.count("no") == 2  # the system itself
    assert {"1", "2", "49", "197"} <= set(texts)  # variations and neighbours that fulfil so many
    assert [text.get_text() for text in figure.axes[1].get_legend().get_texts()] == [
        "tried: 50",
        "random neighbours: 200",
    ]


def test_claims_of_a_drive_train_have_units() -> None:
    text = Path("examples/drivetrain.toml").read_text(encoding="utf-8").partition("[[study]]")[0]
    claims = '[{ motion = "period 1", at = { speed = "900 rpm" } }, { no = "fold", from = "800 rpm", to = "1000 rpm" }]'
    study = f'{text}[study]\nkind = "scan"\nclaim = {claims}\n'
    assert [claim.words for claim in gw.read_study(io.StringIO(study)).options.claims] == [
        "period 1 at speed = 900",
        "no fold at speed from 800 to 1000",
    ]
    with pytest.raises(ModelError, match="unit of something else"):
        gw.read_study(io.StringIO(study.replace("900 rpm", "900 N")))


@pytest.mark.slow
def test_the_example_finds_the_first_stage_left_out(tmp_path) -> None:
    """Figures 17 to 19 of the paper: of 226 variations, K11 = 0 is the best, as row 12 of its tables prints it."""
    study = gw.read_study("examples/scan.toml")
    found = gw.run(study, tmp_path / "scan.gapwalk").finding.record
    assert int(found.variations.tried.sum()) >= 200
    assert found.scores[0] == 0
    assert found.words(found.best[0]) == "stiffness.q1.q1 = 0"
    assert found.holds[found.best[0]].tolist() == [HOLDS, FAILS, HOLDS]
    assert found.luck(2).neighbours == 300
    assert found.check.different == ()


# Claims as an experiment states them.

LINEAR = gw.System(
    ["x"], mass=[1.0], damping=[0.2], stiffness=[1.0], harmonics=[gw.Harmonic(0.1, {"x": 1.0})], frequency=2.0
)
OVER: Any = {"parameter": "frequency", "low": 0.5, "high": 2.0}


def walked(claim, system=LINEAR) -> tuple:
    """The verdict on a claim about a system."""
    found = gw.ask.scan(system, [claim], ["harmonic1.amplitude"], factors=(), neighbours=0, workers=1)
    return bool(found.holds[0, 0]) if found.holds[0, 0] != UNKNOWN else None, float(found.amounts[0, 0])


def test_peaks_and_their_places_are_those_of_a_linear_oscillator() -> None:
    height, place = 0.1 / (0.2 * math.sqrt(1.0 - 0.01)), math.sqrt(1.0 - 0.02)
    holds, amount = walked(gw.ask.SizeClaim("peak", "max.x", **OVER, least=0.5, most=0.51))
    assert holds
    assert amount == pytest.approx(height, rel=5e-4)  # of the points of the walk
    holds, amount = walked(gw.ask.SizeClaim("place", "max.x", **OVER, least=0.99))
    assert holds is (place >= 0.99)
    assert amount == pytest.approx(place, abs=0.01)  # between two points of the walk
    holds, amount = walked(gw.ask.SizeClaim("peak", "max.x", **OVER, than={"damping.x.x": 0.1}))
    assert (holds, amount) == (False, pytest.approx(0.5 * math.sqrt((1.0 - 0.0025) / (1.0 - 0.01)), rel=1e-3))
    assert walked(gw.ask.SizeClaim("peak", "max.x", **OVER, than={"damping.x.x": 0.1}, smaller=True))[0] is True


def test_responses_are_alike_within_their_largest_difference() -> None:
    louder = {"harmonic1.amplitude": 0.104}
    for within, expected in ((0.05, True), (0.03, False)):
        holds, off = walked(gw.ask.AlikeClaim("max.x", within, **OVER, than=louder))
        assert (holds, off) == (expected, pytest.approx(0.04, abs=1e-3))  # lines between points


@pytest.mark.slow
def test_figure_4_with_the_matched_impact_damping() -> None:
    """Against the walks of an independent program: flips .131 and .119 wide, pairs on P2, second resonance alike."""
    system = gw.paper.case("4a").at({"frequency": 2.0, "stage2.impact_damping": 0.05})
    viscous = {"stage2.impact_damping": 0.0, "damping.q1.q1": 0.04, "damping.q3.q1": -0.04}
    where: Any = {"parameter": "frequency", "low": 0.5, "high": 2.0}
    with_other = where | {"than": viscous}
    claims = [
        gw.ask.SizeClaim("width", "doubled", **with_other, least=0.13, most=0.132),
        gw.ask.RangeClaim("doubled", **where | {"low": 1.2755, "high": 1.3042}, within=2e-4, over=(2.0, 0.5)),
        gw.ask.RangeClaim("pair", **where | {"low": 0.595, "high": 0.605}, within=2e-3, over=(2.0, 0.5)),
        gw.ask.SizeClaim("peak", "half.q1", **with_other, smaller=True),
        gw.ask.AlikeClaim("half.q1", 0.05, **with_other | {"low": 0.8, "high": 1.95}, over=(2.0, 0.5)),
        gw.ask.AlikeClaim("fold", 0.1, **with_other),
    ]
    found = gw.ask.scan(system, claims, ["mean.q1"], factors=(), neighbours=0, workers=1)
    assert found.holds.tolist() == [[HOLDS] * len(claims)]
    ratio = 0.131 / 0.119
    assert found.amounts[0, 0] == pytest.approx(ratio, rel=0.01)
    assert found.amounts[0, 4] == pytest.approx(0.030 / 1.048, rel=0.2)


def test_a_closed_branch_of_twice_the_period_and_its_pairs() -> None:
    """Parametric excitation of a stop: figure 13's loop about the second resonance, 1.229 to 1.332, has pairs."""
    system = gw.paper.case("13").at(frequency=1.45)
    where: Any = {"parameter": "frequency", "low": 1.1, "high": 1.45, "period": 2}
    claims = [
        gw.ask.LoopClaim(**where),
        gw.ask.LoopClaim(**where | {"high": 1.3}, over=(1.45, 1.1)),
        gw.ask.RangeClaim("pair", **where | {"low": 1.184, "high": 1.197}, within=1e-3, over=(1.45, 1.1)),
        gw.ask.RangeClaim("pair", **where | {"period": 1}),
        gw.ask.RangeClaim("pair", **where | {"period": (1, 2)}),
    ]
    found = gw.ask.scan(system, claims, ["mean.q1"], factors=(), neighbours=0, workers=1)
    assert found.holds.tolist() == [[HOLDS, FAILS, HOLDS, FAILS, HOLDS]]


def test_a_walk_with_longer_periods_serves_claims_about_period_1(monkeypatch) -> None:
    walked, walk = [], _Scanner._walk
    monkeypatch.setattr(_Scanner, "_walk", lambda self, *where: walked.append(where[1].doubled) or walk(self, *where))
    system = gw.paper.case("13").at(frequency=1.45)
    where: Any = {"parameter": "frequency", "low": 1.3, "high": 1.45}
    claims = [gw.ask.PointClaim(gw.Kind.FLIP, **where), gw.ask.RangeClaim("pair", **where, period=(1, 2))]
    found = gw.ask.scan(system, claims, ["mean.q1"], factors=(), neighbours=0, workers=1)
    assert walked == [True]
    assert (found.holds[0, 0], found.amounts[0, 0]) == (HOLDS, 1.0)  # the flip at 1.3318


def test_patterns_of_impacts_are_those_of_the_motion() -> None:
    settled = gw.settle(CLUTCH)
    assert settled.orbit is not None
    at, own = {"frequency": 0.45}, settled.orbit.pattern
    claims = [gw.ask.MotionClaim("period 3", at, hits=each) for each in (own, "9+/9-", "")]
    found = gw.ask.scan(CLUTCH, claims, ["mean.q1"], factors=(), neighbours=0, starts=4, workers=1)
    assert found.holds.tolist() == [[HOLDS, FAILS, HOLDS]]
    assert 0.0 < found.amounts[0, 0] <= found.amounts[0, 2]
    assert claims[0].words == f"period 3 with impacts {own} at frequency = 0.45"


@pytest.mark.parametrize(
    ("table", "text"),
    [
        ('{ peak = "half.q1", from = 0.4, to = 0.5 }', "says neither least nor most"),
        ('{ peak = "half.q9", from = 0.4, to = 0.5, least = 1.0 }', "no signal q9"),
        ('{ width = "twisted", from = 0.4, to = 0.5, least = 0.1 }', 'width is "twisted"; natures of motions are'),
        ('{ alike = "half.q1", from = 0.4, to = 0.5 }', "names no other model"),
        ("{ loop = 3, from = 0.4, to = 0.5 }", "write an even period"),
        ('{ motion = "chaotic", hits = "1+/0-" }', "no pattern that repeats"),
        ('{ point = "flip", from = 0.4, to = 0.5, least = 1.0 }', "least has no meaning in a claim about point"),
        ('{ peak = "half.q1", width = "pair", from = 0.4, to = 0.5 }', "a claim names width and peak"),
        ('{ range = "pair" }', "a claim about a branch has no range"),
        ('{ range = "pair", from = 0.4, to = 0.5, period = [1, 3] }', r"period is .1, 3.; write a number"),
        ('{ range = "pair", from = 0.4, to = 0.5, period = "two" }', "period is 'two'; write a number"),
    ],
)
def test_tables_of_claims_teach(table: str, text: str) -> None:
    with pytest.raises(ModelError, match=text):
        gw.read_study(io.StringIO(SCAN.replace('{ motion = "period 3", at = { frequency = 0.45 } }', table)))

"""Tolerances against a campaign of full walks, closed forms of grazing, and the distributions of SciPy."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

import gapwalk as gw
from gapwalk.answers.point_fit import Form, Met, Patterns, Pool, _attached
from gapwalk.answers.point_prediction import Guess, Regression, Regressions, Terms, polynomial
from gapwalk.answers.tolerance import HowFound, Spread, Spreads, chance_of, parts_in
from gapwalk.answers.tolerance_tracking import Tracker
from gapwalk.ask import tolerance
from gapwalk.errors import Interrupted, ModelError
from gapwalk.flow.flow import Flow
from gapwalk.model import Contact, Harmonic, Side, Stage, System
from gapwalk.plot.picture import picture_of
from gapwalk.studies.tolerance_study import ToleranceStudy, _Samples

DATA = Path(__file__).resolve().parents[1] / "data"
CAMPAIGN, NARROW = DATA / "tolerance_campaign.csv", DATA / "tolerance_narrow.csv"
PERCENT = {
    "stage2.clearance": 5,
    "stage2.impact_damping": 10,
    "mean.q1": 5,
    "mean.q3": 5,
    "harmonic1.amplitude": 5,
    "damping.q3.q3": 10,
    "stiffness.q3.q3": 2,
    "mass.q1.q1": 2,
}
IDLE = Path(__file__).resolve().parents[2] / "examples" / "idle.toml"
GAP, LOAD, DAMPING = 1.0, 0.15, 0.1
OPTIONS = {"samples": 120, "check": 2, "walk": gw.WalkOptions(largest_step=0.05)}


def stopped(*others: Contact) -> System:
    """A mass on a spring, shaken so that it touches a soft stop near its resonance."""
    stops = [Contact("stop", {"x": 1.0}, (Stage(GAP, 0.05, side=Side.POSITIVE),)), *others]
    return System(
        ["x"], [[1.0]], damping=[[DAMPING]], contacts=stops, harmonics=[Harmonic(LOAD, {"x": 1.0})], frequency=0.5
    )


def touches(gap, load, damping):
    """Return the frequencies at which the amplitude of the linear oscillator is the gap: roots of a quadratic."""
    half = 1.0 - damping**2 / 2.0
    root = np.sqrt(half**2 - 1.0 + (load / gap) ** 2)
    return np.sqrt(half - root), np.sqrt(half + root)


def laws() -> tuple[Spread, ...]:
    return (
        Spread("stop.clearance", sd=0.03),
        Spread("harmonic1.amplitude", "uniform", low=0.14, high=0.16),
        Spread("damping.x.x", "triangular", low=0.09, high=0.11),
    )


@pytest.fixture(scope="module")
def found():
    return tolerance(stopped(), "frequency", (0.5, 1.5), laws(), band=(0.8, 0.93), **OPTIONS, workers=1)


@pytest.mark.slow
def test_grazing_points_of_all_samples_are_those_of_the_closed_form(found):
    low, high = touches(*found.samples.T)
    kinds = [special.kind.value for special in found.points]
    first, last = (k for k, kind in enumerate(kinds) if kind == "grazing")
    assert np.sum(found.how == HowFound.WALKED) == 15  # one of eight; no other one needs it
    assert np.sum(found.how == HowFound.TRACKED) == 105
    # tracked points are corrected until 5e-6 of the scaled parameter are left at most
    assert found.values[:, first] == pytest.approx(low, abs=5e-6)
    assert found.values[:, last] == pytest.approx(high, abs=5e-6)
    assert not found.check.different
    chance = found.chances(0.8, 0.93)[first]
    assert chance.count == int(np.sum((low >= 0.8) & (low <= 0.93)))
    assert found.quantiles(0.25)[0, first] == pytest.approx(np.quantile(low, 0.25), abs=5e-6)


def test_sobol_indices_agree_with_those_of_the_closed_form(found):
    class Law:
        def __init__(self, law):
            self.ppf = law.about(stopped()).quantile

    exact = stats.sobol_indices(
        func=lambda x: touches(*x)[0], n=8192, dists=[Law(law) for law in laws()], rng=np.random.default_rng(1)
    )
    mine = found.influences[0]
    assert mine.first == pytest.approx(exact.first_order, abs=0.02)
    assert mine.total == pytest.approx(exact.total_order, abs=0.02)
    assert mine.unexplained < 1e-3


def test_a_stopped_study_continues_to_the_same_bits(found, tmp_path):
    file, parts = tmp_path / "stopped.gapwalk", []

    def stop(part, pace):
        parts.append(part)
        if len(parts) == 3:
            raise KeyboardInterrupt

    asked = (stopped(), "frequency", (0.5, 1.5), laws())
    with pytest.raises(Interrupted) as stopped_at:
        tolerance(*asked, band=(0.8, 0.93), **OPTIONS, workers=1, output=file, report=stop)
    assert 0 < len(stopped_at.value.found.samples) < 120
    again = tolerance(*asked, band=(0.8, 0.93), **OPTIONS, workers=1, output=file)
    assert again.values.tobytes() == found.values.tobytes()
    assert again.how.tobytes() == found.how.tobytes()
    assert gw.open_result(file).values.tobytes() == found.values.tobytes()


@pytest.mark.slow
def test_samples_without_points_that_all_walks_have_are_walked(tmp_path):
    weak = (Spread("harmonic1.amplitude", "uniform", low=0.098, high=0.14), Spread("stop.clearance", sd=0.003))
    options, file = {**OPTIONS, "seed": 10, "check": 0}, tmp_path / "weak.gapwalk"
    few = tolerance(stopped(), "frequency", (0.5, 1.5), weak, **options, workers=1, output=file)
    touching = (few.samples[:, 0] / few.samples[:, 1]) ** 2 > DAMPING**2 * (1.0 - DAMPING**2 / 4.0)
    assert touching[:15].all()  # these are walked first
    assert np.sum(~touching) == 6
    grazing = [k for k, special in enumerate(few.points) if special.kind.value == "grazing"]
    assert np.array_equal(~np.isnan(few.values[:, grazing]).any(axis=1), touching)
    assert np.isnan(few.values[~touching]).all()
    assert np.all(few.how[~touching] == HowFound.WALKED)
    low, high = touches(*few.samples[touching].T[::-1], DAMPING)
    assert few.values[np.ix_(touching, grazing)] == pytest.approx(np.column_stack((low, high)), abs=5e-6)
    exact = np.column_stack((low, high))
    assert np.all(np.abs(few.values[np.ix_(touching, grazing)] - exact) <= few.errors[np.ix_(touching, grazing)] + 1e-9)


@pytest.mark.slow
def test_points_are_noticed_that_no_walk_has():
    """A second stop, which the motion reaches only in parts in which it is near enough."""
    branch = gw.follow(gw.find_orbit(stopped()), "frequency", 1.5)
    peak = -float(branch.measure("min.x").min())
    system = stopped(Contact("wall", {"x": 1.0}, (Stage(1.05 * peak, 0.05, side=Side.NEGATIVE),)))
    law = Spread("wall.clearance", "uniform", low=0.99 * peak, high=1.1 * peak)
    found = tolerance(system, "frequency", (0.5, 1.5), [law], **dict(OPTIONS, check=0, seed=44), workers=1)
    touching = found.samples[:, 0] < 0.999 * peak
    assert not touching[:15].any()  # these are walked first
    assert touching.sum() >= 3
    assert np.all(found.how[touching] == HowFound.PARTLY)
    further = {each.sample for each in found.further}
    assert further >= set(np.flatnonzero(touching).tolist())
    assert further <= set(np.flatnonzero(found.samples[:, 0] < 1.001 * peak).tolist())
    assert np.sum(found.how == HowFound.TRACKED) > 90


def test_errors_of_predictions_bound_those_of_other_samples():
    random = np.random.default_rng(3)
    x, other = random.standard_normal((120, 3)), random.standard_normal((2000, 3))

    def law(values):
        return np.exp(0.2 * values[:, 0]) * np.sqrt(4.0 + values[:, 1]) + 0.05 * values[:, 2] ** 3

    fit = Regression(x, 3)
    terms = Terms(other)
    leverages = terms.leverages(fit.cloud)
    errors = fit.unit_error(law(x)) * (1.0 + leverages)
    rest = np.abs(polynomial(other, 3) @ fit.fit(law(x)) - law(other))
    assert np.mean(np.isinf(leverages)) < 0.05  # beyond all samples of the fit
    assert np.all(rest <= errors)
    # the closed form of what is left out agrees with fits that do not know a sample
    some = [Regression(np.delete(x, k, 0), 3).fit(np.delete(law(x), k)) for k in range(5)]
    left_out = [law(x)[k] - (polynomial(x[[k]], 3) @ each)[0] for k, each in enumerate(some)]
    assert fit.left_out(law(x))[:5] == pytest.approx(left_out, rel=1e-8)
    # the number of a part appears twice: nothing tells how its parameters act apart
    assert Regression(np.column_stack((x[:, 0], x[:, 0])), 2).unit_error(law(x)) == np.inf


def test_bounds_hold_in_directions_in_which_few_samples_of_a_fit_are_far():
    """Along one of many parameters a sample may be far, though its leverage is still small in a fit to many."""
    worst = []
    for seed in range(8):
        random = np.random.default_rng(seed)
        count, parameters = int(random.choice([60, 140, 340])), int(random.integers(3, 6))
        x = random.standard_normal((12_000, parameters))
        one, other = (x @ (each / np.linalg.norm(each)) for each in random.standard_normal((2, parameters)))
        values = np.exp(0.1 * one) + 0.03 * np.sin(other)
        fit, terms = Regressions(x).best(np.arange(count)), Terms(x[count:])
        assert fit is not None
        bounds = fit.unit_error(values[:count]) * (1.0 + terms.leverages(fit.cloud))
        rest = np.abs(terms.of(fit.degree) @ fit.fit(values[:count]) - values[count:])
        assert np.mean(np.isfinite(bounds)) > 0.9
        worst.append(float((rest / bounds).max()))
    assert 0.2 < np.median(worst) < max(worst) < 1.0


def test_the_distance_of_an_attached_point_has_a_bound_that_grows_beyond_its_samples():
    random = np.random.default_rng(1)
    x, other = random.standard_normal((40, 2)), random.standard_normal((4000, 2))

    def apart(values):
        return 1e-6 * np.exp(0.8 * values[:, 0]) / (1.3 + np.tanh(values[:, 1]))

    met = [Met(k, kind, "", "", 1.0, "()", "()", 0, 1, np.zeros(1)) for k, kind in enumerate(("grazing", "fold"))]
    forms = [Form(k, str(k), float(k), -1, each, None) for k, each in enumerate(met)]  # pyright: ignore
    rows, nothing = np.arange(len(x)), np.zeros((len(x), 1, 1))
    touch = 1.0 + 0.01 * x[:, 0]
    values = (touch, touch - apart(x))
    pools = [Pool(rows, each[:, None], nothing, np.zeros(len(x))) for each in values]
    attached = _attached(forms[1], 1, forms, pools, Regressions(x))
    assert attached.companion == 0
    offsets, errors = attached.offset_at(Terms(other))
    rest = np.abs(offsets + apart(other))
    assert np.mean(np.isinf(errors)) < 0.2
    assert np.mean(rest > errors) < 1e-3
    # three times the most that a sample differs from the fit to all others is no bound everywhere
    left_out = Regression(x, 2).left_out(values[1] - touch)
    assert np.mean(rest > 3.0 * np.abs(left_out).max()) > 0.0


def campaign() -> tuple[np.ndarray, np.ndarray]:
    """Return samples and special points of the brute-force campaign; the file says how it was made."""
    table = np.genfromtxt(CAMPAIGN, delimiter=",", skip_header=5)
    return table[:, :8], table[:, 8:]


def in_percent(system, share=1.0):
    """Normal laws about the values of a system, with a share of the standard deviations in `PERCENT`."""
    sds = {name: abs(system[name]) * (share * sd) / 100.0 for name, sd in PERCENT.items()}
    return Spreads(tuple(Spread(name, sd=sd, mean=system[name]) for name, sd in sds.items()))


def clutch():
    """Figure 13 with eight uncertain parameters."""
    system = gw.paper.case("13")
    spreads = in_percent(system)
    asked = ToleranceStudy("frequency", 1.9, 0.6, samples=400, spreads=spreads)
    work = _Samples(asked.work(system))
    return work, gw.follow(gw.find_orbit(work.system), "frequency", 0.6)


@pytest.mark.slow
def test_a_walk_finds_the_counterparts_of_nominal_points_in_other_forms():
    samples, walked = campaign()
    work, branch = clutch()
    assert work.design.values[:400] == pytest.approx(samples, rel=1e-10)
    tracker = Tracker(work._tracking(branch))
    # in sample 7 the first fold of the walk lies beyond another grazing contact, which the nominal one does not have
    (found,) = tracker.walks(0, np.array([6]), samples[6:7]).walked
    values = {met.index: met.value for met in found.met if met.index >= 0}
    assert [values[j] for j in range(10)] == pytest.approx(walked[6], rel=1e-6)
    fold = next(met for met in found.met if met.index == 8)
    assert fold.key != tracker.mine[8].key
    assert fold.closings != tracker.mine[8].closings
    assert {met.kind for met in found.met if met.index < 0} >= {"neimark-sacker"}


def test_a_predicted_inverse_replaces_derivatives_of_multipliers():
    samples, _ = campaign()
    work, branch = clutch()
    point = Tracker(work._tracking(branch)).nominal[9]
    near = point.origin + 0.02 * (samples[0] - point.origin)
    plane, start = point.plane_at(near), point.unknowns + point.slopes @ (near - point.origin)
    inverse = np.linalg.inv(point.derivatives_at(point.solved(point.origin, point.unknowns)))
    guess = Guess(start, inverse, mismatch=0.1, curvature=20.0)
    assert point.orientation == np.sign(np.linalg.det(inverse))
    assert point.signature[0] == ((0, 1), (1, 1))  # the contacts of the fold; computed once, and not counted below
    before = Flow.calls
    found = point.fitted_at(plane, guess)
    chords = Flow.calls - before
    before = Flow.calls
    exact = point.found_at(near)
    newton = Flow.calls - before
    assert str(point.special.kind) == "fold"
    assert found.value == pytest.approx(exact.value, abs=5e-6)
    assert abs(found.value - start[-1]) > 0.0
    assert chords < newton


def test_forms_on_other_branches_are_known_by_what_walks_met():
    met = Met(-1, "fold", "", "", 1.0, "()", "(0, 0, 0)", 0, 1, np.zeros(0))
    forms = [Form(-1, name, float(k), -1, met, None) for k, name in enumerate("abcd")]  # pyright: ignore
    # the walks always meet a and d; what lies between belongs together
    walks = [((0, 3), "ad"), ((0, 1, 2, 3), "abcd"), ((0, 2, 3), "ad"), ((0, 2, 3), "ad")]
    known = Patterns.of(forms, walks)
    assert known.told((0, 3)) == ((0, 3), ())
    assert known.told((0, 1, 2, 3)) == ((0, 1, 2, 3), ())
    assert known.told((0, 2, 3)) == ((0, 3), ())  # c alone lies elsewhere
    assert known.told((0, 1, 3)) == ((3,), (1,))  # no walk has shown it
    assert known.told((1, 2, 3)) == ((3,), (1,))  # a is missing
    assert known.told((0,)) == ((0,), (2,))  # d is missing, and nothing was found in its stretch
    assert known.told((0, 3), {1}) == ((3,), (1,))  # points may have been born in the stretch of a
    assert known.anchors == (-1, 0, 3)
    assert known.known_share == 0.5  # two walks of four were alike: below a share, all other samples are walked
    unclear = Patterns.of(forms, [*walks, ((0, 2, 3), "acd")])
    assert unclear.told((0, 2, 3))[1] == (1,)
    # a point without a form makes doubtful only the stretch in which a walk met it
    strange = Patterns.of(forms, [((0, 3), "ad"), ((0, 1, 3), "axd")])
    assert strange.told((0, 3)) == ((0, 3), ())
    assert strange.told((0, 1, 3))[1] == (1,)


@pytest.mark.slow
def test_quantiles_of_clutches_are_those_of_the_campaign():
    samples, walked = campaign()
    work, _ = clutch()
    system, spreads = work.system, work.spreads
    found = tolerance(system, "frequency", (1.9, 0.6), spreads, samples=400, check=0)
    assert found.samples == pytest.approx(samples, rel=1e-10)
    shares = (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99)
    assert found.quantiles(*shares) == pytest.approx(np.nanquantile(walked, shares, axis=0), rel=5e-3)
    assert np.mean(np.isnan(found.values)) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize(("accuracy", "largest", "quantile"), [(1e-5, 2e-6, 5e-6), (1e-3, 5e-5, 5e-5)])
def test_all_points_of_a_thousand_clutches_are_those_of_full_walks(accuracy, largest, quantile):
    system = gw.paper.case("13").at(frequency=1.9)
    spreads = in_percent(system, 0.2)
    options = {"samples": 1000, "check": 0, "accuracy": accuracy}
    found = tolerance(system, "frequency", (1.9, 0.15), spreads, **options)
    lines = [line.split(",")[1].split() for line in NARROW.read_text().splitlines()[4:]]
    walks = [[(point[0], float(point[1:])) for point in line] for line in lines]
    letters = {"grazing": "G", "flip": "P", "fold": "F", "neimark-sacker": "N"}
    kinds, exact = [letters[special.kind.value] for special in found.points], np.full_like(found.values, np.nan)
    further: dict[int, list[tuple[str, float]]] = {}
    for each in found.further:
        further.setdefault(each.sample, []).append((letters[each.kind], each.value))
    unlike = []
    for k, walk in enumerate(walks):
        mine = [*zip(kinds, found.values[k].tolist(), strict=True)]
        for j, (kind, value) in enumerate(mine):
            if not np.isnan(value):
                exact[k, j] = min((there for other, there in walk if other == kind), key=lambda v: abs(v - value))
        every = [each for each in mine if not np.isnan(each[1])] + further.get(k, [])
        if sorted(kind for kind, value in every if value >= 0.15) != sorted(kind for kind, _ in walk):
            unlike.append(k)
    assert not unlike
    rest = np.abs(found.values - exact)
    assert np.nanmax(rest) < largest
    assert np.nanmax(rest - found.errors) < 1e-7  # the file has seven digits
    shares = (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99)
    assert found.quantiles(*shares) == pytest.approx(np.nanquantile(exact, shares, axis=0), rel=quantile)


@pytest.mark.parametrize(
    ("law", "other"),
    [
        (Spread("x", sd=0.3, mean=2.0), stats.norm(2.0, 0.3)),
        (Spread("x", sd=0.3, mean=2.0, low=1.9, high=2.5), stats.truncnorm(-1 / 3, 5 / 3, 2.0, 0.3)),
        (Spread("x", sd=0.3, mean=2.0, low=4.0), stats.truncnorm(20 / 3, np.inf, 2.0, 0.3)),
        (Spread("x", "uniform", low=-1.0, high=3.0), stats.uniform(-1.0, 4.0)),
        (Spread("x", "triangular", low=1.0, high=3.0, mean=1.5), stats.triang(0.25, 1.0, 2.0)),
    ],
)
def test_laws_are_those_of_scipy(law, other):
    shares = np.linspace(0.001, 0.999, 41)
    assert law.quantile(shares) == pytest.approx(other.ppf(shares), rel=1e-9)


def test_correlated_parameters_have_their_correlation():
    normal = tuple(Spread(name, sd=0.1, mean=1.0) for name in ("a", "b"))
    design = Spreads(normal, ((1.0, 0.8), (0.8, 1.0))).design(4000, 0)
    assert np.corrcoef(design.values.T)[0, 1] == pytest.approx(0.8, abs=0.02)
    assert not design.independent
    assert Spreads(normal).design(10, 3).independent
    with pytest.raises(ModelError, match="eigenvalue"):
        Spreads((*normal, Spread("c", sd=1.0)), ((1.0, 0.9, 0.9), (0.9, 1.0, -0.9), (0.9, -0.9, 1.0)))


def test_measured_parts_are_drawn_row_by_row():
    rows = b"stop.clearance,harmonic1.amplitude\n1.0,0.15\n1.02,0.151\n0.98,0.149\n"
    design = parts_in(rows, "parts.csv").design(7, 0)
    rows = {tuple(row) for row in design.values.tolist()}
    assert rows == {(1.0, 0.15), (1.02, 0.151), (0.98, 0.149)}
    assert sorted(map(tuple, design.values[:3].tolist())) == sorted(rows)
    with pytest.raises(ModelError, match="wide"):
        parts_in(b"stop.clearance\n1.0\nwide\n", "parts.csv")


def test_the_interval_is_that_of_clopper_and_pearson():
    none, half = chance_of(0, 10), chance_of(20, 40)
    assert (none.low, none.high) == (0.0, pytest.approx(1.0 - 0.025**0.1, rel=1e-12))
    assert half.low == pytest.approx(stats.beta.ppf(0.025, 20, 21), rel=1e-9)
    assert half.high == pytest.approx(stats.beta.ppf(0.975, 21, 20), rel=1e-9)


def test_the_table_of_a_study_takes_units_and_percent():
    study = next(each for each in gw.studies.read_studies(IDLE) if each.name == "scatter")
    clearance, drag, amplitude = study.options.spreads.laws
    assert clearance.sd == pytest.approx(0.1 * study.system["mesh.clearance"])
    assert (drag.low, drag.high) == (-2.2, -1.8)
    assert amplitude.sd == pytest.approx(0.6)
    assert study.options.samples == 200


@pytest.mark.parametrize(
    ("law", "text"),
    [
        ({"sd": -1.0}, "above 0"),
        ({"law": "uniform", "low": 1.0}, "low and high"),
        ({"sd": 1.0, "low": 2.0, "high": 1.0}, "not below high"),
        ({"law": "gauss", "sd": 1.0}, "normal"),
        ({"sd": math.nan}, "finite"),
    ],
)
def test_laws_that_make_no_sense_are_refused(law, text):
    with pytest.raises(ModelError, match=text):
        Spread("x", **law)


def test_values_that_the_model_does_not_allow_are_counted(found):
    wide = (Spread("stop.clearance", sd=0.02), Spread("harmonic1.amplitude", sd=0.002), Spread("mass.x.x", sd=0.5))
    options = {**OPTIONS, "samples": 40, "check": 0}
    bold = tolerance(stopped(), "frequency", (0.5, 1.5), wide, **options, workers=1)
    refused = bold.samples[:, 2] <= 0.0
    assert np.all(bold.how[refused] == HowFound.REFUSED)
    assert np.isnan(bold.values[refused]).all()
    assert bold.exists[0].samples == int(bold.known.sum())


def test_the_parameter_of_the_response_cannot_vary():
    with pytest.raises(ModelError, match="cannot have a spread"):
        tolerance(stopped(), "frequency", (0.5, 1.5), [Spread("frequency", sd=0.1)])


def test_the_picture_has_a_row_for_each_point(found):
    rows = [axes for axes in picture_of(found).axes if axes.get_title("left").startswith("distribution")]
    assert [len(axes.get_yticks()) for axes in rows] == [len(found.points)]

"""Alignment and fits: known phases and parameters are found, and what cannot be known is said."""

import numpy as np
import pytest
from scipy.stats import chi2

import gapwalk as gw
from gapwalk.errors import ConvergenceError, ModelError
from gapwalk.flow.motion import signal_of
from gapwalk.measurement.fit import Misfit
from gapwalk.orbit.find import carry
from gapwalk.orbit.orbit import signal_along
from tests.systems import linear
from tests.tiers import in_campaign

TRUE = {"stage2.impact_damping": 0.1, "mean.q1": 0.05, "stage2.clearance": 1.0}
GUESS = {"stage2.impact_damping": 0.2, "mean.q1": 0.12, "stage2.clearance": 0.8}
NAMES = tuple(TRUE)
NOISE, PHASE = 0.03, 1.234


@pytest.fixture(scope="module")
def rattle() -> gw.Orbit:
    """The motion of the synthetic example, with an impact on either side."""
    return gw.find_orbit(gw.paper.case("8a").at({"mean.q1": 0.05, "mean.q3": 0.05, "frequency": 0.35}))


@pytest.fixture(scope="module")
def guess(rattle) -> gw.Orbit:
    return gw.find_orbit(rattle.system.at(GUESS))


def record_of(orbit: gw.Orbit, signal="q1''", *, seed: int | None = None, samples=97.3, periods=10.4, phase=PHASE):
    """A record of an orbit with an offset, at a rate that suits no period, with noise if there is a seed."""
    step = 2 * np.pi / orbit.system.frequency / samples
    time = 3.0 + step * np.arange(int(samples * periods))
    theta = orbit.system.frequency * (time - time[0]) + phase
    values = 0.7 + signal_along(orbit, signal_of(orbit.system, signal), theta)
    if seed is not None:
        values = values + np.random.default_rng(seed).normal(0.0, NOISE, len(values))
    return gw.measure.Record(time, values)


@pytest.mark.parametrize("phase", [0.0, 1.234, 6.1])
def test_the_phase_of_a_clean_record_is_found_far_below_a_sample(rattle, phase) -> None:
    found = gw.measure.align(rattle, record_of(rattle, phase=phase, samples=40.7), "q1''")
    apart = (found.phase - phase + np.pi) % (2 * np.pi) - np.pi
    assert abs(apart) < 1e-9
    assert found.agreement.rms < 1e-9
    assert found.agreement.correlation == pytest.approx(1.0, abs=1e-12)
    assert found.periods == 10
    assert all(abs(line.difference) < 1e-8 for line in found.agreement.lines)


def test_the_phase_of_a_longer_period_is_found_among_all(rattle) -> None:
    three = gw.settle(gw.paper.case("15").at(frequency=0.45)).orbit
    assert three is not None
    found = gw.measure.align(
        three, record_of(three, {"q1''": 1.0, "q3''": -0.4}, phase=15.0), {"q1''": 1.0, "q3''": -0.4}
    )
    assert found.phase == pytest.approx(15.0, abs=1e-9)
    assert found.periods == 3


def test_the_error_of_a_noisy_record_is_its_noise(rattle) -> None:
    found = gw.measure.align(rattle, record_of(rattle, seed=1, periods=40.2), "q1''")
    assert found.agreement.rms == pytest.approx(NOISE, rel=0.05)
    assert abs(found.phase - PHASE) < 4e-3
    again = gw.measure.align(rattle, found.record, "q1''", phase=PHASE)
    assert (again.phase, again.agreement.rms > found.agreement.rms) == (PHASE, True)
    assert "rms error 0.03" in repr(found)


def test_a_record_that_suits_no_motion_is_refused(rattle) -> None:
    with pytest.raises(ModelError, match=r"covers 0\.9.* forcing periods, but the motion repeats after 1 at"):
        gw.measure.align(rattle, record_of(rattle, periods=0.95), "q1''")
    with pytest.raises(ModelError, match="samples per forcing period; at least 8 are needed"):
        gw.measure.align(rattle, record_of(rattle, samples=7.0), "q1''")
    record = record_of(rattle)
    with pytest.raises(ModelError, match="it is constant"):
        gw.measure.align(rattle, gw.measure.Record(record.time, np.ones(len(record))), "q1''")


def test_derivatives_of_the_misfit_are_those_of_differences(rattle) -> None:
    """With the frequency, whose change turns every sample's angle too."""
    misfit = Misfit(rattle, record_of(rattle, periods=3.1), signal_of(rattle.system, "q1''"))
    names, step = ("mean.q1", "frequency"), 1e-6
    slopes = misfit.slopes(rattle, 0.4, names).table
    for place, name in enumerate(names):
        moved = [
            gw.find_orbit(rattle.system.at({name: rattle.system[name] + sign * step}), start=rattle.state)
            for sign in (1, -1)
        ]
        difference = (misfit.residual(moved[0], 0.4) - misfit.residual(moved[1], 0.4)) / (2 * step)
        np.testing.assert_allclose(slopes[:, place], difference, atol=1e-5 * np.abs(difference).max())
    difference = (misfit.residual(rattle, 0.4 + step) - misfit.residual(rattle, 0.4 - step)) / (2 * step)
    np.testing.assert_allclose(slopes[:, -1], difference, atol=1e-5 * np.abs(difference).max())


def test_a_clean_record_gives_its_parameters_to_rounding(rattle, guess) -> None:
    found = gw.measure.fit(guess, record_of(rattle), NAMES, "q1''")
    for name, value in TRUE.items():
        assert found[name].value == pytest.approx(value, abs=1e-7)
    assert found.after.agreement.rms < 1e-8 < found.before.agreement.rms
    assert found.orbit.system["stage2.clearance"] == found["stage2.clearance"].value
    assert (found.failures, found.notes, found.evaluations < 30) == ((), (), True)


def test_a_guess_or_a_phase_of_zero_is_no_hindrance(rattle) -> None:
    """What counts for an effect must not depend on where a parameter happens to begin."""
    begun = carry(rattle, rattle.system.at({"stage2.impact_damping": 0.02, "mean.q1": 1e-14}))
    found = gw.measure.fit(begun, record_of(rattle, phase=1e-13), ["mean.q1", "stage2.impact_damping"], "q1''")
    assert (found.failures, found["mean.q1"].value) == ((), pytest.approx(0.05, abs=1e-7))


@pytest.mark.slow
@pytest.mark.parametrize("records", [15, in_campaign(30)])
def test_standard_errors_are_those_of_repeated_measurements(rattle, records) -> None:
    """Deviations from the truth in units of the stated errors: the mean square of all of them must be near 1."""
    deviations, correlations = [], []
    for seed in range(records):
        found = gw.measure.fit(rattle, record_of(rattle, seed=seed, periods=6.2), NAMES, "q1''")
        estimates = [*found.estimates, found.phase]
        deviations.append(
            [(e.value - true) / e.error for e, true in zip(estimates, [*TRUE.values(), PHASE], strict=True)]
        )
        correlations.append(found.correlation[0, 1])
        assert found.failures == ()
    squares = np.mean(np.square(deviations), axis=0)
    low, high = chi2.ppf([0.001, 0.999], records) / records
    assert np.all((squares > low) & (squares < high))
    low, high = (0.75, 1.3) if records == 30 else (0.7, 1.35)
    assert low < np.mean(squares) < high
    table = np.corrcoef(np.transpose(deviations))
    assert table[0, 1] == pytest.approx(np.mean(correlations), abs=0.4)


def test_the_frequency_is_fitted_from_the_drift_of_the_phase(rattle) -> None:
    begun = gw.find_orbit(rattle.system.at(frequency=0.3503))
    found = gw.measure.fit(begun, record_of(rattle, seed=3), ["frequency"], "q1''")
    assert abs(found["frequency"].value - 0.35) < 4 * found["frequency"].error < 2e-4
    record = record_of(rattle)
    measured = gw.measure.Record(record.time, record.acceleration, np.full(len(record), 0.35))
    with pytest.raises(ModelError, match="known from the measured speed; do not fit it"):
        gw.measure.fit(rattle, measured, ["frequency"], "q1''")


def test_what_a_record_cannot_tell_is_said(rattle) -> None:
    record = record_of(rattle, seed=4)
    product = gw.measure.fit(rattle, record, ["harmonic1.amplitude", "harmonic1.acts_on.q1"], "q1''")
    (text,) = product.failures
    assert "does not determine harmonic1.amplitude and harmonic1.acts_on.q1: changing them as 1 : -" in text
    ratio = float(text.partition(" : -")[2].split()[0])  # that of their values leaves the product as it is
    assert ratio == pytest.approx(product.estimates[1].value / product.estimates[0].value, rel=0.01)
    assert np.isinf(product["harmonic1.amplitude"].error)
    assert "undetermined" in repr(product)
    phase = gw.measure.fit(rattle, record, ["harmonic1.phase", "mean.q1"], "q1''", bounds={"harmonic1.phase": (-1, 1)})
    assert "does not determine harmonic1.phase and phase" in phase.failures[0]
    assert np.isfinite(phase["mean.q1"].error)
    held = gw.measure.fit(rattle, record, ["harmonic1.phase"], "q1''", phase=PHASE)
    assert held.failures == ()
    assert abs(held["harmonic1.phase"].value) < 4 * held["harmonic1.phase"].error


def test_a_gap_that_is_never_met_cannot_be_told() -> None:
    system = gw.paper.case("13").at({"frequency": 1.9, "mean.q1": 0.0, "mean.q3": 0.0})
    orbit = gw.find_orbit(system, start="rest")
    assert orbit.pattern == "open"
    found = gw.measure.fit(orbit, record_of(orbit, seed=5), ["stage2.clearance", "damping.q1.q1"], "q1''")
    assert found.failures == ("the record does not determine stage2.clearance: it changes nothing in this signal",)
    assert np.isfinite(found["damping.q1.q1"].error)


def test_a_bound_is_kept_and_told(rattle) -> None:
    found = gw.measure.fit(
        gw.find_orbit(rattle.system.at({"stage2.impact_damping": 0.2})),
        record_of(rattle, seed=6),
        NAMES,
        "q1''",
        bounds={"stage2.impact_damping": (0.15, 0.3)},
    )
    assert found["stage2.impact_damping"].value == pytest.approx(0.15, abs=1e-4)
    assert any("stage2.impact_damping ended at its bound 0.15" in text for text in found.notes)
    assert str(found["stage2.impact_damping"]) == "0.15 (at its bound)"


def test_a_fit_that_comes_to_the_end_of_its_branch_says_so(rattle) -> None:
    """The branch of double-sided impacts ends at mean.q1 = 0.2888, and the record is of a motion beyond."""
    beyond = gw.find_orbit(rattle.system.at({"mean.q1": 0.6}))
    found = gw.measure.fit(rattle, record_of(beyond, seed=7), ["mean.q1"], "q1''", phase=PHASE)
    if found["mean.q1"].value > 0.28:
        assert "no minimum: the fit reached the end of the branch of this motion" in found.failures[0]
    assert found["mean.q1"].value < 0.289


def test_a_model_that_lacks_something_leaves_more_than_noise(rattle) -> None:
    found = gw.measure.fit(
        rattle, record_of(gw.find_orbit(rattle.system.at({"stage2.stiffness": 1.1})), seed=8), ["mean.q1"], "q1''"
    )
    assert any("neighbouring residuals correlate" in text for text in found.notes)
    clean = gw.measure.fit(rattle, record_of(rattle, seed=8), ["mean.q1"], "q1''")
    assert clean.notes == ()


def test_a_fit_of_another_motion_ends_and_is_doubted(rattle) -> None:
    """The guess never opens its contact: the clearance changes nothing, and no load makes it rattle on this branch."""
    closed = gw.find_orbit(rattle.system.at({**GUESS, "mean.q1": 0.9}))
    assert closed.pattern == "closed+"
    found = gw.measure.fit(closed, record_of(rattle, seed=10), NAMES, "q1''")
    assert found.failures == ("the record does not determine stage2.clearance: it changes nothing in this signal",)
    assert found["stage2.clearance"].value == 0.8
    assert any("record and motion hardly correlate" in text for text in found.notes)
    assert (
        gw.measure.align(closed, found.after.record, "q1''").doubts[0].startswith("record and motion hardly correlate")
    )


def test_an_unstable_motion_is_doubted(rattle) -> None:
    """Between the Neimark-Sacker points of its branch at mean.q1 = 0.255 and 0.287."""
    orbit = carry(rattle, rattle.system.at({"mean.q1": 0.27}))
    assert not orbit.stable
    assert (
        "unstable, so it is probably not the measured one" in gw.measure.align(orbit, record_of(orbit), "q1").doubts[0]
    )


def test_requests_that_make_no_sense_are_refused(rattle) -> None:
    record = record_of(rattle)
    with pytest.raises(ModelError, match=r"no parameter 'stage2\.gap'"):
        gw.measure.fit(rattle, record, ["stage2.gap"], "q1''")
    with pytest.raises(ModelError, match=r"mean\.q1 is listed twice; name it once"):
        gw.measure.fit(rattle, record, ["mean.q1", "mean.q1"], "q1''")
    with pytest.raises(ModelError, match=r"mean\.q1 begins at 0\.05, which does not lie between its bounds 0\.1 and 1"):
        gw.measure.fit(rattle, record, ["mean.q1"], "q1''", bounds={"mean.q1": (0.1, 1.0)})
    with pytest.raises(ModelError, match=r"bounds for mean\.q3, which is not fitted"):
        gw.measure.fit(rattle, record, ["mean.q1"], "q1''", bounds={"mean.q3": (0.0, 1.0)})
    with pytest.raises(ModelError, match="parameters is empty"):
        gw.measure.fit(rattle, record, [], "q1''", phase=0.0)
    with pytest.raises(ModelError, match="max_evaluations is 0"):
        gw.measure.FitOptions(0)
    with pytest.raises(ConvergenceError, match="no minimum was found with 1 orbits"):
        gw.measure.fit(
            rattle, record_of(gw.find_orbit(rattle.system.at(GUESS))), NAMES, "q1''", options=gw.measure.FitOptions(1)
        )
    with pytest.raises(ModelError, match=r"mean\.q3 was not fitted; the fit has mean\.q1"):
        _ = gw.measure.fit(rattle, record, ["mean.q1"], "q1''")["mean.q3"]


def test_a_linear_fit_is_the_one_of_the_books() -> None:
    """The amplitude of a load on a linear system: value and error of a regression by hand."""
    orbit = gw.find_orbit(linear())
    record = record_of(orbit, "a''", seed=9, periods=5.2)
    found = gw.measure.fit(orbit, record, ["harmonic3.amplitude"], "a''", phase=PHASE)
    system, w = orbit.system, orbit.system.frequency
    M, C, K = (system.matrix(which) for which in ("mass", "damping", "stiffness"))

    def line(order: int, load):
        factor = np.linalg.solve(K - (order * w) ** 2 * M + 1j * order * w * C, load)[0]
        return np.real(-((order * w) ** 2) * factor * np.exp(1j * order * theta))

    theta = found.after.theta
    known, unit = line(1, np.array([0.7, -0.28]) * np.exp(0.3j)), line(3, np.array([0.0, 1.0]))
    unit, rest = unit - unit.mean(), found.after.measured - (known - known.mean())
    value = unit @ rest / (unit @ unit)
    left = rest - value * unit
    assert found["harmonic3.amplitude"].value == pytest.approx(value, rel=1e-7)
    error = np.sqrt(left @ left / (len(left) - 2) / (unit @ unit))
    assert found["harmonic3.amplitude"].error == pytest.approx(error, rel=1e-6)

"""The figures of the paper as data: each is there, and rests on jobs that exist."""

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.motion.forces import accelerations
from reproductions.padmanabhan_singh_1995.claims import CLAIMS
from reproductions.padmanabhan_singh_1995.figure import FigureKind, View
from reproductions.padmanabhan_singh_1995.figures import FIGURES, find_figure
from reproductions.padmanabhan_singh_1995.job import PERIOD_1, BalanceJob, BranchJob, MotionJob
from reproductions.padmanabhan_singh_1995.jobs import JOBS, find_job
from reproductions.padmanabhan_singh_1995.reading import AS_PRINTED, LITERAL, USUAL, Reading

READINGS = (USUAL, LITERAL, AS_PRINTED)


def test_every_figure_of_the_paper_that_shows_results_is_there_once() -> None:
    assert [figure.name for figure in FIGURES] == ["1", *(str(number) for number in range(3, 30))]
    assert all(figure.panels for figure in FIGURES)


def test_panels_have_the_letters_of_the_paper_once_each() -> None:
    for figure in FIGURES:
        letters = [panel.letter for panel in figure.panels if panel.letter]
        assert letters == sorted(set(letters))


@pytest.mark.parametrize("reading", READINGS, ids=str)
def test_every_job_of_a_figure_makes_a_study_in_every_reading(reading: Reading) -> None:
    for figure in FIGURES:
        for key in figure.at(reading).jobs:
            job = find_job(key)
            assert (job.key, job.reading) == (key, reading.of_case(job.case))
            study = job.study
            assert str(job.reading) in study.title
            asked = reading.system(job.case).at(dict(job.changes)).at(job.begin)
            assert np.array_equal(rates(study.system), rates(asked))


def rates(system: gw.System) -> np.ndarray:
    """Accelerations at some states, far on both sides of the gap too: two readings that agree in them are the same."""
    q, v = np.random.default_rng(5).normal(scale=3.0, size=(2, 40, 2))
    return accelerations(layout_of(system.structure), coefficients_of(system), np.linspace(0.0, 6.0, 40), q, v)


def test_a_reading_that_changes_nothing_is_the_default_one() -> None:
    assert find_job("4a").at(LITERAL).key == "4a"  # no first stage
    assert find_job("4b").at(AS_PRINTED).key == "4b"  # no impact damping
    assert find_job("4a").at(AS_PRINTED).key == "4a-as-printed"
    assert find_job("12").at(Reading.of("literal", "as-printed")).key == "12-literal-as-printed"


def test_a_job_without_longer_periods() -> None:
    job = find_job("24-period-1-literal")
    assert isinstance(job, BranchJob)
    assert (job.key, job.max_period, job.case, job.reading) == ("24-period-1-literal", 1, "24", LITERAL)
    with pytest.raises(ModelError, match="no job"):
        find_job("17-period-1")  # a motion, not a branch


def test_a_job_has_its_changes_and_begins_where_it_says() -> None:
    for job in JOBS.values():
        system = job.study.system
        assert all(system[name] == value for name, value in {**dict(job.changes), **job.begin}.items())
        if isinstance(job, BranchJob):
            assert system[job.parameter] == job.begins
            assert job.study.walked.end == job.ends
        else:
            assert isinstance(job, MotionJob | BalanceJob)


def test_views_fit_their_jobs() -> None:
    for figure in FIGURES:
        for panel in figure.panels:
            kinds = KINDS.get(panel.view, (BranchJob,))
            assert tuple(type(find_job(key)) for key in panel.jobs) == kinds * (len(panel.jobs) // max(1, len(kinds)))
            named = panel.view in (View.OVERLAY, View.CONTRAST, View.HYSTERESIS)
            assert len(panel.names) == ((len(panel.jobs) or 1) if named else 0)
            assert bool(panel.signal) == (panel.view is View.CONTRAST)
        assert (figure.kind is FigureKind.MOTION) == any(panel.view is View.MOTION for panel in figure.panels)


KINDS = {
    View.MOTION: (MotionJob,),
    View.CONTRAST: (MotionJob, MotionJob),
    View.RECORD: (MotionJob, MotionJob),
    View.BALANCE: (BranchJob, BalanceJob),
    View.HYSTERESIS: (),
}


def test_no_job_is_idle() -> None:
    used = {find_job(key).at(USUAL).key for figure in FIGURES for key in figure.jobs}
    used |= {find_job(key).at(USUAL).key.removesuffix(PERIOD_1) for claim in CLAIMS for key in claim.jobs}
    assert used == set(JOBS)


@pytest.mark.parametrize(
    ("given", "name"),
    [("13", "13"), ("Figure 20", "20"), ("fig. 20(A)", "20a"), ("20b", "20b"), ("1", "1"), (" 27 ", "27")],
)
def test_what_a_name_stands_for(given: str, name: str) -> None:
    assert find_figure(given).name == name


def test_a_part_has_one_panel_and_its_jobs_only() -> None:
    part = find_figure("20b")
    assert [panel.letter for panel in part.panels] == ["b"]
    assert part.jobs == ("20b",)
    assert part.file_name == "figure-20b"
    assert part.number == 20


@pytest.mark.parametrize("name", ["2", "30", "", ".*", "20c", "13x"])
def test_an_unknown_figure_is_refused(name: str) -> None:
    with pytest.raises(ModelError, match="the paper has no figure"):
        find_figure(name)


@pytest.mark.parametrize("key", ["", "12-", "12-steep", "99", "12-literal-literal"])
def test_an_unknown_job_is_refused(key: str) -> None:
    with pytest.raises(ModelError, match="the paper has no job"):
        find_job(key)


def test_files_tell_the_reading() -> None:
    assert find_figure("12").file_name == "figure-12"
    assert find_figure("12").at(LITERAL).file_name == "figure-12-literal"
    assert find_figure("12").at(Reading.of("literal", "as-printed")).jobs == ("12-literal-as-printed",)
    assert find_job("12-literal-as-printed").reading == Reading.of("literal", "as-printed")

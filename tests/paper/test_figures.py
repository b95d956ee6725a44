"""The figures of the paper as data: each is there, and rests on jobs that exist."""

import pytest

from gapwalk.errors import ModelError
from gapwalk.paper.claims import CLAIMS
from gapwalk.paper.figure import FigureKind, View
from gapwalk.paper.figures import FIGURES, find_figure
from gapwalk.paper.job import BranchJob, MotionJob
from gapwalk.paper.jobs import JOBS, find_job
from gapwalk.paper.reading import AS_PRINTED, LITERAL, USUAL, Reading

READINGS = (USUAL, LITERAL, AS_PRINTED)


def test_every_figure_of_the_paper_that_shows_results_is_there_once() -> None:
    assert [figure.name for figure in FIGURES] == ["1", *(str(number) for number in range(3, 30))]
    assert all(figure.panels for figure in FIGURES if figure.drawn)
    assert not any(figure.panels for figure in FIGURES if not figure.drawn)


def test_panels_have_the_letters_of_the_paper_once_each() -> None:
    for figure in FIGURES:
        letters = [panel.letter for panel in figure.panels if panel.letter]
        assert letters == sorted(set(letters))


@pytest.mark.parametrize("reading", READINGS, ids=str)
def test_every_job_of_a_figure_makes_a_study_in_every_reading(reading: Reading) -> None:
    for figure in FIGURES:
        for key in figure.at(reading).jobs:
            job = find_job(key)
            assert (job.key, job.reading) == (key, reading)
            study = job.study
            assert str(reading) in study.title
            assert study.system["stage2.stiffness"] == reading.system(job.case)["stage2.stiffness"]


def test_a_job_has_its_changes_and_begins_where_it_says() -> None:
    for job in JOBS.values():
        system = job.study.system
        assert all(system[name] == value for name, value in {**dict(job.changes), **job.begin}.items())
        if isinstance(job, BranchJob):
            assert system[job.parameter] == job.begins
            assert job.study.walked.end == job.ends
        else:
            assert isinstance(job, MotionJob)


def test_views_fit_their_jobs() -> None:
    for figure in FIGURES:
        for panel in figure.panels:
            kind = MotionJob if panel.view is View.MOTION else BranchJob
            assert all(isinstance(find_job(key), kind) for key in panel.jobs)
            assert len(panel.names) == (len(panel.jobs) if panel.view is View.OVERLAY else 0)
        assert (figure.kind is FigureKind.MOTION) == any(panel.view is View.MOTION for panel in figure.panels)


def test_no_job_is_idle() -> None:
    used = {find_job(key).at(USUAL).key for figure in FIGURES for key in figure.jobs}
    used |= {find_job(key).at(USUAL).key for claim in CLAIMS for key in claim.jobs}
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

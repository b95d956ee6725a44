"""The figures of the paper as data: each is there, and rests on jobs that exist."""

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.flow.forces import accelerations
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.studies.settle_study import SettleStudyOptions
from reproductions.padmanabhan_singh_1995.claims import CLAIMS
from reproductions.padmanabhan_singh_1995.claims.second_reading import CANDIDATES, EXPLANATIONS
from reproductions.padmanabhan_singh_1995.figures import FIGURES, find_figure
from reproductions.padmanabhan_singh_1995.jobs import AS_PRINTED, CHANGES, JOBS, LITERAL, USUAL, Reading
from reproductions.padmanabhan_singh_1995.panels import (
    Balance,
    History,
    Hysteresis,
    Loops,
    Machine,
    Motion,
    Overlay,
    Response,
    Torque,
)
from reproductions.padmanabhan_singh_1995.today import TODAY

READINGS = (USUAL, LITERAL, AS_PRINTED)
OTHER = Reading(gw.paper.SlopeReading.LITERAL, gw.paper.DampingReading.AS_PRINTED)


def test_every_figure_of_the_paper_is_there_once() -> None:
    assert [figure.name for figure in FIGURES] == [str(number) for number in range(1, 30)]
    assert all(figure.panels for figure in (*FIGURES, *TODAY))


def test_panels_have_the_letters_of_the_paper_once_each() -> None:
    for figure in FIGURES:
        letters = [panel.letter for panel in figure.panels if panel.letter]
        assert letters == sorted(set(letters))


@pytest.mark.parametrize("reading", READINGS, ids=str)
def test_every_job_of_a_figure_makes_a_study_in_every_reading(reading: Reading) -> None:
    for figure in (figure.at(reading) for figure in FIGURES):
        for job in (job for panel in figure.panels if panel.reading is None for job in figure.jobs_of(panel)):
            assert job.reading == reading.of_case(job.case)
            study = job.study
            assert str(job.reading) in study.title
            asked = gw.paper.case(job.case, slope=reading.slope, damping=reading.damping).at(job.changes)
            if not isinstance(job.options, SettleStudyOptions):
                asked = asked.at({job.options.parameter: job.options.begin})
            assert np.array_equal(rates(study.system), rates(asked))


def rates(system: gw.System) -> np.ndarray:
    """Accelerations at some states, far on both sides of the gap too: two readings that agree in them are the same."""
    q, v = np.random.default_rng(5).normal(scale=3.0, size=(2, 40, 2))
    return accelerations(layout_of(system.structure), coefficients_of(system), np.linspace(0.0, 6.0, 40), q, v)


def test_a_reading_that_changes_nothing_is_the_default_one() -> None:
    assert JOBS["4a"].at(LITERAL).key == "4a"  # no first stage
    assert JOBS["4b"].at(AS_PRINTED).key == "4b"  # no impact damping
    assert JOBS["4a"].at(AS_PRINTED).key == "4a-as-printed"
    assert JOBS["12"].at(OTHER).key == "12-literal-as-printed"


def test_a_job_without_longer_periods() -> None:
    job = JOBS["13"].at(LITERAL).shortest
    assert (job.key, job.options.max_period, job.case) == ("13-period-1-literal", 1, "13")
    assert job.reading == LITERAL
    assert JOBS["17"].shortest is JOBS["17"]  # a motion, not a branch
    assert JOBS["24"].shortest is JOBS["24"]  # it has no longer periods


def test_a_job_has_its_changes_and_begins_where_it_says() -> None:
    for key, job in JOBS.items():
        system, options = job.study.system, job.options
        begin = {} if isinstance(options, SettleStudyOptions) else {options.parameter: options.begin}
        assert all(system[name] == value for name, value in {**job.changes, **begin}.items())
        assert key == job.key
    assert len({job.key for job in JOBS.values()}) == len(JOBS)


KINDS = {
    Balance: ["diagram", "response"],
    Hysteresis: [],
    Machine: [],
    Torque: [],
    Motion: ["settle"],
    Overlay: ["diagram"],
    Response: ["diagram"],
    Loops: ["diagram"],
}
SEVERAL = (Motion, Overlay)


def test_panels_fit_their_jobs() -> None:
    files = []
    for figure in (*FIGURES, *TODAY):
        for panel in figure.panels:
            kind = next(kind for kind in KINDS if isinstance(panel, kind))
            found = [job.options.kind for job in figure.jobs_of(panel)]
            assert found == KINDS[kind] * (len(found) if isinstance(panel, SEVERAL) else 1)
            assert len(panel.names) in (0, len(panel.jobs))
            assert panel.names or len(panel.jobs) < 2 or isinstance(panel, Balance)
            files.append(figure.file_name(panel))
    assert len(set(files)) == len(files)


def test_what_the_paper_says_lies_in_the_picture_of_it() -> None:
    """Facts are ranges of the axis that a panel shows, in the paper's own numbers."""
    facts = [(panel, fact) for figure in FIGURES for panel in figure.panels for fact in panel.facts]
    assert {(fact.low, fact.high) for _, fact in facts} >= {(0.62, 0.85), (0.3, 0.45), (0.5, 0.7), (0.15, 0.25)}
    for panel, fact in facts:
        if panel.within and not fact.of_peak:
            assert panel.within[0] <= fact.low <= (fact.high or fact.low) <= panel.within[1]


def test_a_panel_says_at_which_numbers_it_is_drawn() -> None:
    by_place = {panel.place for panel in find_figure("4").panels}
    assert by_place == {"", JOBS["4a"].at(CHANGES["matched"]).reading.differs}
    (mended,) = [panel for panel in find_figure("11").panels if panel.letter == "b"]
    assert "K12 = 0.36" in mended.place
    assert all(panel.reading is None for panel in find_figure("12").at(LITERAL).panels)


def test_figure_8_has_no_record() -> None:
    """The measured one is lost, and another one would not show what the paper's figure shows."""
    figure = find_figure("8")
    assert "lost" in figure.caption
    assert all(isinstance(panel, History) and panel.signal == "u3''" for panel in figure.panels)


def test_no_job_is_idle() -> None:
    used = {key for figure in (*FIGURES, *TODAY) for panel in figure.panels for key in panel.jobs}
    used |= {key for claim in CLAIMS for key in (*claim.rests_on, *claim.elsewhere)}
    used |= {key for candidate in CANDIDATES for keys in candidate.jobs.values() for key in keys}
    used |= {key for explanation in EXPLANATIONS.values() for key in explanation.rests_on}
    assert used == set(JOBS)


@pytest.mark.parametrize(
    ("given", "name"),
    [("13", "13"), ("Figure 20", "20"), ("fig. 20(A)", "20a"), ("20b", "20b"), ("2", "2"), (" 27 ", "27")],
)
def test_what_a_name_stands_for(given: str, name: str) -> None:
    assert find_figure(given).name == name


def test_a_part_has_one_panel_and_its_jobs_only() -> None:
    part = find_figure("20b")
    assert [panel.letter for panel in part.panels] == ["b"]
    assert part.jobs == (JOBS["20b"],)
    assert part.file_name(part.panels[0]) == "figure-20b.png"
    assert part.number == 20


@pytest.mark.parametrize("name", ["0", "30", "", ".*", "20c", "13x"])
def test_an_unknown_figure_is_refused(name: str) -> None:
    with pytest.raises(gw.errors.ModelError, match="the paper has no figure"):
        find_figure(name)


def test_a_near_name_is_offered() -> None:
    with pytest.raises(gw.errors.ModelError, match=r"did you mean .*20a"):
        find_figure("20c")


def test_files_name_the_reading() -> None:
    figure = find_figure("12")
    assert [figure.file_name(panel) for panel in figure.panels][:2] == ["figure-12a.png", "figure-12-2.png"]
    literal, other = figure.at(LITERAL), figure.at(OTHER)
    assert literal.file_name(literal.panels[0]) == "figure-12a-literal.png"
    assert other.file_name(other.panels[0]) == "figure-12a-literal-as-printed.png"
    assert [job.key for job in find_figure("12").at(OTHER).jobs] == ["12-literal-as-printed"]
    assert OTHER.differs == "slope literal, damping as printed"

"""The frequency responses of the paper as studies."""

import pytest

from gapwalk.errors import ModelError
from gapwalk.paper import frequency_responses, names
from gapwalk.paper.figure import figure_document, figure_names, figure_study, walk_figure


@pytest.mark.parametrize(
    ("name", "figures"),
    [
        ("13", ("13",)),
        ("Figure 20(A)", ("20a",)),
        ("fig. 4b", ("4b",)),
        ("20", ("20a", "20b")),
        ("3", ("3-impact", "3-viscous")),
        ("2", None),
        ("99", None),
        ("", None),
        (".*", None),
        ("20c", None),
    ],
)
def test_what_a_name_stands_for(name, figures) -> None:
    if figures is None:
        with pytest.raises(ModelError, match="no figure"):
            figure_names(name)
    else:
        assert figure_names(name) == figures


def test_every_name_stands_for_itself() -> None:
    for name in names():
        assert figure_names(name) == (name,)


def test_every_response_begins_at_2_and_ends_at_015() -> None:
    for name in frequency_responses():
        study = figure_study(name)
        assert study.system.frequency == study.options.begin == 2.0
        assert study.options.end == 0.15


def test_what_is_no_response_is_refused() -> None:
    with pytest.raises(ModelError, match="figure 17 is no frequency response over W"):
        walk_figure("17")
    with pytest.raises(ModelError, match="slope is 'steep'"):
        walk_figure("13", slope="steep")


def test_a_figure_names_its_reading(tmp_path) -> None:
    path = tmp_path / "12.gapwalk"
    for _ in range(2):  # the second time over the first
        result = walk_figure("12", slope="literal", output=path)
    document = figure_document("12", result, slope="literal", damping="dissipative")
    assert document["reading"] == {"slope": "literal", "damping": "dissipative"}
    assert "slope literal" in document["title"]
    assert path.is_file()

"""What a notebook shows, in a real kernel: cards of values, and lines of progress that vanish."""

import base64
import os
import struct

import nbclient
import nbformat
import pytest

import gapwalk as gw
from gapwalk.notebook import Line, is_notebook, show_progress

SYSTEM = """
import gapwalk as gw
import gapwalk.notebook as progress

progress._QUIET = 0.0
system = gw.System(
    ["x"],
    stiffness=[[1.0]],
    damping=[[0.1]],
    contacts=[gw.stop("stop", {"x": 1.0}, clearance=1.0, stiffness=20.0, impact_damping=0.2)],
    harmonics=[gw.Harmonic(0.5, {"x": 1.0})],
    frequency=0.7,
)
orbit = gw.find_orbit(system)
"""
CELLS = {
    "begin": SYSTEM,
    "system": "system",
    "follow": 'branch = gw.follow(orbit, "frequency", to=1.6)',
    "branch": "branch",
    "special": "branch.special_points[0]",
    "orbit": "orbit",
    "own": 'branch = gw.follow(orbit, "frequency", to=0.8, report=lambda *_: None)',
    "picture": """
%config InlineBackend.rc = {"lines.linewidth": 3.0, "font.size": 12.5}
branch.plot("max.x");
""",
    "settings": """
import matplotlib as mpl
print(mpl.is_interactive(), mpl.rcParams["lines.linewidth"], mpl.rcParams["font.size"])
""",
    "another": 'branch.plot("max.x", size="column");',
    "of the user": """
import matplotlib.pyplot as plt
plt.plot([0.0, 1.0], [0.0, 1.0]);
""",
    "motion": 'gw.settle(system).plot("x");',
    "off": 'gw.parallel.show_progress(False)\nbranch = gw.follow(orbit, "frequency", to=0.8)',
}


@pytest.fixture(scope="module")
def outputs() -> dict[str, list]:
    """The outputs of each cell."""
    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(text) for text in CELLS.values()])
    client = nbclient.NotebookClient(book, timeout=300, kernel_name="python3")
    client.execute(env={name: value for name, value in os.environ.items() if name != "MPLBACKEND"})
    return {name: cell.outputs for name, cell in zip(CELLS, book.cells, strict=True)}


def shown(outputs: list) -> str:
    (output,) = outputs
    return output["data"]["text/html"]


def test_values_show_their_cards(outputs) -> None:
    assert "<b>System</b>" in shown(outputs["system"])
    assert "stop" in shown(outputs["system"])
    card = shown(outputs["branch"])
    assert "<b>Branch</b>" in card
    assert "2 grazing" in card
    assert "<div>at " in shown(outputs["special"])
    for name in ("branch", "orbit"):
        data = base64.b64decode(shown(outputs[name]).partition("base64,")[2].partition('"')[0])
        width, height = struct.unpack(">II", data[16:24])
        assert data[:4] == b"\x89PNG"
        assert (width, height) == (498, 313)


def test_every_picture_is_shown_and_so_are_those_of_the_user(outputs) -> None:
    """The first one loads what shows figures in a notebook; the settings which that makes must stay."""
    for name in ("picture", "another", "of the user", "motion"):
        (output,) = outputs[name]
        assert "image/png" in output["data"], name
    (output,) = outputs["settings"]
    assert output["text"] == "True 3.0 12.5\n"


def test_progress_was_shown_and_has_vanished(outputs) -> None:
    (line,) = outputs["follow"]
    assert line["data"]["text/html"] == ""


def test_progress_can_be_turned_off(outputs) -> None:
    assert outputs["own"] == []
    assert outputs["off"] == []


def test_a_line_changes_four_times_a_second_at_most(monkeypatch) -> None:
    now = [0.0]
    monkeypatch.setattr("gapwalk.notebook.time.monotonic", lambda: now[0])
    texts: list[str] = []
    line = Line("follow", lambda count: f"{count} points")
    monkeypatch.setattr(line, "_put", texts.append)
    for step in range(301):
        now[0] = step / 100.0
        line()
    assert len(texts) == 11  # of three seconds without the first half
    assert texts[0] == "follow: 51 points, 0 s"
    assert texts[-1] == "follow: 301 points, 3 s"


def test_elsewhere_nothing_is_shown() -> None:
    assert not is_notebook()
    show_progress()  # it is on anyway


def test_texts_are_escaped(tmp_path) -> None:
    study = tmp_path / "model.toml"
    study.write_text(
        'title = "<img src=x>"\ncoordinates = ["x"]\nstiffness = [1.0]\ndamping = [0.1]\nfrequency = 2.0\n'
        "[[harmonic]]\namplitude = 0.5\nacts_on = { x = 1.0 }\n"
        '[study]\nkind = "response"\nparameter = "frequency"\nfrom = 2.0\nto = 2.1\n'
    )
    card = gw.run(gw.read_study(study))._repr_html_()
    assert "<img src=x>" not in card
    assert "&lt;img src=x&gt;" in card

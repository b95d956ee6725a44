"""Studies and analyses of systems with friction and rigid stops: what each of them computes, or refuses by name."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.attractors.basins import IMPOSSIBLE
from gapwalk.attractors.compare_motions import contrast
from gapwalk.bifurcation.isolated.search_starts import spread_starts, state_box
from gapwalk.cli.output import print_json
from gapwalk.ensemble import BatchOptions, batch_flow_of
from gapwalk.errors import ModelError, UnfitError

BRAKE = gw.friction("brake", {"x": 1.0}, 0.3)
WALL = gw.rigid_stop("wall", {"x": 1.0}, 1.0, 0.6)


def oscillator(*contacts: gw.Contact) -> gw.System:
    load = gw.Harmonic(1.0, {"x": 1.0})
    return gw.System(["x"], [[1.0]], [[0.1]], contacts=contacts, mean={"x": 0.1}, harmonics=[load], frequency=1.2)


@pytest.fixture(scope="module")
def struck() -> gw.Orbit:
    """An orbit with one impact in each period."""
    return gw.find_orbit(oscillator(WALL))


def test_basins_of_what_the_batch_integrator_refuses_are_those_of_the_exact_flow() -> None:
    system = oscillator(BRAKE, WALL)
    with pytest.raises(UnfitError, match="'brake': it sticks rigidly"):
        batch_flow_of(system, BatchOptions(steps=64)).run(np.zeros((2, 2)), 1)
    options = {"workers": 1, "check": 1}
    found = gw.basins(system, {"x": (-2.0, 2.0), "x'": (-1.0, 1.0)}, (4, 1), **options)
    assert found.labels[0].tolist() == [0, 0, 0, IMPOSSIBLE]  # x = 1.5 is beyond the wall
    assert (found.impossible, found.runaway, found.unresolved, found.error) == (1, 0, 0, 0.0)
    assert "beyond a rigid stop: 1" in repr(found)
    with pytest.raises(ModelError, match="all states are beyond rigid stops"):
        gw.basins(system, {"x": (1.5, 2.0), "x'": (-1.0, 1.0)}, 2, **options)


def test_starts_are_within_rigid_stops() -> None:
    system = oscillator(WALL)
    starts = spread_starts([system], state_box(system), 16, seed=0, value=1.2)
    assert starts.shape == (16, 2)
    assert starts[:, 0].max() <= 1.0 + 0.01 * (1.0 + np.abs(starts[:, 0]).max())
    free = spread_starts([oscillator()], state_box(system), 16, seed=0, value=1.2)
    assert (free[:, 0] > 1.1).any()  # the box is wider than the gap


def test_lines_of_accelerations_and_forces_include_the_impulses(struck: gw.Orbit) -> None:
    position, acceleration, force = (gw.analysis.spectrum(struck, name).values for name in ("x", "x''", "wall.force"))
    rate = 1.2j * np.arange(8)
    assert acceleration[:8] == pytest.approx(rate**2 * position[:8], abs=1e-5)
    loads = np.array([0.1, 1.0, *np.zeros(6)])
    assert force[:8] == pytest.approx(loads - (rate**2 + 0.1 * rate + 1.0) * position[:8], abs=1e-5)


def test_impulses_make_peaks_and_rms_infinite(struck: gw.Orbit) -> None:
    assert [struck.measure(name) for name in ("rms.x''", "min.x''", "max.wall.force")] == [
        math.inf,
        -math.inf,
        math.inf,
    ]
    assert math.isfinite(struck.measure("max.x''"))  # the impulses act the other way
    assert struck.measure("mean.wall.force") == pytest.approx(0.1 - struck.measure("mean.x"), abs=1e-9)
    assert struck.measure("h1.x''") == pytest.approx(1.2**2 * struck.measure("h1.x"), rel=2e-3)
    found = gw.analysis.rattle(struck)
    assert all(map(math.isnan, (found.index, found.contacts[0].peak, found.contacts[0].rms)))  # impulses have none
    record = gw.measure.Record(np.linspace(0.0, 50.0, 2000), np.sin(1.2 * np.linspace(0.0, 50.0, 2000)))
    with pytest.raises(ModelError, match="infinite where a rigid stop strikes"):
        gw.measure.align(struck, record, "x''")


def test_signals_that_vanish_agree() -> None:
    orbit = gw.find_orbit(oscillator(gw.rigid_stop("wall", {"x": 1.0}, 9.0, 0.6)))
    assert {pair.agreement.relative for pair in contrast(orbit, orbit).pairs if pair.agreement} == {0.0}


def test_documents_are_json_where_numbers_are_not_finite(capsys: pytest.CaptureFixture[str]) -> None:
    print_json({"closed": math.nan, "peak": math.inf, "list": [1.0, (-math.inf,)]})
    assert json.loads(capsys.readouterr().out) == {"closed": None, "peak": None, "list": [1.0, [None]]}


def test_a_family_of_motions_with_extensions_has_tables(tmp_path: Path) -> None:
    file = tmp_path / "model.toml"
    file.write_text("""
        coordinates = ["x"]
        stiffness = [1.0]
        damping = [0.1]
        friction = [{ name = "brake", deflection = { x = 1.0 }, limit = 0.3, stiffness = 5.0 }]
        harmonic = [{ order = 1, amplitude = 1.0, acts_on = { x = 1.0 } }]
        [study]
        kind = "family"
        parameter = "frequency"
        from = 1.5
        to = 1.45
        over = { "brake.limit" = [0.2, 0.3] }
        workers = 1
    """)
    points = gw.run(gw.read_study(file)).tables()["points"]()
    assert "brake.extension(0)" in next(iter(points))

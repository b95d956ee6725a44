"""The machines as model files of at most 25 lines, beside orbits that SciPy found."""

import json
from pathlib import Path

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model.coefficients import ParameterLine
from tests.machines.equations import MACHINES
from tests.models import read_system

HERE = Path(__file__).parent
ORBITS = json.loads((HERE / "references.json").read_text(encoding="utf-8"))["orbits"]
_FORCE = {"F": "harmonic1.amplitude"}
LONG = {
    "duffing": _FORCE | {"c": "damping.x.x"},
    "truss": {"G": "harmonic1.amplitude"},
    "geometric": _FORCE,
    "mathieu_stop": _FORCE,
}
CASES = [(name, number) for name, orbits in ORBITS.items() for number in range(len(orbits))]


def posed(name: str, number: int):
    """The system of one reference orbit; parameters that differ from those of the file have its names."""
    reference = ORBITS[name][number]
    system, usual = read_system(HERE / f"{name}.toml"), MACHINES[name].parameters
    changes: dict[str, float] = {"frequency": reference["frequency"]}
    for key, value in reference["parameters"].items():
        if value != usual[key]:
            changes[LONG[name].get(key, f"spring.{key}")] = value
    return system.at(changes), reference


@pytest.mark.parametrize(("name", "number"), CASES, ids=[f"{name}-{number}" for name, number in CASES])
def test_an_orbit_is_that_of_scipy(name: str, number: int) -> None:
    system, reference = posed(name, number)
    state, cycles = np.array(reference["state"]), reference["cycles"]
    orbit = gw.find_orbit(system, start=state, period=cycles)
    size = 1.0 + np.abs(state).max()
    assert orbit.state == pytest.approx(state, abs=1e-10 * size)
    assert orbit.period == cycles
    if reference.get("multipliers"):
        wanted = np.array([complex(*each) for each in reference["multipliers"]])
        found = np.sort_complex(np.round(orbit.multipliers, 9)), np.sort_complex(np.round(wanted, 9))
        assert found[0] == pytest.approx(found[1], abs=1e-8 * (1.0 + np.abs(wanted).max()))
    if reference.get("slope_by_frequency"):
        line = ParameterLine(system, "frequency")
        flow, (coefficients, direction) = (
            flow_of(system, "frequency", transition=True),
            line.coefficients(system.frequency),
        )
        arc = flow.integrate(coefficients, orbit.state, 0.0, PERIOD * cycles, direction)
        slope = np.linalg.solve(np.eye(len(state)) - arc.transition, arc.sensitivity)
        wanted = np.array(reference["slope_by_frequency"])
        assert slope == pytest.approx(wanted, abs=1e-8 * (1.0 + np.abs(wanted).max()))
    extremes = orbit.extremes[:, :2].T
    assert extremes == pytest.approx(np.array([reference["max"], reference["min"]]), abs=1e-9 * size)

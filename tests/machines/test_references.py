"""The references of the machines agree with closed forms, with each other, and with what other programs print."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from tests.machines import closed_forms
from tests.machines.equations import MACHINES
from tests.machines.shooting import find, integrate

HERE = Path(__file__).parent
REFERENCES = json.loads((HERE / "references.json").read_text(encoding="utf-8"))
ORBITS, OTHERS = REFERENCES["orbits"], REFERENCES["others"]


@pytest.mark.parametrize("file", sorted(HERE.glob("*.toml")), ids=lambda file: file.stem)
def test_a_model_has_at_most_25_lines_and_references(file):
    text = file.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 25
    frequencies = [orbit["frequency"] for orbit in ORBITS.get(file.stem) or OTHERS[file.stem]]
    assert len(frequencies) >= 3
    assert tomllib.loads(text)["frequency"] in frequencies


def test_all_orbits_are_exact_to_rounding():
    for name, orbits in ORBITS.items():
        assert len(orbits) >= 3, name
        assert max(max(orbit["gap"], orbit["error"]) for orbit in orbits) < 1e-12, name


def test_motions_without_contact_are_the_linear_responses():
    for orbit in ORBITS["base"][:2]:
        w = orbit["frequency"]
        assert orbit["switches"] == 0
        assert orbit["state"] == pytest.approx(closed_forms.base_response(w)["state"], abs=1e-13)
    orbit = ORBITS["rotor_stop"][0]
    assert orbit["state"] == pytest.approx(closed_forms.rotor_response(0.6), abs=1e-13)


def test_transmission_error_and_its_inertia_load_give_one_motion():
    for error, load in zip(ORBITS["gear_error"], ORBITS["gear_load"], strict=True):
        assert np.subtract(error["state"], load["state"]) == pytest.approx([0.05, 0.0], abs=1e-13)
        assert error["slope_by_frequency"] == pytest.approx(load["slope_by_frequency"], abs=1e-11)
        assert error["multipliers"] == pytest.approx(np.array(load["multipliers"]), abs=1e-12)


@pytest.mark.slow
def test_sensitivity_to_the_frequency_equals_central_differences():
    machine, orbit, step = MACHINES["gear_rectangle"], ORBITS["gear_rectangle"][1], 1e-3
    shifts = np.array([-2, -1, 1, 2])
    states = np.array([find(machine, orbit["frequency"] + s * step, orbit["state"])[0] for s in shifts])
    slope = np.array([1, -8, 8, -1]) @ states / (12 * step)
    assert slope == pytest.approx(orbit["slope_by_frequency"], abs=1e-9)


@pytest.mark.parametrize(("key", "sign"), [("mathieu_flips", -1), ("mathieu_folds", 1)])
def test_edges_of_hills_determinant_have_a_multiplier_one(key, sign):
    machine = MACHINES["mathieu"]
    for pair, frequencies in OTHERS["closed_forms"][key].items():
        e, z = (float(part.split("=")[1]) for part in pair.split(", "))
        for w in frequencies:
            p = machine.parameters | {"e": e, "z": z, "F": 0.0}
            matrix = integrate(machine, [0.0, 0.0], w, p).transition
            assert 1 - sign * np.trace(matrix) + np.linalg.det(matrix) == pytest.approx(0, abs=1e-13)


def test_flips_of_mathieu_are_characteristic_values():
    # with 2 tau = W t: a = 4 / W^2 and q = -2 e / W^2, and -q gives the same edges with a and b exchanged
    from scipy.special import mathieu_a, mathieu_b

    low, high = OTHERS["closed_forms"]["mathieu_flips"]["e=0.4, z=0.0"]
    assert mathieu_a(1, 0.8 / low**2) == pytest.approx(4 / low**2, abs=1e-13)
    assert mathieu_b(1, 0.8 / high**2) == pytest.approx(4 / high**2, abs=1e-13)


def test_flips_of_meissner():
    flips = OTHERS["closed_forms"]["meissner_flips"]["e=0.2, z=0.0"]
    assert flips == pytest.approx([1.8710541957854585, 2.1252722146406944], abs=1e-14)


def test_peaks_are_those_of_nlvib():
    # NLvib-py, examples/comparison/05_geometric_nonlinearity.ipynb, columns of MATLAB and Python
    for level, peak in (("0.0005", 0.134560), ("0.001", 0.202020), ("0.003", 0.327993)):
        assert OTHERS["peaks_of_geometric"][f"F={level}, H=7"]["amplitude"] == pytest.approx(peak, rel=3e-5)

"""Special points and loci of the machines beside closed forms, and the peaks that NLvib prints."""

import json
from pathlib import Path

import numpy as np
import pytest

import gapwalk as gw
from tests.machines import closed_forms
from tests.models import read_system
from tests.tiers import in_campaign

HERE = Path(__file__).parent
OTHERS = json.loads((HERE / "references.json").read_text(encoding="utf-8"))["others"]


def flips(name: str, e: float, z: float) -> gw.Branch:
    """Walk the forced motion over the tongue of the period two."""
    changes = {"wave.amplitude": e, "damping.x.x": 2.0 * z, "frequency": 1.6}
    return gw.follow(gw.find_orbit(read_system(HERE / f"{name}.toml").at(changes)), "frequency", 2.4)


@pytest.mark.parametrize(("e", "z"), [in_campaign(0.2, 0.0), in_campaign(0.2, 0.02), (0.5, 0.05), (0.4, 0.1)])
def test_meissners_flips_are_special_points_of_a_walk(e: float, z: float) -> None:
    found = [point.value for point in flips("meissner", e, z).special("flip")]
    assert found == pytest.approx(closed_forms.meissner_edges(e, z), abs=1e-11)


@pytest.mark.parametrize(("e", "z"), [(0.4, 0.0), in_campaign(0.4, 0.02), (0.3, 0.05)])
def test_mathieus_flips_are_special_points_of_a_walk(e: float, z: float) -> None:
    found = [point.value for point in flips("mathieu", e, z).special("flip")]
    assert found == pytest.approx(closed_forms.tongue_frequencies(e, z, 1), abs=1e-11)


def test_mathieus_values_are_those_of_scipy() -> None:
    """In the form x'' + (a - 2 q cos 2 t) x = 0 with q = 1: a is walked, and b1 and a1 are flips of the period pi."""
    system = gw.System(
        ["x"],
        [[0.0]],
        contacts=[gw.force("spring", {"x": 1.0}, "k*x", k=1.0)],
        harmonics=[gw.Harmonic(-2.0, varies="spring.k", name="wave"), gw.Harmonic(0.1, {"x": 1.0})],
        frequency=2.0,
    )
    branch = gw.follow(gw.find_orbit(system), "stiffness.x.x", (-1.4, 1.4))
    found = sorted(1.0 + point.value for point in branch.special("flip"))
    values = closed_forms.mathieu_values()["1.0"]
    assert found == pytest.approx(sorted([values["a"][1], values["b"][0]]), abs=1e-11)


@pytest.mark.parametrize(("name", "z"), [("mathieu", 0.02), in_campaign("meissner", 0.02)])
def test_tongues_are_loci_of_flips(name: str, z: float) -> None:
    flip = flips(name, 0.2 if name == "meissner" else 0.4, z).special("flip")[0]
    walk = gw.WalkOptions(largest_step=0.05)
    locus = gw.follow_locus(flip, "frequency", "wave.amplitude", ((1.75, 2.25), (0.0, 0.5)), walk=walk)
    assert len(locus.points) > 20
    for point in locus.points:
        w, e = point.values
        if name == "mathieu":
            assert e == pytest.approx(closed_forms.tongue(w, z, 1), abs=1e-11)
        else:
            trace = closed_forms.meissner_trace(w, e, z)
            assert trace == pytest.approx(-2.0 * np.cosh(2.0 * np.pi * z / w), abs=1e-11)


@pytest.mark.parametrize(
    ("force", "printed"), [in_campaign(5e-4, 0.134560), in_campaign(1e-3, 0.202020), (3e-3, 0.327993)]
)
def test_peaks_are_those_of_nlvib(force: float, printed: float) -> None:
    system = read_system(HERE / "geometric.toml").at({"harmonic1.amplitude": force, "frequency": 1.2})
    branch = gw.follow(gw.find_orbit(system), "frequency", 1.05)
    peak = branch.measure("h1.q1").max()
    assert peak == pytest.approx(printed, rel=3e-3)
    exact = OTHERS["peaks_of_geometric"][f"F={force:g}, H=15"]["amplitude"]
    assert peak == pytest.approx(exact, rel=2e-4)  # of the points of the walk, none is the peak itself

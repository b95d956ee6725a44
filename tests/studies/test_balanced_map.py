"""Maps whose loci are balanced: stored with their series, the same however often they are interrupted."""

import csv
import random
from dataclasses import replace

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.orbit.harmonic_balance import BalancedOrbit
from gapwalk.paper import case
from gapwalk.studies.export import export_csv
from gapwalk.studies.result import result_document
from tests.bifurcation.test_balanced_locus import growing
from tests.results.again import again
from tests.studies.killing import killed_after
from tests.studies.maps import balanced_map, clutch_map
from tests.studies.same import assert_same_locus, assert_same_result

pytestmark = pytest.mark.usefixtures("kept_processes")


@pytest.fixture(scope="module")
def undisturbed() -> gw.Result:
    return gw.run(balanced_map())


def test_a_balanced_map_is_that_of_shooting(undisturbed) -> None:
    assert undisturbed.complete
    orbits = [point.orbit for locus in undisturbed.map.loci for point in locus.points]
    assert all(isinstance(orbit, BalancedOrbit) and orbit.truncation <= 2e-5 for orbit in orbits)
    shot = gw.run(clutch_map(walk=undisturbed.walked.walk))
    comparison = gw.studies.compare_results(shot, undisturbed)
    loci = [pair for pair in comparison.pairs if pair.names[0] in undisturbed.map.names]
    assert len(loci) == len(undisturbed.map.loci) == 5
    for pair in loci:
        assert pair.distances.max() < 1e-4


def test_what_is_loaded_is_what_was_found(undisturbed, tmp_path) -> None:
    path = tmp_path / "balanced.gapwalk"
    assert_same_result(gw.run(balanced_map(workers=2), path), undisturbed)
    assert_same_result(gw.open_result(path), undisturbed)


@pytest.mark.slow
def test_a_run_that_is_killed_at_any_moment_goes_on_to_the_same_map(undisturbed, tmp_path) -> None:
    path = tmp_path / "balanced.gapwalk"
    random.seed(5)
    for aim in (1, 4, 100):
        code = f"from tests.studies.maps import main; main({str(path)!r}, '1', 'harmonic-balance')"
        lines = killed_after(aim, code, longest_wait=0.2)
        stored = gw.open_result(path).map
        reported = [tuple(map(int, line.split())) for line in lines if line != "complete"]
        assert (len(stored.sections), len(stored.loci)) >= reported[-1]
    assert lines[-1] == "complete"
    assert_same_result(replace(gw.open_result(path), study=undisturbed.study), undisturbed)


def test_tables_and_documents_tell_harmonics_and_truncation(undisturbed, tmp_path) -> None:
    loci = result_document(undisturbed)["loci"]
    for locus, document in zip(undisturbed.map.loci, loci, strict=True):
        for point, plain in zip(locus.points, document["points"], strict=True):
            assert (plain["harmonics"], plain["truncation"]) == (point.orbit.harmonics, point.orbit.truncation)
    paths = {name: tmp_path / f"{name}.csv" for name in ("points", "special-points")}
    export_csv(undisturbed, paths)
    for path in paths.values():
        rows = list(csv.DictReader(path.read_text().splitlines()))
        assert {row["harmonics"] for row in rows} <= {str(count) for count in range(10, 200)}
        assert max(float(row["truncation"]) for row in rows) <= 2e-5
        assert np.isfinite([float(row["truncation"]) for row in rows]).all()


@pytest.mark.slow
def test_a_locus_is_read_back_though_its_harmonics_grow() -> None:
    locus = growing(gw.Balance(error=7.5e-5))
    assert len({len(point.x) for point in locus.points}) > 1
    assert_same_locus(again(locus, base=case("13")), locus)

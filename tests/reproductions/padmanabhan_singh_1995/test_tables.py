"""The consistent machine: the dimensional train behind rows 12 to 22, 27 and 28, and its special points."""

import pytest

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.jobs import CHANGES
from reproductions.padmanabhan_singh_1995.tables import consistent_machine

# From an independent program in C: Runge-Kutta steps on segments, contact times by bisection, equations 1 to 3 with
# units, and its own walk of the non-dimensional form. Frequencies divided by the normalizing one.
POINTS = {
    "flip": (0.4082, 0.4348, 0.6582, 0.7872, 1.2326, 1.3282),
    "fold": (0.4386, 0.4539, 0.5909, 0.6283),
    "neimark-sacker": (0.5925,),
}


def test_its_numbers_are_those_of_the_tables_but_for_four_that_they_contradict() -> None:
    numbers, row = gw.train.paper_numbers(consistent_machine()), gw.paper.parameter_set("13")
    assert pytest.approx(row.stiffness, rel=1e-12) == (numbers.K11, numbers.K12, numbers.K21, numbers.K22)
    assert (numbers.n1, numbers.n2) == pytest.approx(row.n, rel=1e-12)
    assert pytest.approx([row.damping[0], row.damping[3]], rel=1e-12) == [numbers.C11, numbers.C22]
    assert (numbers.beta, numbers.Te1, numbers.Tm1) == pytest.approx((row.beta, row.excitation, row.mean[0]), rel=1e-12)
    # by hand: 0.04 K21/K11, 0.06 K12/K22, and 0.25 I1/I3 with bc3 = bc1
    assert (numbers.C21, numbers.C12, numbers.Tm2) == pytest.approx((0.024, 0.06 * 0.6 / 1.1, 0.3125), rel=1e-12)


def test_the_reading_changes_two_dampers() -> None:
    number = CHANGES["machine"].number
    assert number is not None
    assert {name: round(other, 4) for name, (_, other) in number.changed.items()} == {
        "C21": 0.024,
        "C12": 0.0327,
    }


def test_its_eleven_special_points_are_those_of_an_independent_program() -> None:
    machine, scale = consistent_machine(), 100.0  # rad/s
    branch = gw.follow(gw.find_orbit(machine, frequency=2.0 * scale), "frequency", to=0.15 * scale)
    assert sum(len(points) for points in POINTS.values()) == 11
    for kind, expected in POINTS.items():
        found = sorted(special.value / scale for special in branch.special(gw.Kind(kind)))
        assert found == pytest.approx(expected, abs=1e-4), kind

"""The way back from a reduced system: values, motions, states; and what else serves an ordinary system."""

import numpy as np
import pytest

from gapwalk import Balance, Harmonic, System, backlash, classify, find_orbit, reduce
from gapwalk.errors import ModelError
from gapwalk.flow.motion import sample
from gapwalk.parallel import batch_flow_of
from tests.reduction.chains import rod, stiffness_of


def test_every_motion_of_a_full_basis_is_one_of_the_full_system() -> None:
    """Shooting in modes and in coordinates: states, contact events and time histories agree to rounding."""
    full = rod(3, 1, load=3.0, frequency=0.31)
    reduction = reduce(full, modes=3, up_to=0.4)
    one, two = find_orbit(full), find_orbit(reduction.system)
    assert two.pattern == one.pattern
    assert "1+" in one.pattern
    assert reduction.expand_state(two.state) == pytest.approx(one.state, abs=1e-9)
    assert np.sort(np.abs(two.multipliers)) == pytest.approx(np.sort(np.abs(one.multipliers)), abs=1e-8)
    motion, expanded = one.motion(64), reduction.expand(two, 64)
    assert expanded.system == full
    assert expanded.q == pytest.approx(motion.q, abs=1e-9)
    assert expanded.v == pytest.approx(motion.v, abs=1e-9)
    assert expanded.forces == pytest.approx(motion.forces, abs=1e-8)
    assert [each.contact for each in expanded.contacts] == [each.contact for each in motion.contacts]


def test_a_motion_that_is_no_orbit_is_expanded_too() -> None:
    full = rod(3, 1, load=3.0)
    reduction = reduce(full, modes=3, up_to=0.4)
    thetas = np.linspace(0.0, 10.0, 50)
    small = sample(reduction.system, np.zeros(6), thetas)
    assert reduction.expand(small).q == pytest.approx(sample(full, np.zeros(6), thetas).q, abs=1e-9)


def changed(reduction) -> System:
    """The reduced system with other values of all kinds."""
    system = reduction.system
    return system.at({
        "frequency": 0.35,
        "gap1.clearance": 0.17,
        "gap0.impact_damping": 0.3,
        "harmonic1.amplitude": 0.4,
        "mean.q5": system["mean.q5"] + 0.03,
        "stiffness.q5.q5": system["stiffness.q5.q5"] + 0.5,
        "mass.q15.q15": system["mass.q15.q15"] + 2.0,
    })  # fmt: skip


def test_values_of_the_reduced_system_are_those_of_the_full_one() -> None:
    reduction = reduce(rod(20, 2), modes=20, up_to=0.5)
    full = reduction.full_at(changed(reduction))
    expected = reduction.full.at({
        "frequency": 0.35,
        "gap1.clearance": 0.17,
        "gap0.impact_damping": 0.3,
        "harmonic1.amplitude": 0.4,
        "mean.q5": 0.03,
        "stiffness.q5.q5": reduction.full["stiffness.q5.q5"] + 0.5,
        "mass.q15.q15": 3.0,
    })  # fmt: skip
    assert full.structure == expected.structure
    assert full.values == pytest.approx(expected.values, abs=1e-12)


def test_a_change_of_a_kept_coordinate_is_the_same_change_in_both() -> None:
    """So the reduced system with another mass and spring at a kept coordinate moves as the full one does."""
    reduction = reduce(rod(20, 2), modes=20, up_to=0.5)
    system = changed(reduction)
    method = Balance(8, error=1.0)
    one, two = (find_orbit(each, start="rest", method=method) for each in (reduction.full_at(system), system))
    assert any(two.closings)
    assert reduction.expand_state(two.state) == pytest.approx(one.state, abs=1e-8)


def test_what_has_no_meaning_in_the_full_system_is_refused() -> None:
    reduction = reduce(rod(20, 2), modes=3, up_to=0.5)
    with pytest.raises(ModelError, match=r"stiffness\.mode1\.mode2 was changed"):
        reduction.full_at(reduction.system.at({"stiffness.mode1.mode2": 0.1}))
    with pytest.raises(ModelError, match="not the reduced one at some values"):
        reduction.full_at(reduction.full)
    with pytest.raises(ModelError, match="it must have 12 numbers"):
        reduction.expand_state(np.zeros(40))
    with pytest.raises(ModelError, match="there is no parameter"):
        _ = reduction.system["stiffness.q7.q8"]


def test_its_words_say_what_it_is() -> None:
    text = repr(reduce(rod(20, 2), modes=3, up_to=0.5))
    assert text.startswith("Reduction(20 degrees of freedom to 6: 3 retained, 3 modes; contacts deflect within ")
    assert text.endswith(" up to frequency 0.5)")


@pytest.mark.slow
def test_whatever_serves_a_system_serves_a_reduced_one() -> None:
    """Settling and classifying, and many motions at once, beside the full system's."""
    names = tuple(f"q{index}" for index in range(4))
    full = System(
        names,
        stiffness_of(4, 4.0),
        0.1 * np.eye(4),
        contacts=[backlash("gap", {"q2": 1.0}, 0.1, 3.0)],
        harmonics=[Harmonic(0.3, {"q2": 1.0})],
        frequency=0.8,
    )
    reduction = reduce(full, modes=3, up_to=1.0)
    one, two = classify(full), classify(reduction.system)
    assert one.label == two.label == "P1"
    starts = np.zeros((3, 8))
    starts[:, 0] = 0.3, 0.0, -0.2
    ends = batch_flow_of(reduction.system).run(starts, 5).states
    expected = batch_flow_of(full).run(reduction.expand_state(starts), 5).states
    assert reduction.expand_state(ends) == pytest.approx(expected, abs=2e-4)

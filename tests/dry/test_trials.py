"""Random systems with friction and stops: each step ends with a result that verification passes, or with a reason."""

import pytest

from tests.dry.trials.random_systems import random_system
from tests.dry.trials.trial import attempt
from tests.tiers import some_of


@pytest.mark.parametrize("seed", some_of(range(100), 5, 51, 52))
def test_each_ends_with_a_result_or_a_reason(seed: int) -> None:
    trial = attempt(f"random {seed}", random_system(seed), factor=1.02, sampled=2)
    assert trial.faults == []
    assert {"orbit", "motion", "sweep"} <= trial.ends.keys()

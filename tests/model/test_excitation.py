"""Harmonics have whole orders, and a name by default."""

import pytest

from gapwalk.errors import ModelError
from gapwalk.model import Harmonic


def test_a_harmonic_is_called_after_its_order() -> None:
    assert Harmonic(1.0, {"x": 1.0}, order=3).name == "harmonic3"
    assert Harmonic(1.0, {"x": 1.0}, name="mesh").name == "mesh"


def test_a_whole_order_may_be_a_float() -> None:
    harmonic = Harmonic(1.0, {"x": 1.0}, order=2.0)
    assert type(harmonic.order) is int
    assert (harmonic.order, harmonic.name) == (2, "harmonic2")


@pytest.mark.parametrize(
    ("order", "message"),
    [
        (1.5, "not periodic"),
        (0, "belongs in `mean`"),
        (-1, "integer >= 1"),
        (True, "integer >= 1"),
        ("2", "integer >= 1"),
        (float("nan"), "integer >= 1"),
        (float("inf"), "integer >= 1"),
    ],
)
def test_other_orders_are_refused(order, message: str) -> None:
    with pytest.raises(ModelError, match="order is") as error:
        Harmonic(1.0, {"x": 1.0}, order=order)
    assert message in str(error.value)

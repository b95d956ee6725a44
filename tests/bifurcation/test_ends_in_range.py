"""Ends of branches lie in the range that was asked for."""

import importlib
from types import SimpleNamespace
from typing import Any, cast

import pytest

from gapwalk.bifurcation.follow import BranchTracer
from gapwalk.continuation.corrector import Range
from gapwalk.continuation.walk import EndReason

FOLLOW = importlib.import_module("gapwalk.bifurcation.follow")  # the package has a function of that name


@pytest.mark.parametrize(("value", "joins"), [(0.01009, False), (-0.03, True)])
def test_a_branch_joins_another_only_in_its_range(monkeypatch: pytest.MonkeyPatch, value: float, joins: bool) -> None:
    monkeypatch.setattr(FOLLOW, "value_between", lambda *_: value)
    monkeypatch.setattr(FOLLOW, "has_parent", lambda *_: True)
    ends: list[Any] = []

    def finish(_: Any, reason: EndReason, *, value: float) -> None:
        ends.append(SimpleNamespace(reason=reason, value=value))

    corrector = SimpleNamespace(scales=[1.0])
    tracer = cast(Any, BranchTracer.__new__(BranchTracer))
    tracer.beginning = SimpleNamespace(within=Range(-0.6, -0.02), equation=None, corrector=corrector, singular=False)
    tracer.walk = SimpleNamespace(end=None, finish=finish)
    first, point = (SimpleNamespace(value=each, orbit=SimpleNamespace(period=2)) for each in (-0.04, -0.021))
    tracer.first = None
    step = (point, [])
    assert (tracer._until_parent(first, step) is step) is not joins
    assert [(end.reason, end.value) for end in ends] == ([(EndReason.JOINED, value)] if joins else [])

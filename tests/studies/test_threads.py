"""How many threads linear algebra is told to use."""

import os

import pytest

from gapwalk.parallel.threads import children_in_one_thread, work_in_one_thread

NAMES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


@pytest.fixture(autouse=True)
def nothing_set(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in NAMES:
        monkeypatch.setenv(name, "")  # noted, so that it is put back after the test
        monkeypatch.delenv(name)


def test_one_thread_unless_the_user_has_said_otherwise(monkeypatch) -> None:
    work_in_one_thread()
    assert [os.environ[name] for name in NAMES] == ["1", "1", "1"]

    for name in NAMES:
        monkeypatch.delenv(name)
    monkeypatch.setenv("OMP_NUM_THREADS", "4")
    work_in_one_thread()
    assert "OPENBLAS_NUM_THREADS" not in os.environ  # it would be stronger
    assert os.environ["OMP_NUM_THREADS"] == "4"


def test_what_is_set_for_children_is_undone() -> None:
    with children_in_one_thread():
        assert [os.environ[name] for name in NAMES] == ["1", "1", "1"]
    assert not set(NAMES) & set(os.environ)

"""The tests that take the most CPU time, printed at the end where `--costly` asks for it: `make costly`."""

import os
from collections.abc import Iterator

import pytest


def used() -> float:
    """CPU seconds of this process and of those that it has waited for."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


class CpuTimes:
    """CPU time of each test, its fixtures included; processes count for the test that ends them."""

    def __init__(self, limit: float) -> None:
        self.limit, self.start, self.seconds = limit, 0.0, dict[str, float]()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self) -> Iterator[None]:
        self.start = used()
        return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self) -> Iterator[None]:
        report = yield
        report.user_properties = [*report.user_properties, ("cpu", used() - self.start)]
        return report

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "teardown":
            self.seconds[report.nodeid] = float(str(dict(report.user_properties)["cpu"]))

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        costly = sorted((-each, name) for name, each in self.seconds.items() if each > self.limit)
        total = sum(self.seconds.values())
        terminalreporter.write_line(f"{total:.0f} CPU s in all; {len(costly)} tests over {self.limit:g} s")
        for seconds, name in costly:
            terminalreporter.write_line(f"{-seconds:7.1f} {name}")

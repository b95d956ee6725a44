"""The progress of a job, and the time until it is done."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Pace:
    """The progress of a job.

    Examples
    --------
    >>> gw.parallel.Pace(done=30, total=100, before=10, seconds=5.0).rate
    4.0
    """

    #: done, total: Parts of the job that are done, and all of them.
    done: int
    total: int
    before: int = 0  #: Parts that an earlier run had done; `done` includes them.
    seconds: float = 0.0  #: Time since this run began.

    @property
    def rate(self) -> float | None:
        """Parts that are done in a second; None before the first."""
        new = self.done - self.before
        return new / self.seconds if new > 0 and self.seconds > 0.0 else None

    @property
    def left(self) -> float | None:
        """Seconds until the end at the present rate; None while the rate is not known."""
        rate = self.rate
        return None if rate is None else (self.total - self.done) / rate

    def __str__(self) -> str:
        text = f"{self.done} of {self.total}"
        if self.rate is None or self.left is None:
            return text
        speed = f"{self.rate:.3g} a second" if self.rate >= 1.0 else f"{1.0 / self.rate:.3g} s each"
        return f"{text}, {speed}, {_duration(self.left)} left"


def _duration(seconds: float) -> str:
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    minutes, hours = whole // 60 % 60, whole // 3600
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {whole % 60} s"

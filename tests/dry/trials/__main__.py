"""``python -m tests.dry.trials LOG``: tries random systems with friction and stops; goes on where it was stopped."""

from __future__ import annotations

import json
import os
import resource
import sys
from collections import defaultdict
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

from tests.bifurcation.campaign import arguments, compare_all, random_names
from tests.dry.trials.random_systems import random_system
from tests.dry.trials.trial import Trial, attempt

_HARD = 2.0  # times the cap after which the process of a trial is ended, should it not stop by itself


def main() -> int:
    """Try what the log does not hold yet, and print a table of how many end how."""
    parser = arguments("dry.trials", __doc__)
    parser.add_argument(
        "--sampled", type=int, default=0, metavar="N", help="verify N orbits of each branch only (-1: nothing)"
    )
    parser.add_argument("--factor", type=float, default=1.3, help="width of the range (default: 1.3)")
    parser.add_argument("--cap", type=float, default=180.0, help="processor time of one system, in seconds")
    parser.add_argument("--walks", action="store_true", help="the walks alone, without settled motions and sweeps")
    options = parser.parse_args()

    def tried(name: str) -> Trial:
        system = random_system(int(name.split()[1]))
        return apart(
            name,
            options.cap,
            lambda: attempt(name, system, options.factor, options.sampled, options.cap, is_short=options.walks),
        )

    code = compare_all(options.log, random_names(options), tried, Trial)
    print(table(options.log))
    return code


def apart(name: str, cap: float, work: Callable[[], Trial]) -> Trial:
    """Do a trial in a process of its own, which ends even if compiled code never returns, or crashes."""
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        os.close(reading)
        most = int(_HARD * cap) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (most, most))
        with os.fdopen(writing, "w", encoding="utf-8") as pipe:
            json.dump(asdict(work()), pipe)
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading, encoding="utf-8") as pipe:
        text = pipe.read()
    ended = os.waitpid(child, 0)[1]
    if text and not ended:
        return Trial(**json.loads(text))
    words = f"its process ended with signal or status {os.waitstatus_to_exitcode(ended)}, or used {_HARD * cap:g} s"
    return Trial(name, [words], cap=cap, slow=True, outcome="its process was ended")


def table(log: Path) -> str:
    """Return how many trials of a log end how, with the names of all that do not reach the end of the range."""
    trials = [Trial(**json.loads(line)) for line in log.read_text(encoding="utf-8").splitlines()]
    lines = [f"{len(trials):4} systems"]
    for way in ("outcome", "back"):
        groups: dict[str, list[str]] = defaultdict(list)
        for trial in trials:
            groups[getattr(trial, way) or trial.note].append(trial.name.split()[-1])
        lines += ["     on the way back:"] if way == "back" else []
        for outcome, names in sorted(groups.items(), key=lambda group: -len(group[1])):
            listed = "" if outcome.endswith("was reached") or not outcome else ": " + ", ".join(names)
            lines.append(f"{len(names):4} {outcome or 'not walked'}{listed}")
    for words, is_one in (("too slow", lambda trial: trial.slow), ("with faults", lambda trial: trial.faults)):
        names = [trial.name.split()[-1] for trial in trials if is_one(trial)]
        lines.append(f"{len(names):4} {words}: {', '.join(names) or 'none'}")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())

"""Studies of a small train are killed, and stopped by Ctrl-C, at random moments: nothing finished is lost.

``python -m tests.faults.train_kills FOLDER [NAME ...]`` runs each study once undisturbed, then ends it ten times by
``kill -9`` and ten times by Ctrl-C, each time going on with what is stored, and compares all digits of the answer with
those of the undisturbed run (half an hour of CPU time). What is done is noted in the folder: the same command goes on.
How many points of a curve are in a part follows the clock, so parts are compared by what they make together.
"""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import gapwalk as gw
from gapwalk.results.codec import plain
from tests.attractors.test_lane_settling import small_text
from tests.faults.test_kills import ROOT, assert_group_ends, assert_nothing_is_left, environment, parts_of

LATE = 0.7  # share of the ends that come after something is stored
TIMES = int(os.environ.get("GAPWALK_KILLS", "10"))
WAYS = {"kill": (-signal.SIGKILL,), "ctrl-c": (130, -signal.SIGINT)}  # the last while Python starts
SPREAD = """spread = [{ parameter = "idle.clearance", sd = "10 %" }, { parameter = "churn.linear", sd = "20 %" }]"""
SECOND = """second = { parameter = "o2.amplitude", from = "10 N m", to = "30 N m" }"""
STUDIES = {
    "response": """kind = "response"\nmeasure = "max.idle"\nfrom = "1200 rpm"\nto = "400 rpm" """,
    "rattle": """kind = "rattle"\nsteps = 40\nsearch = 4\nstarts = 8\nfrom = "400 rpm"\nto = "1200 rpm" """,
    "rattle-map": f"""kind = "rattle"\nresolution = [12, 6]\nfrom = "500 rpm"\nto = "1100 rpm"\n{SECOND}""",
    "threshold": """kind = "threshold"\ngaps = ["idle"]\nvalues = 12
from = "0.02 N m s/rad"\nto = "0.2 N m s/rad"
over = { parameter = "speed", from = "700 rpm", to = "1000 rpm" }""",
    "settle": """kind = "settle" """,
    "run-up": """kind = "run-up"\nfrom = "500 rpm"\nto = "1200 rpm"\nrate = "20 rpm/s" """,
    "run-ups": """kind = "run-up"\nfrom = "500 rpm"\nto = "1200 rpm"\nrate = ["50 rpm/s", "100 rpm/s"]\nstarts = 200""",
    "tolerance": f"""kind = "tolerance"\nfrom = "1200 rpm"\nto = "900 rpm"\nsamples = 40\n{SPREAD}""",
    "design": """kind = "design"\nfrom = "900 rpm"\nto = "1000 rpm"
changes = [{ parameter = "churn.linear", by = 0.9 }, { parameter = "o2.amplitude", by = 0.5 }]
goals = [{ quiet = "idle", from = "900 rpm", to = "1000 rpm" }]""",
    "scan": """kind = "scan"\nparameters = ["o2.amplitude"]\nfactors = [0.9, 1.1]\nstarts = 2\npairs = 0\nlongest = 200
neighbours = 8
claim = [{ motion = "period 1", at = { speed = "900 rpm" } }]""",
    "rattle-chance": f"""kind = "rattle-chance"\nvalues = ["900 rpm", "800 rpm"]\nsamples = 200\n{SPREAD}""",
    "regimes": f"""kind = "regimes"\nresolution = [16, 8]\nfrom = "500 rpm"\nto = "1100 rpm"\n{SECOND}""",
    "basins": """kind = "basins"\nresolution = [100, 90]\nexact_borders = false\ncheck = 8
plane = { idle = [-0.01, 0.01], "idle'" = [-3.0, 3.0] }""",
}
PARAMETERS = {"threshold": "churn.linear"}


def command(folder: Path, name: str, file: str) -> list[str]:
    """Return the command that runs a study, or goes on with it."""
    model, output = folder / "train.toml", folder / f"{file}.gapwalk"
    text = small_text()
    for each, body in STUDIES.items():
        over = f'\nparameter = "{PARAMETERS.get(each, "speed")}"' if "from" in body and "run-up" not in body else ""
        text += f'\n[[study]]\nname = "its-{each}"\n{body}{over}\n'
    model.write_text(text, encoding="utf-8")
    given = [str(model), f"its-{name}", "--output", str(output), "--quiet", *(["--resume"] if output.exists() else [])]
    return [sys.executable, "-m", "gapwalk", "run", *given]


def run(folder: Path, name: str, file: str, way: str = "", within: float = 0.0) -> bool:
    """Run a study until its end, or until a random moment; return True if it was stopped before its end."""
    program = subprocess.Popen(
        command(folder, name, file),
        cwd=ROOT,
        env=environment(),
        start_new_session=True,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert program.stderr is not None
    stopped = False
    if way:
        try:
            path, begun = folder / f"{file}.gapwalk", time.monotonic()
            waits = random.random() < LATE
            while waits and program.poll() is None and not path.exists() and time.monotonic() - begun < within:
                time.sleep(0.02)
            program.wait(random.uniform(0.0, 0.5 * within))
        except subprocess.TimeoutExpired:
            stopped = True
            if way == "kill":
                program.kill()
            else:
                os.killpg(program.pid, signal.SIGINT)  # as a terminal does
    said = program.stderr.read()
    code = program.wait()
    if code != 0 and not (stopped and code in WAYS[way]):
        raise AssertionError(f"{name} ended with {code}, {way or 'undisturbed'}:\n{said}")
    assert_group_ends(program.pid)
    assert_nothing_is_left(folder / f"{file}.gapwalk")
    return code != 0


def answer_of(path: Path) -> str:
    """Return all that a complete result says, with all digits."""
    return json.dumps(plain(gw.open_result(path)))


def disturbed(folder: Path, name: str, way: str, within: float) -> str:
    """End a study some times, and compare; return what was found."""
    whole, path, times, rounds, early = answer_of(folder / f"{name}.gapwalk"), folder / f"{name}-{way}.gapwalk", 0, 0, 0
    random.seed(f"{name} {way}")
    path.unlink(missing_ok=True)
    while times < TIMES:
        goes_on, stored = True, dict[tuple[str, int], tuple[str, bytes]]()
        while goes_on:
            goes_on = run(folder, name, path.stem, way if times < TIMES else "", within)
            times += goes_on
            now = parts_of(path) if path.exists() else {}
            if lost := [key for key in stored if key not in now]:
                raise AssertionError(f"{name} lost {lost} by {way}")
            early += goes_on and not now
            stored = dict(now)
        if answer_of(path) != whole:
            raise AssertionError(f"{name} differs after {way}")
        rounds += 1
        path.unlink()
    return f"{times} times, {early} of them before the first part; {rounds} times the same answer"


def main() -> int:
    """Do what is not done yet; return 1 if a study lost anything."""
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell has its background jobs ignore it
    folder, *names = sys.argv[1:]
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    notes, failed = place / "done.json", 0
    for name in names or STUDIES:
        done = json.loads(notes.read_text()) if notes.exists() else {}
        mine = done.setdefault(name, {})
        if "seconds" not in mine:
            (place / f"{name}.gapwalk").unlink(missing_ok=True)
            begun = time.monotonic()
            run(place, name, name)
            mine["seconds"] = time.monotonic() - begun
            notes.write_text(json.dumps(done, indent=1))
        for way in (way for way in WAYS if way not in mine):
            try:
                mine[way] = disturbed(place, name, way, mine["seconds"])
            except AssertionError as error:
                failed += 1
                print(f"{name}, {way}: {error}", flush=True)
                continue
            print(f"{name} ({mine['seconds']:.1f} s), {way}: {mine[way]}", flush=True)
            notes.write_text(json.dumps(done, indent=1))
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main())

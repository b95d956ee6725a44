"""Bad input, given to the command line in this process: what comes out, and with which exit code.

A case is a table of tests/data/bad_input.toml. `words` are those of a command; without them the model file `model` is
checked, in which `old` stands as `new`. Files that words may name are made by `lay_out`.
"""

from __future__ import annotations

import sqlite3
import tomllib
from pathlib import Path
from typing import Any

import gapwalk as gw
from gapwalk.cli import main
from tests.cli.conftest import MODEL
from tests.model.drivetrain.test_train_file import GOOD as TRAIN
from tests.studies.studies import stop_study

DATA = Path(__file__).parents[1] / "data"
UNITS = (Path(__file__).parents[2] / "examples" / "drivetrain.toml").read_text(encoding="utf-8")
STUDY = '\n[study]\nkind = "response"\nparameter = "frequency"\nfrom = 2.0\nto = 3.0\n'
DRY = (
    """coordinates = ["x", "y"]
stiffness = [1.0, 1.0]
damping = [0.1, 0.1]
frequency = 1.0
[[contact]]
name = "stop"
deflection = { x = 1.0 }
clearance = 1.0
stiffness = 10.0
[[friction]]
name = "brake"
deflection = { x = 1.0 }
limit = 0.3
[[harmonic]]
order = 1
amplitude = 1.0
acts_on = { x = 1.0 }
"""
    + STUDY
)
MODELS = {"stop": MODEL, "train": TRAIN + STUDY, "units": UNITS, "dry": DRY}
MEASUREMENT = "\n[measurement]\nsignal = \"x''\"\n"


def cases() -> list[dict[str, Any]]:
    """All cases."""
    return tomllib.loads((DATA / "bad_input.toml").read_text(encoding="utf-8"))["case"]


def lay_out(folder: Path) -> None:
    """The files that words may name."""
    gw.run(stop_study(largest_step=0.1), folder / "old.gapwalk")
    old = (folder / "old.gapwalk").read_bytes()
    contents: dict[str, bytes] = {
        "stop.toml": MODEL.encode(),
        "measured.toml": (MODEL + MEASUREMENT).encode(),
        "empty.toml": b"",
        "latin.toml": "title = 'Geräusch'".encode("latin-1"),
        "binary.toml": bytes(range(256)),
        "deep.toml": b"a = " + b"[" * 100_000,
        "cut.gapwalk": old[:20_000],
        "foreign.gapwalk": b"SQLite format 3\0" + bytes(100),
    }
    for name, content in contents.items():
        (folder / name).write_bytes(content)
    for name, statement in (
        ("future.gapwalk", "PRAGMA user_version = 99"),
        ("damaged.gapwalk", "UPDATE part SET checksum = '' WHERE name = 'moment' AND number = 0"),
        ("trap.gapwalk", "CREATE TRIGGER trap AFTER UPDATE ON part BEGIN DELETE FROM part; END"),
        ("database.gapwalk", "PRAGMA application_id = 7"),
    ):
        (folder / name).write_bytes(old)
        connection = sqlite3.connect(folder / name, isolation_level=None)
        connection.execute(statement)
        connection.close()


def give(case: dict[str, Any]) -> int:
    """Give one case to the command line, in the folder where `lay_out` was; the exit code."""
    if "words" in case:
        return main(case["words"])
    if "record" in case:
        Path(case["name"]).write_bytes(case["record"].encode("latin-1"))
        return main(["measure", "measured.toml", case["name"]])
    text = MODELS[case["model"]]
    assert case["old"] in text
    Path("model.toml").write_text(text.replace(case["old"], case["new"], 1), encoding="utf-8")
    return main(["check", "model.toml"])

"""The public names are those that were promised: nobody's script breaks unnoticed."""

import json

from tests.release.names import PROMISED, public_names

ADVICE = (
    "If the change is wanted: `python -m tests.release.names` writes the list again, CHANGELOG.md says what changed, "
    "and what was renamed or taken away asks for a new minor version (from 1.0 on a major one)."
)


def test_the_public_names_are_those_that_were_promised():
    promised, present = json.loads(PROMISED.read_text()), public_names()
    assert present["version"] == promised["version"], ADVICE
    for name in sorted(promised["names"].keys() | present["names"].keys()):
        assert present["names"].get(name) == promised["names"].get(name), f"{name}: {ADVICE}"

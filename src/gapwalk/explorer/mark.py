"""The mark of a model: some letters that tell it from what it was before its file was edited."""

from __future__ import annotations

import hashlib

from gapwalk.studies.file import Study


def mark_of(study: Study) -> str:
    """The mark of the model file that a study comes from: the first letters of its SHA-256, with its matrices.

    Values that were changed after reading it, and other studies of the same text, have the same mark.
    """
    return hashlib.sha256((study.text + study.matrices).encode("utf-8", "replace")).hexdigest()[:8]

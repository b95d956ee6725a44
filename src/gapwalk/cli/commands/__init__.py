"""The commands and their options; what they do is imported only when one of them runs, so that help comes at once."""

from gapwalk.cli.app import app
from gapwalk.cli.commands import explore, measure, model, result, study

__all__ = ["app", "explore", "measure", "model", "result", "study"]

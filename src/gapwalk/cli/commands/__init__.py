"""The commands and their options; their code is imported only when one of them runs, so that help appears at once."""

from gapwalk.cli.app import app
from gapwalk.cli.commands import explore, measure, model, result, study

__all__ = ["app", "explore", "measure", "model", "result", "study"]

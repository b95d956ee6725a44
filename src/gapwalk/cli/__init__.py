"""The command line."""

from gapwalk.cli.entry import main

__all__ = ["main"]

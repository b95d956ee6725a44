"""The command line."""

from gapwalk.cli.app import main

__all__ = ["main"]

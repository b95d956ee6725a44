"""The program to which `gapwalk.cli.commands` adds the commands, and the options that several of them share."""

from __future__ import annotations

from typing import Annotated

from cyclopts import App, Parameter

app = App(
    name="gapwalk",
    help="Numerical continuation for vibrating systems with gaps.",
    help_format="plaintext",
    version=lambda: __import__("gapwalk").__version__,
)

Flag = Annotated[bool, Parameter(negative=(), show_default=False)]
Changes = Annotated[list[str] | None, Parameter(name="--set", negative=())]

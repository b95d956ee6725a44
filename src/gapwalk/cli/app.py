"""The program that the commands of `gapwalk.cli.commands` are added to, and the options that many of them have."""

from __future__ import annotations

from typing import Annotated

from cyclopts import App, Parameter

app = App(
    name="gapwalk",
    help="Walks the solution branches of vibrating systems with gaps.",
    help_format="plaintext",
    version=lambda: __import__("gapwalk").__version__,
)

Flag = Annotated[bool, Parameter(negative=(), show_default=False)]
Changes = Annotated[list[str] | None, Parameter(name="--set", negative=())]

"""``gapwalk explore``: the page in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from gapwalk.cli.app import Flag, app
from gapwalk.cli.outcome import DONE, guard


@app.command(sort_key=3.5)
def explore(
    file: Path | None = None,
    /,
    *,
    port: int = 0,
    host: str = "127.0.0.1",
    browser: Annotated[bool, Parameter(negative="--no-browser", show_default=False)] = True,
    debug: Flag = False,
) -> int:
    """Open a model or a result in the browser: its diagram grows while it is computed, any point shows its motion.

    Results are kept in a folder beside the file, such as model.explorer for model.toml. Ctrl-C ends it.

    Parameters
    ----------
    file
        The model file, the result, or a folder of them; by default the current folder.
    port
        Where to listen; 0 for any port that is free.
    host
        The address to listen at. Beyond this machine, the page asks for a token, which is in the address printed.
    browser
        Whether to open the page.
    debug
        Show the traceback of an error.
    """

    def job() -> int:
        from gapwalk.explorer.serve import serve

        serve(file, host, port, browser=browser)
        return DONE

    return guard(job, debug=debug)

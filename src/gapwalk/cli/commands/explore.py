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
    """Open a model or a result in the browser: its diagram grows during the computation, any point shows its motion.

    Results are stored in a folder next to the file, such as model.explorer for model.toml. Ctrl-C ends the command.

    Parameters
    ----------
    file
        The model file, the result, or a folder of them; by default the current folder.
    port
        The port of the server; 0 for any free port.
    host
        The address of the server. For other addresses than this machine's, the page requires a token, which is part of
        the printed address.
    browser
        Open the page in the browser.
    debug
        Show the traceback of an error.
    """

    def job() -> int:
        from gapwalk.explorer.serve import serve

        serve(file, host, port, browser=browser)
        return DONE

    return guard(job, debug=debug)

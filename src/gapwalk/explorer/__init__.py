"""The explorer: a page in the browser on which a diagram grows, and each of its points shows its motion."""

from importlib.util import find_spec

from gapwalk.errors import ModelError

MISSING = [name for name in ("plotly", "starlette", "uvicorn") if find_spec(name) is None]
if MISSING:
    raise ModelError(
        f'the explorer and pages in HTML need {", ".join(MISSING)}; install it: pip install "gapwalk[explorer]"'
    )

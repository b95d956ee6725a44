"""What a call raises after Ctrl-C, and what it has found by then."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from gapwalk.errors import Interrupted


def until_ctrl_c(call: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
    """What a call that is interrupted on its way has found; the test fails if it returns as if it were not."""
    with pytest.raises(Interrupted) as caught:
        call(*arguments, **options)
    return caught.value.found

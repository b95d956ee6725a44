"""Packages that modules of gapwalk load with their first piece of work: this module loads those of the modules loaded.

The server from which processes are forked imports it after all others, so that none of them loads such a package again.
"""

from __future__ import annotations

import sys
from importlib import import_module

_IN_USE = {"gapwalk.ensemble.kernel_source": ("numba",)}  # it takes half a second

for _owner, _names in _IN_USE.items():
    if _owner in sys.modules:
        for _name in _names:
            import_module(_name)

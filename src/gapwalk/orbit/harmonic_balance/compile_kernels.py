"""Compile all kernels of harmonic balance: ``python -m gapwalk.orbit.harmonic_balance.compile_kernels``.

An installation may do so, so that the first harmonic balance need not wait for the compiler (15 seconds).
"""

from __future__ import annotations

from importlib import import_module

MODULES = ("kernels", "compliance", "monodromy")
"""Modules of this package that have kernels; importing them compiles what is not stored."""


def compile_kernels() -> None:
    """Compile the kernels that are not stored yet, and store them."""
    for name in MODULES:
        import_module(f"gapwalk.orbit.harmonic_balance.{name}")


if __name__ == "__main__":
    compile_kernels()

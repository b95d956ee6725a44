"""Compile all kernels: ``python -m gapwalk.orbit.harmonic_balance.compile_kernels``.

An installation may do so, so that neither the first motion nor the first harmonic balance waits for the compiler.
"""

from __future__ import annotations

from importlib import import_module

from gapwalk.taylor.integrator import kernel

MODULES = ("kernels", "compliance", "monodromy")
"""Modules of this package that have kernels; importing them compiles what is not stored."""


def compile_kernels() -> None:
    """Compile the kernels that are not stored yet, and store them: that of the flow, and those of harmonic balance."""
    kernel()
    for name in MODULES:
        import_module(f"gapwalk.orbit.harmonic_balance.{name}")


if __name__ == "__main__":
    compile_kernels()

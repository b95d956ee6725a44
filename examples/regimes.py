"""Kinds of motion: a regime map of the system of figure 15 over frequency and amplitude.

    python examples/regimes.py [cells along each axis]

It writes the file regimes.cells during the computation. If you stop it, the next run continues from there.
"""

import sys

import gapwalk as gw

system = gw.paper.case("15")
cells = int(sys.argv[1]) if len(sys.argv) > 1 else 200


def tell(chunk, pace):
    print(pace, flush=True)


found = gw.regimes(
    system, {"frequency": (0.15, 1.9), "harmonic1.amplitude": (0, 1)}, cells, report=tell, output="regimes.cells"
)
print(found)
print(f"{len(found.check.different)} of {found.check.checked} cells have another kind by the exact flow")
axes = found.plot("What a start from rest settles on", panels=("peak force", "impacts"))
axes.figure.savefig("regimes.png")

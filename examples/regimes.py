"""What kind of motion there is: a regime map of figure 15's system over frequency and amplitude.

    python examples/regimes.py [cells along each axis]

It writes the file regimes.cells as it goes: stopped at any moment, it goes on from there when it is run again.
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
print(f"{len(found.check.different)} of {found.check.checked} cells are something else by the exact flow")
found.plot("What a start from rest settles on", panels=("peak force", "impacts")).savefig("regimes.png")

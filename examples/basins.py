"""Basins of attraction of the system of figure 15 at Omega = 0.45, and their shares of a box of states.

python examples/basins.py [cells along each axis]
"""

import sys

import gapwalk as gw

system = gw.paper.case("15").at(frequency=0.45)
cells = int(sys.argv[1]) if len(sys.argv) > 1 else 256

found = gw.basins(system, {"q1": (-4, 4), "q1'": (-4, 4)}, cells)
print(found)
print(f"{found.check.border_wrong} labels at borders were corrected; at most {found.check.limit:.2%} of all are wrong")
gw.plot.save(found, "basins.png", title="Starts with q3 = q3' = 0", strobes="all")

whole = gw.basin_shares(system, {"q1": (-4, 4), "q3": (-4, 4), "q1'": (-4, 4), "q3'": (-4, 4)}, starts=10 * cells)
for share in whole.shares:
    print(f"{share.name}: {share.share:.1%} of all starts (between {share.low:.1%} and {share.high:.1%})")

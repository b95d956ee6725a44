"""Special points of random machines computed again with 80-bit numbers: stated errors must cover the deviation."""

"""Kinds that are added to gapwalk from outside, in one file each, as somebody who adds one would write them."""

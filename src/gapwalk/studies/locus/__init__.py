"""The study ``kind = "locus"``: the loci of some special points of one branch, kept as a map with one section."""

"""Reproductions of published results, on the public API of gapwalk alone: each paper is a package of its own."""

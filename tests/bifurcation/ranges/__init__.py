"""Walks of random systems over narrow and wide ranges of the frequency: what both cover must be the same."""

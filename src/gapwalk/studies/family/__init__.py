"""Families: the branches of one system for several values of a parameter, with their special points joined."""

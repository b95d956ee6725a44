"""Whole jobs: what a model file asks to be studied, and its execution."""

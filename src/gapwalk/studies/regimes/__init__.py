"""Regime maps as jobs: chunk by chunk, checked, and stored."""

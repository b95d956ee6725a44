"""Answers to questions about a machine: rattle bands, thresholds, designs, tolerances and run-ups."""

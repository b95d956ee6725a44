"""What was measured: records, aligned with computed motions, and parameters fitted to them."""

"""Results checked by other means than those that found them."""

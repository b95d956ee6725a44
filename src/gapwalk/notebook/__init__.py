"""Display in notebooks: cards of values, and progress of long calls."""

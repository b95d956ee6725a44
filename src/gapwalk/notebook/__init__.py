"""In a notebook: values that show themselves, and how far long calls have come."""

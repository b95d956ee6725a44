"""One machine described in several ways: its walks must find the same special points."""

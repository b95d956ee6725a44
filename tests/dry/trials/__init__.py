"""Random systems with dry friction and rigid stops: each ends with a result that verification passes, or a reason."""

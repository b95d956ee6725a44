"""Taylor series: differential equations as expressions, as programs, and integrated by one compiled kernel."""

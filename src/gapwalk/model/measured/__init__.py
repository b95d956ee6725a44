"""Measured tables: curves of springs, torques over the angle of a shaft, and values over the speed, from CSV files."""

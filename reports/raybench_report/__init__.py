"""Draws the report of a run: pure functions of the files that `raybench run` leaves (see reports/README.md)."""

"""Measures calibrators: `measure` gives the errors that documents quote, `benchmark` the milliseconds."""

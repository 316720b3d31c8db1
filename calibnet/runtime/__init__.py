"""Utilities for all parts of the package: clock, precision, interruption, reading and writing of files."""

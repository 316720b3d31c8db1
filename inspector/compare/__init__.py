"""Compares several recorded runs of one sequence side by side."""

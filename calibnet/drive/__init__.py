"""Solves one extrinsic from all frames of a drive."""

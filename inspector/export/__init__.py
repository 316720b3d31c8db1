"""Exports a recorded extrinsic in the formats of other tools."""

"""The pictures that tabs show: overlays, painted points, matches, grids of channels, legends."""

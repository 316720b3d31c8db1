"""Reads recordings back: files, runs, sizes, and pictures of the viewer."""

"""Serves pages on this machine: the server, the guard before it, and the files of Rerun's web viewer."""

"""Pages on this machine: one server, one guard before it, and the files of Rerun's web viewer."""

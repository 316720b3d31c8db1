"""The tabs of the viewer, each a module with its data, layout and legend.

`registry` defines and lists them, `blueprint` puts them side by side, and `views` and `table` are shared parts.
"""

"""The tabs of the viewer: one module a tab says what it logs, how it is laid out, and its legend.

`registry` lists them and says what a tab is, `blueprint` puts them side by side; `views` and `table` are shared parts.
"""

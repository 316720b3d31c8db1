"""The tabs of the viewer: one module a tab says what it logs, how it is laid out, and its legend."""

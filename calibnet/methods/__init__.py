"""What calibrates: the interface that all methods have, and the methods by name.

The other systems of the paper's table move in here, one module each. `Cascade`, ours, lives in `calibnet.cascade`.
"""

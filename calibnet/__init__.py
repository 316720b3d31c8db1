"""Camera-LiDAR extrinsic calibration with a five-range cascade of learned networks.

The package itself imports nothing heavy; take what is needed from its modules, for instance
``from calibnet.cascade.cascade import Cascade``.
"""

__version__ = "0.1.0"

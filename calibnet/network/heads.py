"""The pose heads by name; those of other packages register as ``calib_inspect.heads``.

A head is a torch module that is called as ``Head(config, range_)`` and whose ``forward(field, cells, intrinsics)``
returns a `calibnet.network.pose.Pose`; `calibnet.conformance.check_head` tests one.
"""

from __future__ import annotations

from calibnet.runtime.plugins import Registry

HEADS = Registry(
    "heads",
    "pose head",
    {"geometric": "calibnet.network.pose:GeometricHead", "regression": "calibnet.network.pose:RegressionHead"},
)

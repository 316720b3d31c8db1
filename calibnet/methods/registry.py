"""The methods by name; those of other packages register as ``calib_inspect.methods``.

A method is a class that is called with the `MiscalibrationRange` to expect and is a `Calibrator`;
`calibnet.conformance.check_method` tests one.
"""

from __future__ import annotations

from calibnet.geometry import MiscalibrationRange
from calibnet.methods.calibrator import Calibrator
from calibnet.runtime.plugins import Registry

METHODS = Registry("methods", "method", {"edge-alignment": "calibnet.methods.edge_alignment:EdgeAlignment"})


def open_method(name: str, range_: MiscalibrationRange) -> Calibrator:
    """A method by name, ready to use.

    Args:
        name: one of ``METHODS.names()``.
        range_: of the miscalibrations to expect.

    Raises:
        ConfigError: there is no such method, or its package is broken.
    """
    method: Calibrator = METHODS.load(name)(range_)
    return method

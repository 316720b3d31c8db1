"""Registry of the methods by name; other packages register theirs as ``calib_inspect.methods``.

A method is a `Calibrator` class that is called with the `MiscalibrationRange` to expect. Its options are keywords:
``weights`` and ``masks``, which are folders, and ``intrinsics``.
`calibnet.conformance.check_method` tests one.
"""

from __future__ import annotations

import inspect
from typing import Any

from calibnet.calibrator import Calibrator
from calibnet.errors import ConfigError
from calibnet.geometry import MiscalibrationRange
from calibnet.runtime.plugins import Registry

CASCADE = "cascade"
"""Name of the cascade, which `calibnet.cascade.Cascade.load` opens."""
METHODS = Registry(
    "methods",
    "method",
    {
        "edge-alignment": "calibnet.methods.edge_alignment:EdgeAlignment",
        "regnet": "calibnet.methods.learned.method:RegNetMethod",
        "calibnet": "calibnet.methods.learned.method:CalibNetMethod",
        "lccnet": "calibnet.methods.learned.method:LCCNetMethod",
        "calibformer": "calibnet.methods.learned.method:CalibFormerMethod",
        "information-distance": "calibnet.methods.information_distance:InformationDistance",
        "calib-anything": "calibnet.methods.calib_anything:CalibAnything",
        "pcba": "calibnet.methods.pcba:PCBA",
    },
)


def open_method(name: str, range_: MiscalibrationRange, **options: Any) -> Calibrator:
    """A method by name, ready to use.

    Args:
        name: one of ``METHODS.names()``.
        range_: range of the miscalibrations to expect.
        **options: its options; those that are None or False are not passed on.

    Raises:
        ConfigError: there is no such method, its package is broken, or it has no such option.
        WeightsError: it needs weights that do not exist.
    """
    maker = METHODS.load(name)
    asked = {option: value for option, value in options.items() if value is not None and value is not False}
    for option in asked:
        if not accepts(maker, option):
            raise ConfigError(f"--{option.replace('_', '-')} does not apply to the method {name!r}; leave it out.")
    try:
        inspect.signature(maker).bind(range_, **asked)
    except TypeError as error:
        raise ConfigError(f"The method {name!r} cannot be made with a range ({error}); update its package.") from None
    method: Calibrator = maker(range_, **asked)
    return method


def accepts(maker: Any, option: str) -> bool:
    """Whether a method has an option."""
    parameters = inspect.signature(maker).parameters
    return option in parameters or any(one.kind is one.VAR_KEYWORD for one in parameters.values())

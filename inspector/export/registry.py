"""The export formats by name, including those that other packages register as ``calib_inspect.exports``.

A format is a function from `inspector.export.exported.Exported` to the text of a file;
`inspector.export.conformance.check_export_format` tests one. A new one of ours needs one line in `FORMATS`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from calibnet.errors import ConfigError
from calibnet.runtime.plugins import Registry
from calibnet.runtime.text import one_line
from calibnet.runtime.writing import Kind

if TYPE_CHECKING:
    from inspector.export.exported import Exported

FORMATS = Registry(
    "exports",
    "export format",
    {
        "kitti": "inspector.export.formats:as_kitti",
        "ros": "inspector.export.formats:as_ros",
        "opencv": "inspector.export.formats:as_opencv",
        "json": "inspector.export.formats:as_json",
        "yaml": "inspector.export.formats:as_calibration",
        "urdf": "inspector.export.robots:as_urdf",
        "autoware": "inspector.export.robots:as_autoware",
        "koide3": "inspector.export.robots:as_koide3",
    },
)
SUFFIXES = {"json": "json", "koide3": "json", "urdf": "urdf"} | dict.fromkeys(
    ("ros", "yaml", "opencv", "autoware"), "yaml"
)
"""File name suffixes by format."""


def suffix_of(form: str) -> str:
    """The file name suffix of a format, without the dot."""
    return SUFFIXES.get(form, "txt")


def kind_of_export(text: str) -> Kind:
    """The kind of an exported file, by its text, as `calibnet.runtime.writing` knows kinds."""
    return Kind.JSON if text.startswith("{") else Kind.EXPORT


def export_as(name: str, exported: Exported) -> str:
    """A calibration as the text of a file.

    Args:
        name: name of the format, one of ``FORMATS.names()``.
        exported: the calibration.

    Raises:
        ConfigError: there is no such format, or its package is broken.
    """
    text = FORMATS.load(name)(replace(exported, origin=one_line(exported.origin)))
    if not isinstance(text, str):
        raise ConfigError(
            f"The export format {name!r} returns {type(text).__name__} instead of text; update its package."
        )
    return text

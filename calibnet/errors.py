"""Errors a user can act on: one sentence that says what is wrong, where, and what to do."""

from __future__ import annotations


class CalibnetError(Exception):
    """Base of every error caused by input or environment rather than by a bug.

    The message is one complete sentence for the user; the command line prints it without a
    traceback and exits non-zero.
    """


class DatasetError(CalibnetError):
    """A folder, frame or calibration file is missing, malformed or inconsistent."""


class ImplausibleError(DatasetError):
    """Input that can be read but cannot be right, for instance a focal length in millimetres.

    Attributes:
        cause: short name of the cause for machines, for instance ``"focal-length"``; see
            `calibnet.datasets.plausibility`.
    """

    def __init__(self, message: str, cause: str = "") -> None:
        super().__init__(message)
        self.cause = cause


class WeightsError(CalibnetError):
    """A weights file is missing, foreign, truncated or of another preset."""


class ConfigError(CalibnetError):
    """A preset or an option has a value that cannot be used."""


class CalibrationError(CalibnetError):
    """A frame cannot be calibrated, for instance because no LiDAR point falls into the image."""

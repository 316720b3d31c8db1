"""Calibration files: our ``calibration.yaml`` and those of other tools, recognised by their content."""

from calibnet.datasets.calibration_files.calibration_file import BY_NAME, CalibrationFile, FrameChoice, Wanted
from calibnet.datasets.calibration_files.recognise import names_cameras, read_calibration

__all__ = ["BY_NAME", "CalibrationFile", "FrameChoice", "Wanted", "names_cameras", "read_calibration"]

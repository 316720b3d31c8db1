"""Whether a calibration is good, and what is wrong where it is not."""

"""The KITTI datasets, one module per layout; `calibration` has what they share."""

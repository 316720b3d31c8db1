"""The KITTI datasets, one module per layout, with shared functions in `calibration`."""

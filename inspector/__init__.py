"""Look into a running calibration: recordings, views and the command line."""

"""Files of point clouds: `scans.read_scan` reads any of them, one module per format."""

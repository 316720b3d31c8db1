"""Files of point clouds, with one module per format; `scans.read_scan` reads all of them."""

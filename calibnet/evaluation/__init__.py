"""How good a calibration is: error metrics, and the runner that measures a cascade with them."""

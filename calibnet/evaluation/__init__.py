"""How good a calibration is: `measure` gives the figures that documents quote, `benchmark` the milliseconds."""

"""The main loop: where calibrations start, frames in, recording out, a summary at the end."""

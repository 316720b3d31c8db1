"""Training samples made as tensors on the device that trains, from frames that all lie there.

The rest of `calibnet.training` makes a sample at a time with NumPy and OpenCV, on any number of processes of the CPU;
beside a GPU these cannot keep up. Both draw the same numbers for a sample (`draws`), and its projection, z-buffer and
labels are the same up to rounding, as tests show; pictures differ by how they are averaged when made smaller.
"""

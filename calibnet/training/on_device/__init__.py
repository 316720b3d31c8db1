"""Makes training samples as tensors on the device that trains, from frames that are all kept there.

The rest of `calibnet.training` makes one sample at a time with NumPy and OpenCV, in any number of processes on the CPU,
which cannot keep up with a GPU. Both draw the same random numbers for a sample (`draws`). Projection, z-buffer and
labels are the same up to rounding, as tests show; images differ in how pixels are averaged when they are made smaller.
"""

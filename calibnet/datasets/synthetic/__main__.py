"""``python -m calibnet.datasets.synthetic [FRAMES]``: measures the CPU time of a training frame."""

from __future__ import annotations

import sys
import time

import numpy as np

from calibnet.datasets.synthetic.render import sample_frame


def main(frames: int = 40) -> None:
    """Render training frames and print the time per frame."""
    sample_frame(0)  # the atlas and the prototypes are built once a process
    spent = []
    for seed in range(1, frames + 1):
        start = time.process_time()
        sample_frame(seed)
        spent.append(1e3 * (time.process_time() - start))
    middle, high = np.percentile(spent, [50, 95])
    sys.stdout.write(f"{frames} frames: median {middle:.0f} ms, 95 % below {high:.0f} ms of CPU time\n")


if __name__ == "__main__":
    main(*(int(argument) for argument in sys.argv[1:2]))

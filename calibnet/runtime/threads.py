"""The number of threads of this process, where several processes share a machine."""

from __future__ import annotations

import os


def limit_threads(count: int) -> None:
    """Limit the threads of torch and OpenCV; libraries that follow OMP_NUM_THREADS must be limited before they load."""
    import cv2
    import torch

    torch.set_num_threads(count)
    cv2.setNumThreads(count)


def cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1

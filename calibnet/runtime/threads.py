"""How many threads this process computes with, where several processes share a machine."""

from __future__ import annotations

import os


def limit_threads(count: int) -> None:
    """Let torch and OpenCV use so many threads; what else follows OMP_NUM_THREADS has to be told before it starts."""
    import cv2
    import torch

    torch.set_num_threads(count)
    cv2.setNumThreads(count)


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1

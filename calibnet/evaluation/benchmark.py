"""Measures the time that a cascade takes, by part, by stage and by frame, as medians of many runs."""

from __future__ import annotations

import platform
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import torch

from calibnet.cascade import Cascade, Stage
from calibnet.datasets import Frame
from calibnet.datasets.images.files import resize_image
from calibnet.evaluation import reference
from calibnet.evaluation.runner import draw_miscalibration
from calibnet.network.batch import lidar_input, make_batch
from calibnet.runtime.precision import autocast, has_fast_bf16
from calibnet.runtime.threads import cores

BATCHES = (1, 4)
"""Batch sizes at which the throughput of the networks is measured."""
WARM_UP = 3
"""Number of runs that do not count, in which memory is allocated and kernels are chosen."""


@dataclass(frozen=True)
class StageTime:
    """The times of one stage.

    Attributes:
        number: number of the stage, 1 to 5.
        range: its range as text, for instance ``"5/0.5"``.
        milliseconds: median per frame.
        parts: medians by part: projection, lidar_features, cost_volumes, hourglass, displacement, pose.
        batches: milliseconds per frame of the network alone, image features included, by batch size.
    """

    number: int
    range: str
    milliseconds: float
    parts: dict[str, float]
    batches: dict[int, float]


@dataclass(frozen=True)
class Benchmark:
    """The measured times, and the machine they were measured on.

    Attributes:
        cascade: median milliseconds from frame to extrinsic through all stages.
        shared: medians of what is done once per frame: preparation, resizing and image features that stages share.
        stages: the times of each stage.
        reference: median milliseconds of one network of `calibnet.evaluation.reference`, timed in turn with ours.
        frames: number of runs in the medians.
        machine: CPU or GPU, threads and precision.
    """

    cascade: float
    shared: dict[str, float]
    stages: tuple[StageTime, ...]
    reference: float
    frames: int
    machine: dict[str, Any]

    @property
    def parts(self) -> dict[str, float]:
        """Medians by part, summed over the stages, with the shared parts."""
        total = dict(self.shared)
        for stage in self.stages:
            for part, milliseconds in stage.parts.items():
                total[part] = total.get(part, 0.0) + milliseconds
        return total

    @property
    def ratio(self) -> float:
        """Time of the whole cascade, projection and verdict included, relative to the five reference networks."""
        return self.cascade / (reference.STAGES * self.reference)

    def as_dict(self) -> dict[str, Any]:
        """The form that JSON files hold."""
        return {
            "cascade_ms_per_frame": self.cascade,
            "reference_ms_per_stage": self.reference,
            "ratio": self.ratio,
            "parts_ms_per_frame": self.parts,
            "shared_ms_per_frame": self.shared,
            "stages": [
                {
                    "number": stage.number,
                    "range": stage.range,
                    "ms_per_frame": stage.milliseconds,
                    "parts_ms_per_frame": stage.parts,
                    "batch_ms_per_frame": {str(size): value for size, value in stage.batches.items()},
                }
                for stage in self.stages
            ],
            "frames": self.frames,
            **self.machine,
        }


def benchmark(
    cascade: Cascade, frames: list[Frame], repeats: int, observer: Callable[[], None] | None = None
) -> Benchmark:
    """Run every frame ``repeats`` times from miscalibrations of the first stage's range, then the networks in batches.

    Args:
        cascade: the cascade to time.
        frames: frames of one camera, in memory, so that no reading is timed.
        repeats: number of runs per frame.
        observer: called after every run.
    """
    range_ = cascade.stages[0].range
    totals: list[float] = []
    references: list[float] = []
    traces = []
    run_reference = reference.reference_run(cascade.device)
    for run in range(WARM_UP + repeats * len(frames)):
        frame = frames[run % len(frames)]
        initial = draw_miscalibration(range_, 0, run, 0) @ frame.camera_from_lidar
        started = time.perf_counter()
        trace = cascade.calibrate(frame, initial)
        elapsed, compared = 1000 * (time.perf_counter() - started), run_reference()
        if run >= WARM_UP:
            totals.append(elapsed)
            references.append(compared)
            traces.append(trace)
        if observer is not None:
            observer()
    stages = []
    for position, stage in enumerate(cascade.stages):
        timed = [trace.stages[position].milliseconds for trace in traces]
        parts = {part: median(times[part] for times in timed) for part in timed[0]}
        whole = median(sum(times.values()) for times in timed)
        batches = {size: batch_time(cascade, stage, frames, size) for size in BATCHES}
        stages.append(StageTime(stage.number, str(stage.range), whole, parts, batches))
    shared = {part: median(trace.milliseconds[part] for trace in traces) for part in traces[0].milliseconds}
    machine = describe_machine(cascade.device)
    return Benchmark(median(totals), shared, tuple(stages), median(references), len(totals), machine)


def batch_time(cascade: Cascade, stage: Stage, frames: list[Frame], size: int) -> float:
    """Median milliseconds per frame of a stage's network on batches of ``size`` frames."""
    chosen = [frames[number % len(frames)] for number in range(size)]
    cameras = [stage.camera(frame) for frame in chosen]
    scans = [
        lidar_input(frame.points, frame.camera_from_lidar, camera, stage.network.config.scales)
        for frame, camera in zip(chosen, cameras, strict=True)
    ]
    images = np.stack([resize_image(frame.image, camera) for frame, camera in zip(chosen, cameras, strict=True)])
    image = torch.from_numpy(images).permute(0, 3, 1, 2).to(cascade.device)
    inputs = make_batch(image, scans, [camera.matrix for camera in cameras])
    times = []
    with torch.inference_mode(), autocast(cascade.device):
        for run in range(WARM_UP + 5):
            started = time.perf_counter()
            correction = stage.network(inputs).pose.correction
            correction.cpu()  # waits for a GPU
            if run >= WARM_UP:
                times.append(1000 * (time.perf_counter() - started) / size)
    return median(times)


def describe_machine(device: torch.device) -> dict[str, Any]:
    """Properties of the machine and the installation that times depend on."""
    return {
        "device": torch.cuda.get_device_name(device) if device.type == "cuda" else processor(),
        "instructions": torch.backends.cpu.get_cpu_capability(),
        "threads": torch.get_num_threads(),
        "cores": cores(),
        "precision": "bf16" if has_fast_bf16(device) else "float32",
        "torch": torch.__version__,
    }


def processor() -> str:
    """The CPU's name."""
    information = Path("/proc/cpuinfo")
    if information.is_file():
        found = re.search(r"^model name\s*:\s*(.+)$", information.read_text(), re.MULTILINE)
        if found:
            return found[1]
    return platform.processor() or platform.machine()

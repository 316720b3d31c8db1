"""Record a sequence as long as KITTI's longest at overview detail, and print memory, size and speed on the way.

    python -m tests.inspector.record.long_run [--frames 4541] [--detail overview] [--small] [--output FILE.rrd]

A few fake frames of KITTI's size are calibrated once and recorded again and again under rising
numbers, so that the figures are those of the recording alone. With ``--small``, frames of 240 x 72 after one stage.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import psutil

from calibnet.geometry import MiscalibrationRange
from inspector.record.contents import Contents, Detail
from inspector.record.observation import Layout, Observation
from inspector.record.outputs import Outputs
from inspector.record.recording import Recording, RunDescription
from inspector.run.start import Start
from tests.support.fakes import FakeCascade, make_frame

VARIANTS = 6
REPORTS = 20


def observations(small: bool) -> list[Observation]:
    """A few frames, of KITTI's size with five stages or small with one."""
    start, made = Start(MiscalibrationRange(20, 1.5), seed=1), []
    cascade = FakeCascade((5,), strides=(32,)) if small else FakeCascade((1, 2, 3, 4, 5))
    for index in range(VARIANTS):
        width, height, points = (240, 72, 2_000) if small else (1242, 375, 60_000)
        frame = make_frame(index, width=width, height=height, points=points)
        made.append(Observation(frame, cascade.calibrate(frame, start.initial(frame)), frame.camera_from_lidar))
    return made


def at(observation: Observation, index: int) -> Observation:
    """The same observation as another frame; nothing it has computed is kept."""
    frame: Any = replace(observation.frame, index=index, timestamp=0.1 * index)
    return Observation(frame, observation.trace, observation.reference)


def main() -> None:
    """Record and print one line for every twentieth of the run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=4541)
    parser.add_argument("--detail", choices=["overview", "full"], default="overview")
    parser.add_argument("--small", action="store_true")
    parser.add_argument("--output", type=Path, default=Path(tempfile.gettempdir()) / "long_run.rrd")
    options = parser.parse_args()
    prepared, process = observations(options.small), psutil.Process()
    layout = Layout.of(prepared[0], Contents.of(Detail(options.detail)))
    every = max(1, options.frames // REPORTS)
    started, cpu = time.monotonic(), time.process_time()
    recording = Recording(Outputs(options.out).open(), RunDescription("long run", {"seed": 0}), layout)
    for index in range(options.frames):
        recording.log(at(prepared[index % VARIANTS], index))
        if (index + 1) % every == 0 or index + 1 in (100, 500, 1000, options.frames):
            line = (
                f"{index + 1:5d} frames  {process.memory_info().rss / 1e6:5.0f} MB RSS  "
                f"{options.out.stat().st_size / 1e6:6.0f} MB on disk  "
                f"{(index + 1) / (time.monotonic() - started):5.1f} frames/s wall  "
                f"{(index + 1) / (time.process_time() - cpu):5.1f} frames/s of CPU time"
            )
            print(line, flush=True)  # noqa: T201
    began, largest = time.monotonic(), [0]
    recording.close(lambda: largest.append(max(process.memory_info().rss, largest.pop())))
    print(  # noqa: T201
        f"closed in {time.monotonic() - began:.0f} s: at most {largest[0] / 1e6:.0f} MB RSS, "
        f"{options.out.stat().st_size / 1e6:.0f} MB on disk"
    )


if __name__ == "__main__":
    main()

"""What to do next about a result that is not accepted; docs/own-sensors.md, "It says cannot tell", has what helped."""

from __future__ import annotations

from calibnet.geometry import RANGES, MiscalibrationRange

MORE_FRAMES = "Several frames of different places, solved together as one drive, give a more accurate result."
"""For a single frame."""
MORE_PLACES = (
    "Use more frames, some dozens, of different places, or judge several drives on this mount together "
    "(calib-inspect fleet)."
)
"""For a drive whose frames fit."""
MORE_DRIVES = "Judge several drives on this mount together (calib-inspect fleet)."
"""For one that has so many frames that more of them would not help."""
RICHER_SCENE = "Take frames in which poles, cars or walls stand at several distances."
"""For frames whose matches determine nothing."""
SUSPECTS = "check the camera matrix, the lens and the time stamps"
"""What makes frames contradict one another, and results leave the range."""
SCATTER = f"Add frames of other places; if that does not help, {SUSPECTS}."
"""For a drive whose frames contradict one another."""
CONTRADICTION = f"Look at a recording (--save FILE.rrd), and {SUSPECTS}."
"""For a drive whose motion contradicts its frames."""
CORRECT_IT = "Correct it: run the same command without `verify`, and export the result (calib-inspect export)."
"""For a calibration that is off from a result which is certain."""
LOOK_AT_BOTH = (
    "Look at both in a recording (--save FILE.rrd); if the result fits better, run the same command without `verify` "
    "and export it."
)
"""For a calibration that is far from a result which is not certain itself."""
NARROWER = "More frames of different places make the result more certain."
"""For a calibration that may be within the tolerance or not."""


def out_of_range(searched: MiscalibrationRange) -> str:
    """For a result beyond the range that was searched, which only a wider search or the input can explain."""
    if searched == RANGES[0]:
        return f"{SUSPECTS[0].upper()}{SUSPECTS[1:]}."
    return f"If the start may be that far off, run all stages (--stages 1-5); if it cannot be, {SUSPECTS}."

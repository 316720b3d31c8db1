"""Results that papers report of their own methods, to compare with those measured here.

They were measured on other frames, mostly of the rig that was trained on. Only figures that were found in print are
here: means, unless the rig says otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

KITTI_OWN = "KITTI, the car that it was trained on"
HAN = "its paper, as quoted by Han et al. (2025), table 2"
PROJFUSION = "ProjFusion (2026), which trained and tested all in one rig"


@dataclass(frozen=True)
class Published:
    """A published result.

    Attributes:
        range: range of the miscalibrations, as far as the source gives it.
        rotation_deg: rotation error in degrees.
        translation_cm: translation error in centimetres.
        rig: rig or frames that it was measured on.
        source: publication with the result.
    """

    range: str
    rotation_deg: float
    translation_cm: float
    rig: str
    source: str

    def as_dict(self) -> dict[str, Any]:
        """The content of JSON files."""
        return dict(vars(self))


PUBLISHED: dict[str, tuple[Published, ...]] = {
    "cascade": (
        Published("±0.25 m", 0.138, 1.101, KITTI_OWN, "Han et al. (2025), table 2, whose method the cascade follows"),
        Published("±1.5 m", 0.020, 0.278, KITTI_OWN, "Han et al. (2025), table 2, whose method the cascade follows"),
    ),
    "regnet": (Published("±20° / 1.5 m", 0.28, 6.0, KITTI_OWN, HAN),),
    "calibnet": (
        Published("±0.2 m", 0.41, 4.34, KITTI_OWN, HAN),
        Published("10° / 25 cm", 2.28, 6.47, "KITTI odometry 13-16, 18; RMSE of the angle", PROJFUSION),
    ),
    "lccnet": (
        Published("±1.5 m", 0.017, 0.297, KITTI_OWN, HAN),
        Published("10° / 25 cm", 2.50, 6.08, "KITTI odometry 13-16, 18; one network; RMSE of the angle", PROJFUSION),
    ),
    "calibformer": (
        Published("±0.25 m", 0.141, 1.188, KITTI_OWN, HAN),
        Published("a range not given", 0.0562, 0.8751, KITTI_OWN, "its abstract (ICRA 2024)"),
    ),
    "calib-anything": (
        Published("±0.2 m", 0.136, 1.027, "KITTI", HAN),
        Published("10° / 25 cm", 5.32, 28.2, "KITTI odometry 13-16, 18; RMSE of the angle", PROJFUSION),
        Published("a range not given", 0.299, 12.08, "KITTI", "another paper's table (PMC13006848)"),
    ),
    "pcba": (Published("±1.5 m", 0.019, 0.305, "frames not named", HAN),),
    "information-distance": (
        Published("10° / 25 cm", 13.1, 147.0, "KITTI odometry 13-16, 18; single shot; RMSE of the angle", PROJFUSION),
        Published("a range not given", 5.02, 8.91, "KITTI", "another paper's table (PMC13006848)"),
    ),
}
"""Published results by the name of the method."""


class PublishedAblation(NamedTuple):
    """A row of the paper's ablation (its Table 3), on its machine and its own car's frames.

    Attributes:
        parameters_m: parameters in millions.
        flops_g: FLOPs of the paper in 1e9; the numbers are those of multiply-adds.
        latency_ms: latency on the paper's GPU.
        translation_cm: translation error in centimetres.
        rotation_deg: rotation error in degrees.
    """

    parameters_m: float
    flops_g: float
    latency_ms: float
    translation_cm: float
    rotation_deg: float


PUBLISHED_ABLATION = {
    "multi-scale-features": PublishedAblation(18.7, 62.5, 17.5, 1.058, 0.084),
    "multi-scale-volumes": PublishedAblation(19.1, 63.8, 18.8, 1.213, 0.099),
    "aggregation": PublishedAblation(19.4, 70.5, 19.5, 1.151, 0.093),
    "hierarchical-fusion": PublishedAblation(18.8, 61.1, 18.4, 0.930, 0.078),
    "hybrid-loss": PublishedAblation(20.2, 77.4, 22.6, 0.997, 0.074),
    "full": PublishedAblation(20.5, 78.3, 23.3, 0.864, 0.068),
}
"""The rows of the paper by the names in `calibnet.training.ablations.ABLATIONS`."""

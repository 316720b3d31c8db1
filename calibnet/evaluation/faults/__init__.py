"""What can be wrong with input that can still be read: each fault as a function of a frame."""

from calibnet.evaluation.faults.alteration import NATIVE_WIDTH, Alteration, unaltered
from calibnet.evaluation.faults.camera import distorted, equidistant, focal, matrix_of_size, principal
from calibnet.evaluation.faults.picture import (
    blurred,
    exposed,
    grey,
    high_byte,
    low_byte,
    mirrored,
    picture_of,
    rolled,
    shifted,
)
from calibnet.evaluation.faults.scan import (
    AXES,
    accumulated,
    flipped,
    glint,
    half_missing,
    noisy,
    reflecting,
    scaled_scan,
    scan_at,
    thinned,
    turned,
)

__all__ = [
    "AXES",
    "Alteration",
    "NATIVE_WIDTH",
    "accumulated",
    "blurred",
    "distorted",
    "equidistant",
    "exposed",
    "flipped",
    "focal",
    "glint",
    "grey",
    "half_missing",
    "high_byte",
    "low_byte",
    "matrix_of_size",
    "mirrored",
    "noisy",
    "picture_of",
    "principal",
    "reflecting",
    "rolled",
    "scaled_scan",
    "scan_at",
    "shifted",
    "thinned",
    "turned",
    "unaltered",
]

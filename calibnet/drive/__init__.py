"""One extrinsic from all frames of a drive."""

"""Alignment without training: edges of the scan with edges of the image, and reflectance with brightness.

This is ours, not the paper's. Networks leave a bias that all frames of a drive share. Evidence measured in the images
themselves has other errors, so both together come closer than either. It reaches only some pixels, so the cascade has
to correct a drive first.
"""

from calibnet.alignment.evidence import Evidence, gather, image_camera
from calibnet.alignment.solve import align

__all__ = ["Evidence", "align", "gather", "image_camera"]

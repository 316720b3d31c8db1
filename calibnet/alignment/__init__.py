"""Alignment without training: edges of the scan onto edges of the picture, reflectance onto brightness.

Ours, not the paper's. Networks leave a bias that all frames of a drive share; what is measured here in the
pictures themselves knows nothing of any training, so that together they come closer than either. It sees no
farther than some pixels: a drive has to be corrected by the cascade first.
"""

from calibnet.alignment.evidence import Evidence, gather, picture_camera
from calibnet.alignment.solve import align

__all__ = ["Evidence", "align", "gather", "picture_camera"]

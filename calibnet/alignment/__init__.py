"""Alignment without training: edges of the scan onto edges of the picture, reflectance onto brightness.

This is ours, not the paper's. Networks leave a bias that all frames of a drive share; evidence measured in the pictures
themselves has other errors, so that both together come closer than either. It sees no farther than some pixels: a drive
has to be corrected by the cascade first.
"""

from calibnet.alignment.evidence import Evidence, gather, picture_camera
from calibnet.alignment.solve import align

__all__ = ["Evidence", "align", "gather", "picture_camera"]

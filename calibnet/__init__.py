"""Camera-LiDAR extrinsic calibration with a five-stage cascade of learned networks.

The names of the public interface are imported when first used, so that importing the package itself costs nothing::

    import calibnet

    drive = calibnet.open_sequence("folder", "my_car")
    trace = calibnet.Cascade.load().calibrate(drive[0], drive[0].camera_from_lidar)
"""

from typing import TYPE_CHECKING

from calibnet.runtime.lazy import lazy_names

if TYPE_CHECKING:
    from calibnet.cascade import Cascade as Cascade
    from calibnet.datasets import Frame as Frame
    from calibnet.datasets import Sequence as Sequence
    from calibnet.datasets import open_sequence as open_sequence
    from calibnet.errors import CalibnetError as CalibnetError
    from calibnet.geometry import MiscalibrationRange as MiscalibrationRange
    from calibnet.geometry import PinholeCamera as PinholeCamera
    from calibnet.geometry import miscalibration as miscalibration
    from calibnet.geometry import pose_error as pose_error
    from calibnet.geometry import sample_miscalibration as sample_miscalibration
    from calibnet.trace import CascadeTrace as CascadeTrace
    from calibnet.trace import DriveEstimate as DriveEstimate

__version__ = "0.1.0"

_MODULES = {
    "Cascade": "calibnet.cascade",
    "CalibnetError": "calibnet.errors",
    "CascadeTrace": "calibnet.trace",
    "DriveEstimate": "calibnet.trace",
    "Frame": "calibnet.datasets",
    "MiscalibrationRange": "calibnet.geometry",
    "PinholeCamera": "calibnet.geometry",
    "Sequence": "calibnet.datasets",
    "miscalibration": "calibnet.geometry",
    "open_sequence": "calibnet.datasets",
    "pose_error": "calibnet.geometry",
    "sample_miscalibration": "calibnet.geometry",
}

__all__ = sorted(_MODULES)
__getattr__, __dir__ = lazy_names("calibnet", _MODULES, "__version__")

"""The five-stage cascade (paper section 3.5): `cascade` runs the stages, `stage` looks at a frame with one of them.

`loading` reads them.
"""

from calibnet.cascade.cascade import Cascade
from calibnet.cascade.loading import SkippedStage
from calibnet.cascade.stage import Stage

__all__ = ["Cascade", "SkippedStage", "Stage"]

"""The types that can be trained: a stage of the cascade, or another paper's network as a stage."""

from __future__ import annotations

from typing import TypeAlias

from calibnet.cascade.stage import Stage
from calibnet.methods.learned.config import MethodConfig
from calibnet.methods.learned.network import MethodNetwork
from calibnet.methods.learned.stage import MethodStage
from calibnet.network.config import NetworkConfig
from calibnet.network.network import CalibrationNetwork

TrainedNetwork: TypeAlias = CalibrationNetwork | MethodNetwork
TrainedStage: TypeAlias = Stage | MethodStage
TrainedConfig: TypeAlias = NetworkConfig | MethodConfig

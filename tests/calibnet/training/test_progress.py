from __future__ import annotations

import math

import torch

from calibnet.training.losses import Losses
from calibnet.training.progress import Means


def features_alone(matching: float) -> Losses:
    return Losses(*(torch.tensor(value) for value in (matching, 0.0, 0.0, 0.0, 0.0, math.nan, math.nan)))


def whole(rotation_deg: float) -> Losses:
    return Losses(*(torch.tensor(value) for value in (4.0, 0.5, 0.3, 0.2, 0.1, rotation_deg, 20.0)))


def test_batches_of_features_alone_leave_the_mean_error_of_the_others() -> None:
    means = Means()
    for losses in (whole(1.0), features_alone(2.0), whole(2.0)):
        means.add(losses)
    taken = means.take()
    assert taken["rotation_deg"] == 1.5 and taken["translation_cm"] == 20.0
    assert taken["matching"] == (4.0 + 2.0 + 4.0) / 3


def test_no_pose_is_told_where_features_trained_alone_all_the_time() -> None:
    means = Means()
    means.add(features_alone(2.0))
    taken = means.take()
    assert taken["matching"] == 2.0 and math.isnan(taken["rotation_deg"])

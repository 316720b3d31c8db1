from __future__ import annotations

import json
from dataclasses import asdict
from typing import Any

import pytest

from calibnet.errors import ConfigError
from calibnet.network.config import load_preset, parse_config, preset_names
from tests.support.tiny import TINY


def test_presets_are_named_in_the_error() -> None:
    assert preset_names() == ["compact", "paper"]
    with pytest.raises(ConfigError, match="'big' is not a preset; choose from compact, paper"):
        load_preset("big")


@pytest.mark.parametrize("name", ["compact", "paper"])
def test_presets_survive_json_as_in_a_weights_header(name: str) -> None:
    config = load_preset(name)
    assert parse_config(json.loads(json.dumps(asdict(config))), "header") == config


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"colour": 3}, "colour is unknown"),
        ({"radius": 3}, "radius must be even"),
        ({"radius": 0}, "radius: input should be greater than or equal to 2"),
        ({"blocks": [1, 2]}, "widths and blocks"),
        ({"scales": [8, 32]}, "twice the previous one"),
        ({"scales": [6, 12]}, "powers of two"),
        ({"scales": [32, 64]}, "powers of two"),
        ({"scales": []}, "must be at least one scale"),
        ({"groups": 3}, "groups must divide"),
        ({"hourglasses": 0}, "switch `aggregation` off"),
        ({"volume_channels": [8, 8]}, "volume_channels"),
        ({"hourglass_blocks": [1, 1, 1]}, "hourglass_blocks"),
        ({"head": "transformer"}, "geometric, regression"),
        ({"normalization": "layer"}, "normalization: input should be 'group' or 'batch'"),
        ({"image_encoder": "resnet"}, "image_encoder: input should be 'own' or 'efficientnet-lite0'"),
        ({"widths": 8}, "mine.toml"),
    ],
)
def test_wrong_values_are_named(change: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError, match=said) as raised:
        parse_config(asdict(TINY) | change, "mine.toml")
    assert str(raised.value).endswith(".") and "\n" not in str(raised.value)


def test_missing_keys_are_named() -> None:
    values = asdict(TINY)
    del values["radius"], values["head"]
    with pytest.raises(ConfigError, match=r"mine.toml: radius is missing.*head is missing"):
        parse_config(values, "mine.toml")

"""Every pose head keeps to the interface; one of another package is a head like ours."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from calibnet.conformance import check_head
from calibnet.errors import ConfigError
from calibnet.network.heads import HEADS
from tests.support.tiny import TINY, random_inputs, tiny_network
from tests.support.toy_package import install_toys


@pytest.mark.parametrize("name", HEADS.own)
def test_heads_keep_their_promises(name: str) -> None:
    check_head(HEADS.load(name), TINY)


def test_a_head_of_another_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install_toys(tmp_path, monkeypatch)
    network = tiny_network(head="still")
    assert torch.equal(network(random_inputs(TINY)).pose.correction, torch.eye(4)[None])
    with pytest.raises(ConfigError, match=r"head must be one of geometric, regression, broken, still\."):
        replace(TINY, head="none")
    with pytest.raises(ConfigError, match="pose head 'broken' of package broken_package"):
        tiny_network(head="broken")

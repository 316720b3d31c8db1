"""Checkpoints: what is restored goes on as if nothing had happened, with fused steps and channels-last weights too."""

from __future__ import annotations

from pathlib import Path

import torch
from torch import nn

from calibnet.training.checkpoint import read_checkpoint, restore, save_checkpoint


def network() -> tuple[nn.Module, torch.optim.AdamW]:
    torch.manual_seed(3)
    model = nn.Sequential(nn.Conv2d(3, 4, 3), nn.Conv2d(4, 2, 1)).to(memory_format=torch.channels_last)
    return model, torch.optim.AdamW(model.parameters(), lr=0.1, fused=True)


def step(model: nn.Module, optimizer: torch.optim.AdamW, seed: int) -> None:
    image = torch.randn(2, 3, 8, 8, generator=torch.Generator().manual_seed(seed))
    optimizer.zero_grad()
    model(image.to(memory_format=torch.channels_last)).square().mean().backward()
    optimizer.step()


def test_fused_steps_go_on_after_a_checkpoint_as_they_would_have_without(tmp_path: Path) -> None:
    model, optimizer = network()
    step(model, optimizer, 0)
    save_checkpoint(tmp_path / "a.checkpoint", model, model, optimizer, {"steps": 1, "seconds": 1.0, "options": {}})
    again, its_optimizer = network()
    restore(read_checkpoint(tmp_path / "a.checkpoint")[0], again, again, its_optimizer)
    for parameter, moments in its_optimizer.state.items():
        assert moments["exp_avg"].stride() == moments["exp_avg_sq"].stride() == parameter.stride()
    step(model, optimizer, 1)
    step(again, its_optimizer, 1)
    for ours, theirs in zip(model.parameters(), again.parameters(), strict=True):
        assert torch.equal(ours, theirs)

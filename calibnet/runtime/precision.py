"""The fastest precision of convolutions on a device: bf16 if the hardware supports it, else single."""

from __future__ import annotations

import torch


def has_fast_bf16(device: torch.device) -> bool:
    """Whether convolutions in bf16 are faster than in single precision.

    A CPU without bf16 instructions (AVX2 laptops among them) emulates them, ten times slower than float32.
    """
    if device.type == "cuda":
        return bool(torch.cuda.is_bf16_supported(including_emulation=False))
    return device.type == "cpu" and bool(torch.cpu._is_avx512_bf16_supported() or torch.cpu._is_amx_tile_supported())


def fastest(device: torch.device) -> torch.dtype:
    """The precision in which convolutions are fastest on a device."""
    return torch.bfloat16 if has_fast_bf16(device) else torch.float32


def autocast(device: torch.device) -> torch.autocast:
    """Autocast to bf16 if that is faster, else disabled."""
    return torch.autocast(device.type, torch.bfloat16, enabled=has_fast_bf16(device))

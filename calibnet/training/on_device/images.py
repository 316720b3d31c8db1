"""The virtual camera and the exposure of a batch of images as tensor code."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from calibnet.training.on_device.draws import Exposures

GREY = (0.299, 0.587, 0.114)
"""Weights of red, green and blue in grey, as in OpenCV."""
INTERPOLATION = 1 / 6
"""Variance, in square pixels, of the blur that linear interpolation between two pixels causes, on average."""
AVERAGING = 1 / 12
"""Variance, in square pixels, of the average over one pixel."""


def sampled_at(shrinking: Tensor, count: int) -> Tensor:
    """Offsets ``[B, count]``, in pixels of the result from a pixel's middle, at which an image is sampled for it.

    The CPU's samples are made in two steps: OpenCV resizes the image, averaging pixels where it gets smaller, and the
    warp interpolates between the averages. Here one step interpolates in the original image. Averaged over samples this
    far apart, the result is as sharp.

    Args:
        shrinking: ``[B]`` pixels of the image per pixel of the result.
        count: 2, or more if images are made much smaller.
    """
    smaller = AVERAGING + INTERPOLATION * (1 - shrinking.clamp(min=1) ** -2)
    variance = torch.where(shrinking > 1, smaller, INTERPOLATION * (shrinking < 1))
    even = torch.linspace(-1, 1, count, device=shrinking.device) * (3 * (count - 1) / (count + 1)) ** 0.5
    return variance.sqrt()[:, None] * even


def warped(images: Tensor, to_image: Tensor, shrinking: Tensor, size: tuple[int, int], count: int = 2) -> Tensor:
    """Images as other cameras see them.

    Args:
        images: ``[B, H, W, 3]`` uint8.
        to_image: ``[B, 3, 3]`` homography from pixels of the result to pixels of the image.
        shrinking: ``[B]`` pixels of the image per pixel of the result.
        size: height and width of the result.
        count: samples of the image for each pixel of the result, along either axis.

    Returns:
        ``[B, 3, h, w]`` float32, whole numbers 0..255; black outside the image.
    """
    (height, width), device = size, images.device
    within = sampled_at(shrinking, count)

    def places(pixels: int) -> Tensor:
        return (torch.arange(pixels, device=device)[None, :, None] + within[:, None]).flatten(1)

    u, v = places(width)[:, None, :], places(height)[:, :, None]

    def row(number: int) -> Tensor:
        a, b, c = to_image[:, number, :, None, None].unbind(1)
        return a * u + b * v + c

    across, down, scale = row(0), row(1), row(2)
    grid = torch.stack(
        [(2 * across / scale + 1) / images.shape[2] - 1, (2 * down / scale + 1) / images.shape[1] - 1], dim=-1
    )
    sampled = F.grid_sample(images.permute(0, 3, 1, 2).float(), grid, align_corners=False)
    return F.avg_pool2d(sampled, count).round()


def exposed(images: Tensor, exposures: Exposures, generator: torch.Generator) -> Tensor:
    """`calibnet.training.augmentation.exposed` for a batch ``[B, 3, h, w]`` of values 0..255; returns uint8."""

    def of(values: Tensor) -> Tensor:
        return values.view(len(images), -1, 1, 1)

    pixels = images / 255
    grey = sum(share * pixels[:, channel : channel + 1] for channel, share in enumerate(GREY))
    pixels = torch.where(of(exposures.grey), grey, pixels)
    pixels = (pixels * of(exposures.tint)).clamp(0, 1) ** of(exposures.gamma)
    pixels = (pixels - 0.5) * of(exposures.contrast) + (0.5 + of(exposures.brightness))
    if len(exposures.blurred):
        pixels = pixels.index_copy(0, exposures.blurred, blurred(pixels[exposures.blurred], exposures.blur_px))
    noise = torch.randn(pixels.shape, generator=generator, device=pixels.device)
    pixels = pixels + of(exposures.noise) * noise
    return (pixels.clamp(0, 1) * 255 + 1e-3).to(torch.uint8)  # rounding must not lower a grey value by one


def blurred(pixels: Tensor, sigma: Tensor) -> Tensor:
    """Gaussian blur of ``[B, 3, h, w]`` with standard deviations ``[B]``, pixels."""
    radius = 5
    kernel = torch.exp(-0.5 * (torch.arange(-radius, radius + 1, device=pixels.device) / sigma[:, None]).square())
    kernel = (kernel / kernel.sum(1, keepdim=True)).repeat_interleave(3, dim=0, output_size=3 * len(pixels))
    flat = F.pad(pixels.flatten(0, 1)[None], [radius] * 4, mode="reflect")
    flat = F.conv2d(flat, kernel[:, None, :, None], groups=len(kernel))
    return F.conv2d(flat, kernel[:, None, None, :], groups=len(kernel))[0].view_as(pixels)

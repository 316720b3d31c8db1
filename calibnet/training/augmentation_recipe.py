"""The settings of `calibnet.training.augmentation`: parts of the `Recipe`, which explains pairs and shares."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CameraRecipe:
    """The virtual camera that sees a training frame."""

    mirrored: float = 0.5
    """Share of the frames that are mirrored, left to right."""
    zoom: tuple[float, float] = (0.85, 1.5)
    """Size of the image relative to the one that fills the input; its logarithm is drawn uniformly."""
    stretch: tuple[float, float] = (0.96, 1.04)
    """Factor on the horizontal focal length alone."""
    turned: float = 0.7
    """Share of the frames whose camera is turned about its centre."""
    turn_deg: tuple[float, float, float] = (2.0, 3.0, 2.0)
    """Standard deviations of this rotation about the camera's x, y and z axes, degrees."""
    turn_most_deg: float = 8.0
    """Largest rotation about any of these axes, degrees."""


@dataclass(frozen=True)
class ScanRecipe:
    """The scanner: fewer beams, fewer points, another reach, noise and another response of the receiver."""

    banded: float = 0.4
    """Share of the scans that keep one of several bands of elevation, as a scanner with fewer beams does."""
    band_deg: tuple[float, float] = (0.35, 0.6)
    """Width of a band, degrees."""
    bands: tuple[int, int] = (2, 4)
    """Smallest and largest n, where one of n neighbouring bands is kept."""
    tilt_deg: float = 6.0
    """Standard deviation of the tilt of this scanner about its x and y axes, degrees."""
    upended: float = 0.1
    """Share of these scanners whose axis points forward instead of up, so that their rings run around the view."""
    apart_m: float = 0.3
    """Standard deviation of this scanner's distance from the true one along each axis, metres."""
    thinned: float = 0.5
    """Share of the scans that lose points at random."""
    kept: tuple[float, float] = (0.15, 1.0)
    """Share of their points that these keep."""
    shortened: float = 0.2
    """Share of the scans that lose all points beyond a distance."""
    reach_m: tuple[float, float] = (25.0, 80.0)
    """This distance, metres."""
    range_noise: float = 0.001
    """Standard deviation of a point's distance, relative to it."""
    dark: float = 0.3
    """Share of the scans without intensity."""
    response: tuple[float, float] = (0.5, 1.6)
    """Factor on the intensity of the others."""
    response_gamma: tuple[float, float] = (0.6, 1.6)
    """Exponent applied to it."""


@dataclass(frozen=True)
class ImageRecipe:
    """Exposure, colours and noise of the image, whose values lie in 0..1."""

    grey: float = 0.2
    """Share of the images without colours."""
    tinted: float = 0.6
    """Share of the others whose colours are changed."""
    tint: tuple[float, float] = (0.8, 1.2)
    """Factor on each of their three colours."""
    log_gamma: tuple[float, float] = (-0.6, 0.7)
    """Logarithm of the exponent applied to all values."""
    contrast: tuple[float, float] = (0.6, 1.8)
    """Factor on the distance from 0.5."""
    brightness: tuple[float, float] = (-0.2, 0.15)
    """Offset added to all values."""
    blurred: float = 0.2
    """Share of the images that are blurred."""
    blur_px: tuple[float, float] = (0.4, 1.2)
    """Standard deviation of the blur, pixels."""
    noisy: float = 0.5
    """Share of the images with noise."""
    noise: tuple[float, float] = (0.0, 0.04)
    """Standard deviation of the noise."""

"""Augmentations that vary the rig and the weather, not only the view (docs/decisions.md, "Where the paper is silent").

Real frames come from few rigs. A mirrored image, a camera turned about its centre, another lens and
fewer beams are all exact: the same scene as another rig would have seen it. The recipe says how often and how strongly.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.frame import Frame
from calibnet.datasets.images.files import resize_image
from calibnet.geometry import transform
from calibnet.training.augmentation_draws import Exposure, Scanner, View, mirrored
from calibnet.training.augmentation_recipe import CameraRecipe, ImageRecipe, ScanRecipe
from calibnet.training.recipe import Recipe

Generator = np.random.Generator


def mirror(frame: Frame) -> Frame:
    """The frame in a mirror: left and right swapped in image and scan."""
    flip_camera, flip_lidar = np.diag([-1.0, 1, 1, 1]), np.diag([1.0, -1, 1, 1])
    return replace(
        frame,
        image=np.ascontiguousarray(frame.image[:, ::-1]),
        points=frame.points * np.array([1, -1, 1, 1], np.float32),
        camera=mirrored(frame.camera),
        camera_from_lidar=flip_camera @ frame.camera_from_lidar @ flip_lidar,
    )


def virtual_camera(
    frame: Frame, height: int, width: int, generator: Generator, recipe: CameraRecipe, magnification: float = 1.0
) -> Frame:
    """The frame as seen by a turned camera with another lens, at the network's input size.

    It is one homography ``K' R K^-1``: turning a camera about its centre and changing its lens cause no
    parallax, so the image and the new extrinsic ``R @ camera_from_lidar`` are exact.
    """
    import cv2

    view = View.draw(frame.camera, height, width, generator, recipe, magnification)
    # the image is averaged down first, as the warp only interpolates and would alias
    image = resize_image(frame.image, view.near)
    homography = view.camera.matrix @ view.turn @ np.linalg.inv(view.near.matrix)
    warped = cv2.warpPerspective(image, homography, (width, height), flags=cv2.INTER_LINEAR)
    return replace(
        frame,
        image=warped.astype(np.uint8, copy=False),
        camera=view.camera,
        camera_from_lidar=transform(view.turn, np.zeros(3)) @ frame.camera_from_lidar,
    )


def thin_scan(points: NDArray[np.float32], generator: Generator, recipe: ScanRecipe) -> NDArray[np.float32]:
    """The scan of another scanner nearby: fewer beams, fewer points, another reach, noise and another response."""
    scanner = Scanner.draw(generator, recipe)
    keep = np.linalg.norm(points[:, :3], axis=1) < scanner.reach_m
    if scanner.period > 1:
        band = np.floor(elevation_for_another(points, scanner) / scanner.band_rad).astype(np.int64)
        keep &= band % scanner.period == scanner.phase
    if scanner.kept < 1:
        keep &= generator.random(len(points)) < scanner.kept
    points = points[keep].copy()
    if scanner.range_noise:
        points[:, :3] *= 1 + generator.normal(0.0, scanner.range_noise, (len(points), 1)).astype(np.float32)
    points[:, 3] = np.clip(scanner.response * points[:, 3] ** scanner.gamma, 0, 1)
    return points


def elevation_for_another(points: NDArray[np.float32], scanner: Scanner) -> NDArray[np.float32]:
    """Elevation ``[N]``, radians, seen from a tilted scanner nearby, whose rings cross those of the true one."""
    x, y, z = scanner.turn.astype(np.float32) @ (points[:, :3] - scanner.place.astype(np.float32)).T
    elevation: NDArray[np.float32] = np.arctan2(z, np.hypot(x, y))
    return elevation


def photometric(image: NDArray[np.uint8], generator: Generator, recipe: ImageRecipe) -> NDArray[np.uint8]:
    """The image with another exposure, gamma, colours, blur and noise, all drawn at random; sometimes grey."""
    return exposed(image, Exposure.draw(generator, recipe), generator)


def exposed(image: NDArray[np.uint8], exposure: Exposure, generator: Generator) -> NDArray[np.uint8]:
    """The image ``[H, W, 3]`` under an exposure; the generator makes the noise."""
    import cv2

    pixels = image.astype(np.float32) / 255.0
    if exposure.grey:
        grey = cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY)
        pixels = np.repeat(grey[..., None], 3, axis=2).astype(np.float32)
    pixels = np.clip(pixels * exposure.tint.astype(np.float32), 0, 1) ** np.float32(exposure.gamma)
    pixels = (pixels - 0.5) * np.float32(exposure.contrast) + np.float32(0.5 + exposure.brightness)
    if exposure.blur_px:
        pixels = cv2.GaussianBlur(pixels, (0, 0), exposure.blur_px)
    if exposure.noise:
        pixels = pixels + np.float32(exposure.noise) * generator.standard_normal(pixels.shape, dtype=np.float32)
    return (np.clip(pixels, 0, 1) * 255).astype(np.uint8)


def augment(
    frame: Frame,
    height: int,
    width: int,
    generator: Generator,
    recipe: Recipe,
    variety: float = 1.0,
    magnification: float = 1.0,
) -> Frame:
    """The frame with all of these augmentations, drawn at random, at the network's input size.

    The result is a pinhole image, without the faces of a wide lens and without the image as it was taken, since these
    are not augmented.

    Args:
        frame: as the dataset has it.
        height: of the result's image, pixels.
        width: of the result's image, pixels.
        generator: source of all random numbers.
        recipe: how often and how strongly.
        variety: probability that the scan is thinned, and that colours change. The camera always varies: features that
            can tell where a cell lies on a known rig need not look at what is in it.
        magnification: factor by which the image is on average larger than this size, and then cropped to it.
    """
    frame = replace(frame, faces=(), original=None)
    if generator.random() < recipe.camera.mirrored:
        frame = mirror(frame)
    frame = virtual_camera(frame, height, width, generator, recipe.camera, magnification)
    if generator.random() < variety:
        frame = replace(frame, points=thin_scan(frame.points, generator, recipe.scan))
    if generator.random() < variety:
        frame = replace(frame, image=photometric(frame.image, generator, recipe.picture))
    return frame

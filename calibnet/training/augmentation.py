"""Augmentations that vary the rig and the weather, not only the view (docs/decisions.md, "Where the paper is silent").

Real frames come from few rigs. A mirrored image, a camera turned about its centre, another lens and
fewer beams are all exact: the same scene as another rig would have seen it. How often and how much is in the recipe.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.frame import Frame
from calibnet.datasets.images import resize_image
from calibnet.geometry import PinholeCamera, rotation_from_euler_xyz, transform
from calibnet.training.augmentation_recipe import CameraRecipe, PictureRecipe, ScanRecipe
from calibnet.training.recipe import Recipe

Generator = np.random.Generator


def mirror(frame: Frame) -> Frame:
    """The frame in a mirror: left and right swapped in image and scan."""
    camera = frame.camera
    matrix = camera.matrix.copy()
    matrix[0, 2] = camera.width - 1 - matrix[0, 2]
    flip_camera, flip_lidar = np.diag([-1.0, 1, 1, 1]), np.diag([1.0, -1, 1, 1])
    return replace(
        frame,
        image=np.ascontiguousarray(frame.image[:, ::-1]),
        points=frame.points * np.array([1, -1, 1, 1], np.float32),
        camera=PinholeCamera(camera.width, camera.height, matrix),
        camera_from_lidar=flip_camera @ frame.camera_from_lidar @ flip_lidar,
    )


def virtual_camera(
    frame: Frame, height: int, width: int, generator: Generator, recipe: CameraRecipe, magnification: float = 1.0
) -> Frame:
    """The frame as seen by a turned camera with another lens, at the network's input size.

    One homography ``K' R K^-1``: turning a camera about its centre and changing its lens moves no
    parallax, so the picture and the new extrinsic ``R @ camera_from_lidar`` are exact.
    """
    import cv2

    zoom = np.exp(generator.uniform(*np.log(recipe.zoom)))
    filling = max(width / frame.camera.width, height / frame.camera.height)
    # a magnified part of a picture needs its pixels
    scale = filling * min(zoom * magnification, max(zoom, 1 / filling))
    # averaging down first: the warp only interpolates, and would alias
    near = frame.camera.resized(round(frame.camera.width * scale), round(frame.camera.height * scale))
    image = resize_image(frame.image, near)
    slack_x, slack_y = width - near.width, height - near.height
    left, top = generator.uniform(min(slack_x, 0), max(slack_x, 0)), generator.uniform(min(slack_y, 0), max(slack_y, 0))
    matrix = near.matrix.copy()
    matrix[0] *= generator.uniform(*recipe.stretch)
    matrix[:2, 2] += left, top
    turn = np.eye(3)
    if generator.random() < recipe.turned:
        angles = generator.normal(0.0, recipe.turn_deg).clip(-recipe.turn_most_deg, recipe.turn_most_deg)
        turn = rotation_from_euler_xyz(np.radians(angles))
    homography = matrix @ turn @ np.linalg.inv(near.matrix)
    warped = cv2.warpPerspective(image, homography, (width, height), flags=cv2.INTER_LINEAR)
    return replace(
        frame,
        image=warped.astype(np.uint8, copy=False),
        camera=PinholeCamera(width, height, matrix),
        camera_from_lidar=transform(turn, np.zeros(3)) @ frame.camera_from_lidar,
    )


def thin_scan(points: NDArray[np.float32], generator: Generator, recipe: ScanRecipe) -> NDArray[np.float32]:
    """Fewer beams, which those of a scanner nearby have, fewer points, another reach, noise and another response."""
    keep = np.ones(len(points), bool)
    if generator.random() < recipe.banded:
        elevation = elevation_for_another(points, generator, recipe)
        band = np.floor(elevation / np.radians(generator.uniform(*recipe.band_deg))).astype(np.int64)
        period = generator.integers(*recipe.bands, endpoint=True)
        keep &= band % period == generator.integers(period)
    if generator.random() < recipe.thinned:
        keep &= generator.random(len(points)) < generator.uniform(*recipe.kept)
    if generator.random() < recipe.shortened:
        keep &= np.linalg.norm(points[:, :3], axis=1) < generator.uniform(*recipe.reach_m)
    points = points[keep].copy()
    points[:, :3] *= 1 + generator.normal(0.0, recipe.range_noise, (len(points), 1)).astype(np.float32)
    if generator.random() < recipe.dark:
        points[:, 3] = 0.0
    else:
        response = generator.uniform(*recipe.response)
        points[:, 3] = np.clip(response * points[:, 3] ** generator.uniform(*recipe.response_gamma), 0, 1)
    return points


def elevation_for_another(points: NDArray[np.float32], generator: Generator, recipe: ScanRecipe) -> NDArray[np.float32]:
    """Elevation ``[N]``, radians, for a scanner nearby that is tilted: its rings cross those of the true one."""
    roll, pitch = np.radians(generator.normal(0.0, recipe.tilt_deg, 2))
    if generator.random() < recipe.upended:
        pitch += np.pi / 2
    turn = rotation_from_euler_xyz(np.array([roll, pitch, 0.0])).astype(np.float32)
    place = generator.normal(0.0, recipe.apart_m, 3).astype(np.float32)
    x, y, z = turn @ (points[:, :3] - place).T
    elevation: NDArray[np.float32] = np.arctan2(z, np.hypot(x, y))
    return elevation


def photometric(image: NDArray[np.uint8], generator: Generator, recipe: PictureRecipe) -> NDArray[np.uint8]:
    """Exposure, gamma, colour, blur, noise; sometimes grey."""
    import cv2

    pixels = image.astype(np.float32) / 255.0
    if generator.random() < recipe.grey:
        grey = cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY)
        pixels = np.repeat(grey[..., None], 3, axis=2).astype(np.float32)
    elif generator.random() < recipe.tinted:
        pixels = pixels * generator.uniform(*recipe.tint, 3).astype(np.float32)
    pixels = np.clip(pixels, 0, 1) ** np.float32(np.exp(generator.uniform(*recipe.log_gamma)))
    pixels = (pixels - 0.5) * np.float32(generator.uniform(*recipe.contrast))
    pixels = pixels + np.float32(0.5 + generator.uniform(*recipe.brightness))
    if generator.random() < recipe.blurred:
        pixels = cv2.GaussianBlur(pixels, (0, 0), generator.uniform(*recipe.blur_px))
    if generator.random() < recipe.noisy:
        sigma = generator.uniform(*recipe.noise)
        pixels = pixels + sigma * generator.standard_normal(pixels.shape, dtype=np.float32)
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
    """All of the above, drawn at random, at the network's input size.

    Args:
        frame: as the dataset has it.
        height: of the result's image, pixels.
        width: of the result's image, pixels.
        generator: of everything random.
        recipe: how often and how much.
        variety: probability of thinning, and of other colours; the camera always varies, since features that know
            where a cell is on a known rig need not look at what is in it.
        magnification: how much larger than to fill that size the picture is on average, and cut.
    """
    if generator.random() < recipe.camera.mirrored:
        frame = mirror(frame)
    frame = virtual_camera(frame, height, width, generator, recipe.camera, magnification)
    if generator.random() < variety:
        frame = replace(frame, points=thin_scan(frame.points, generator, recipe.scan))
    if generator.random() < variety:
        frame = replace(frame, image=photometric(frame.image, generator, recipe.picture))
    return frame

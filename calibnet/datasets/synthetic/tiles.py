"""The tiles of the atlas, drawn with noise, lines and rectangles; each tiles seamlessly or nearly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SIZE = 256
Image = NDArray[np.float32]
Colour = tuple[float, float, float]
Generator = np.random.Generator


@dataclass(frozen=True, eq=False)
class Tile:
    """One tile: its group, the metres it covers, and ``[256, 256, 4]`` uint8 colour + reflectance."""

    group: str
    metres: float
    image: NDArray[np.uint8]


def noise(generator: Generator, cells: int = 4, octaves: int = 5, gain: float = 0.6) -> Image:
    """Tileable fractal noise ``[256, 256]``, zero mean, unit deviation."""
    import cv2

    total = np.zeros((SIZE, SIZE), dtype=np.float32)
    for octave in range(octaves):
        side = min(cells << octave, SIZE)
        grid = np.pad(generator.normal(size=(side, side)).astype(np.float32), 2, mode="wrap")
        scale = SIZE // side
        large = cv2.resize(grid, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
        total += gain**octave * large[2 * scale : 2 * scale + SIZE, 2 * scale : 2 * scale + SIZE]
    return (total - total.mean()) / total.std()


def colour(generator: Generator, low: float = 0.2, high: float = 0.8, saturation: float = 0.2) -> Colour:
    """A random colour of a given brightness range around grey."""
    grey = generator.uniform(low, high)
    warm, green = generator.uniform(-1.0, 1.0), generator.uniform(-1.0, 1.0)
    if saturation < 0.3:  # walls and stone are grey to warm, never purple
        warm, green = 0.5 + 0.5 * warm, 0.25 * green
    rgb = np.clip(grey * (1.0 + saturation * np.array([warm, green, -warm])), 0.02, 0.98)
    return float(rgb[0]), float(rgb[1]), float(rgb[2])


def flat(rgb: Colour, reflectance: float) -> Image:
    """A tile of one colour."""
    return np.broadcast_to(np.array([*rgb, reflectance], dtype=np.float32), (SIZE, SIZE, 4)).copy()


def speckled(generator: Generator, rgb: Colour, reflectance: float, amount: float, cells: int = 4) -> Image:
    """A colour modulated by noise, as asphalt, plaster, soil are."""
    image = flat(rgb, reflectance)
    image *= (1.0 + amount * noise(generator, cells))[..., None]
    return image


def rectangle(image: Image, x0: float, y0: float, x1: float, y1: float, rgb: Colour, reflectance: float) -> None:
    """Fill a rectangle given in fractions of the tile."""
    a, b, c, d = (round(value * SIZE) for value in (x0, y0, x1, y1))
    image[max(b, 0) : d, max(a, 0) : c] = (*rgb, reflectance)


def bricks(generator: Generator) -> Image:
    rows, columns = (16, 8) if generator.random() < 0.5 else (24, 10)
    base = np.array(colour(generator, 0.25, 0.6, 0.15)) * generator.choice([[1.25, 0.85, 0.7], [1.1, 1.0, 0.85]])
    y, x = np.mgrid[0:SIZE, 0:SIZE] / SIZE
    row = np.floor(y * rows).astype(int)
    shifted = (x * columns + 0.5 * (row % 2)) % columns
    tone = generator.uniform(0.75, 1.2, (rows, columns))[row, shifted.astype(int)]
    mortar = ((y * rows) % 1.0 < 0.12) | (shifted % 1.0 < 0.06)
    image = flat(tuple(base), 0.35)
    image[..., :3] *= np.where(mortar, generator.choice([0.6, 1.5]), tone)[..., None]
    return image * (1.0 + 0.06 * noise(generator, 16, 4))[..., None]


def paving(generator: Generator) -> Image:
    count = int(generator.choice([4, 6, 8, 16]))
    y, x = np.mgrid[0:SIZE, 0:SIZE] / SIZE * count
    row = y.astype(int)
    x = (x + generator.choice([0.0, 0.5]) * (row % 2)) % count
    tone = generator.uniform(0.85, 1.12, (count, count))[row, x.astype(int)]
    joint = (y % 1.0 < 0.07) | (x % 1.0 < 0.07)
    image = flat(colour(generator, 0.4, 0.65, 0.1), 0.3)
    image[..., :3] *= np.where(joint, 0.7, tone)[..., None]
    return image * (1.0 + 0.07 * noise(generator, 8))[..., None]


def asphalt(generator: Generator) -> Image:
    import cv2

    image = speckled(generator, colour(generator, 0.28, 0.5, 0.05), 0.15, 0.05, 4)
    image *= (1.0 + 0.10 * generator.normal(size=(SIZE, SIZE, 1))).astype(np.float32)
    for _ in range(int(generator.integers(0, 4))):  # cracks and sealed joints
        points = np.cumsum(generator.normal(0.0, 14.0, (20, 2)), axis=0) + generator.uniform(0, SIZE, 2)
        tone = float(generator.uniform(0.1, 0.25))
        cv2.polylines(image, [points.astype(np.int32)], False, (tone, tone, tone, 0.08), 1, cv2.LINE_AA)
    return image


def grass(generator: Generator) -> Image:
    dry = generator.uniform(0.0, 1.0)
    rgb = np.array([0.30, 0.42, 0.18]) * (1 - dry) + np.array([0.55, 0.50, 0.30]) * dry
    image = flat(tuple(rgb * generator.uniform(0.7, 1.1)), 0.45)
    image *= (1.0 + 0.10 * noise(generator, 4, 6, 0.85) + 0.14 * noise(generator, 32, 4, 0.9))[..., None]
    image[..., 0] *= 1.0 + 0.05 * noise(generator, 4)
    return image


def soil(generator: Generator) -> Image:
    rgb = np.array([0.52, 0.43, 0.33]) * generator.uniform(0.6, 1.2)
    grain = 0.09 * noise(generator, 4, 6, 0.8) + 0.10 * noise(generator, 32, 4, 0.9)
    image = flat(tuple(rgb), 0.3) * (1.0 + grain)[..., None]
    return image


def leaves(generator: Generator) -> Image:
    kind = generator.choice([[0.24, 0.31, 0.16], [0.30, 0.35, 0.18], [0.19, 0.27, 0.17], [0.36, 0.36, 0.24]])
    image = flat(tuple(np.array(kind) * generator.uniform(0.7, 1.2)), 0.5)
    image *= np.clip(1.0 + 0.25 * noise(generator, 8, 5, 0.9) + 0.35 * noise(generator, 32, 4, 0.9), 0.1, 2.4)[..., None]
    return image


def bark(generator: Generator) -> Image:
    image = flat(colour(generator, 0.2, 0.45, 0.15), 0.4)
    stripes = np.repeat(noise(generator, 16, 4, 0.8)[:32], SIZE // 32, axis=0)
    return image * (1.0 + 0.25 * stripes)[..., None]


def glass_colour(generator: Generator) -> Colour:
    """Window panes: mostly dark, sometimes a bright reflection or a curtain."""
    if generator.random() < 0.25:
        return colour(generator, 0.5, 0.8, 0.1)
    tone = generator.uniform(0.08, 0.3)
    return 0.9 * tone, tone, 1.15 * tone


def facade(generator: Generator) -> Image:
    """Two bays by two storeys of windows on plaster, brick or panels; 6 m a tile."""
    wall = (
        bricks(generator)
        if generator.random() < 0.35
        else speckled(generator, colour(generator, 0.4, 0.9, 0.2), 0.4, 0.04)
    )
    columns, rows = int(generator.choice([1, 2, 2, 3, 4])), int(generator.choice([2, 2, 2, 3]))
    w, h = generator.uniform(0.3, 0.8), generator.uniform(0.4, 0.75)
    frame = colour(generator, 0.15, 0.95, 0.15)
    frame_width = generator.uniform(0.006, 0.016)
    band, shutters = generator.random() < 0.4, generator.random() < 0.3
    mullions, transom = int(generator.integers(0, 3)), generator.random() < 0.5
    band_colour, shutter_colour = colour(generator, 0.3, 0.9, 0.1), colour(generator, 0.2, 0.6, 0.5)
    for row in range(rows):
        if band:
            rectangle(wall, 0.0, (row + 0.93) / rows, 1.0, (row + 1.0) / rows, band_colour, 0.4)
        for column in range(columns):
            x0, x1 = (column + 0.5 - w / 2) / columns, (column + 0.5 + w / 2) / columns
            y0, y1 = (row + 0.48 - h / 2) / rows, (row + 0.48 + h / 2) / rows
            if shutters and w < 0.55:
                for side in (x0 - 0.45 * (x1 - x0), x1):
                    rectangle(wall, side, y0, side + 0.45 * (x1 - x0), y1, shutter_colour, 0.4)
            f = frame_width
            rectangle(wall, x0 - f, y0 - f, x1 + f, y1 + f, frame, 0.4)
            rectangle(wall, x0, y0, x1, y1, glass_colour(generator), 0.05)
            if generator.random() < 0.3:  # a blind, partly down
                rectangle(wall, x0, y0, x1, y0 + generator.uniform(0.2, 0.8) * (y1 - y0), frame, 0.3)
            for bar in range(mullions):
                x = x0 + (x1 - x0) * (bar + 1) / (mullions + 1)
                rectangle(wall, x - f / 2, y0, x + f / 2, y1, frame, 0.3)
            if transom:
                rectangle(wall, x0, y0 + 0.3 * (y1 - y0), x1, y0 + 0.3 * (y1 - y0) + f, frame, 0.3)
            rectangle(wall, x0 - 2 * f, y1 + f, x1 + 2 * f, y1 + 2.5 * f, colour(generator, 0.3, 0.9, 0.05), 0.4)
    return wall


def ground_floor(generator: Generator) -> Image:
    """Shop fronts, doors and garage gates; one storey high, 4 m a tile."""
    wall = speckled(generator, colour(generator, 0.25, 0.85, 0.2), 0.4, 0.05)
    if generator.random() < 0.6:
        rectangle(wall, 0.0, 0.05, 1.0, 0.22, colour(generator, 0.15, 0.8, 0.5), 0.4)
        scribble(wall, generator, 0.08, 0.09, 0.9, 0.19)
        rectangle(wall, 0.05, 0.28, 0.62, 0.9, glass_colour(generator), 0.05)
        for _ in range(int(generator.integers(2, 7))):  # goods in the window
            x, y = generator.uniform(0.08, 0.5), generator.uniform(0.4, 0.7)
            rectangle(wall, x, y, x + 0.08, y + 0.15, colour(generator, 0.2, 0.8, 0.6), 0.1)
        rectangle(wall, 0.68, 0.28, 0.92, 1.0, colour(generator, 0.1, 0.5, 0.25), 0.3)
    else:
        rectangle(wall, 0.1, 0.3, 0.35, 1.0, colour(generator, 0.1, 0.6, 0.5), 0.3)
        rectangle(wall, 0.48, 0.3, 0.9, 0.72, colour(generator, 0.6, 0.9, 0.05), 0.4)
        rectangle(wall, 0.5, 0.32, 0.88, 0.7, glass_colour(generator), 0.05)
    return wall


def scribble(image: Image, generator: Generator, x0: float, y0: float, x1: float, y1: float) -> None:
    """Letters, or what looks like them from the road."""
    ink = colour(generator, 0.05, 0.95, 0.3)
    x = x0
    while x < x1 - 0.02:
        width = generator.uniform(0.015, 0.05)
        for _ in range(2):
            top = generator.uniform(y0, 0.7 * y0 + 0.3 * y1)
            rectangle(image, x, top, x + 0.4 * width, y1, ink, 0.4)
            x += 0.5 * width
        x += generator.choice([0.008, 0.05], p=[0.8, 0.2])


def roof_tiles(generator: Generator) -> Image:
    rows = 16
    rgb = np.array(colour(generator, 0.25, 0.5, 0.1)) * generator.choice([[1.4, 0.85, 0.65], [1.0, 1.0, 1.05]])
    y, x = np.mgrid[0:SIZE, 0:SIZE] / SIZE * rows
    image = flat(tuple(rgb), 0.35)
    image[..., :3] *= (0.75 + 0.35 * (y % 1.0) + 0.1 * np.cos(2 * np.pi * x))[..., None]
    return image * (1.0 + 0.1 * noise(generator, 8))[..., None]


def planks(generator: Generator) -> Image:
    count = int(generator.choice([8, 12, 16]))
    x = np.arange(SIZE) / SIZE * count
    tone = generator.uniform(0.8, 1.2, count)[x.astype(int)] * np.where(x % 1.0 < 0.12, 0.4, 1.0)
    image = flat(colour(generator, 0.3, 0.8, 0.2), 0.4)
    return image * (tone[None, :, None] * (1.0 + 0.06 * noise(generator, 8))[..., None]).astype(np.float32)


def metal(generator: Generator) -> Image:
    return speckled(generator, (0.8, 0.8, 0.8), 0.4, 0.03, 2)


def panel_art(generator: Generator) -> Image:
    """Advertisements, lorry sides, graffiti: strong edges where depth has none."""
    image = speckled(generator, colour(generator, 0.2, 0.9, 0.4), 0.5, 0.02)
    for _ in range(int(generator.integers(2, 7))):
        x, y, w, h = generator.uniform(0, 0.8), generator.uniform(0, 0.8), *generator.uniform(0.05, 0.5, 2)
        rectangle(image, x, y, x + w, y + h, colour(generator, 0.1, 0.95, 0.7), 0.5)
    for _ in range(int(generator.integers(0, 4))):
        y = generator.uniform(0.05, 0.8)
        scribble(image, generator, generator.uniform(0, 0.3), y, 0.9, y + generator.uniform(0.05, 0.2))
    return image


def sign_face(generator: Generator) -> Image:
    import cv2

    ground = [(0.9, 0.9, 0.9), (0.1, 0.25, 0.7), (0.1, 0.45, 0.25), (0.9, 0.75, 0.1), (0.75, 0.1, 0.1)]
    image = flat(ground[int(generator.integers(len(ground)))], 0.95)
    rim = [(0.8, 0.1, 0.1, 0.9), (0.95, 0.95, 0.95, 0.95), (0.1, 0.1, 0.1, 0.3)][int(generator.integers(3))]
    cv2.rectangle(image, (6, 6), (SIZE - 7, SIZE - 7), rim, 14)
    for _ in range(int(generator.integers(1, 4))):
        y = generator.uniform(0.15, 0.7)
        scribble(image, generator, 0.15, y, 0.85, y + 0.18)
    return image


def wheel(generator: Generator) -> Image:
    import cv2

    image = flat((0.1, 0.1, 0.1), 0.06)
    tone = float(generator.uniform(0.35, 0.75))
    cv2.circle(image, (SIZE // 2, SIZE // 2), 84, (tone, tone, tone, 0.5), -1, cv2.LINE_AA)
    for angle in np.arange(5) * 2 * np.pi / 5:
        tip = (int(128 + 55 * np.cos(angle)), int(128 + 55 * np.sin(angle)))
        cv2.circle(image, tip, 17, (0.12, 0.12, 0.12, 0.1), -1, cv2.LINE_AA)
    return image


def cloth(generator: Generator) -> Image:
    image = speckled(generator, (0.8, 0.8, 0.8), 0.4, 0.12, 4)
    if generator.random() < 0.4:
        stripe = (np.arange(SIZE) // int(generator.choice([8, 16, 32]))) % 2
        image[..., :3] *= (0.55 + 0.45 * stripe)[:, None, None]
    return image


def mesh_fence(generator: Generator) -> Image:
    count = int(generator.choice([16, 32]))
    y, x = np.mgrid[0:SIZE, 0:SIZE] / SIZE * count
    lines = (x % 1.0 < 0.25) | (y % 1.0 < 0.12)
    image = flat(colour(generator, 0.2, 0.4, 0.2), 0.25)
    image[lines] = (*colour(generator, 0.3, 0.8, 0.2), 0.4)
    return image


_PLAN: tuple[tuple[str, float, int, Callable[[Generator], Image]], ...] = (
    ("plain", 2.0, 1, lambda g: speckled(g, (0.92, 0.92, 0.92), 0.45, 0.02)),
    ("concrete", 3.0, 4, lambda g: speckled(g, colour(g, 0.5, 0.75, 0.05), 0.4, 0.07)),
    ("plaster", 4.0, 6, lambda g: speckled(g, colour(g, 0.5, 0.95, 0.15), 0.45, 0.05)),
    ("paint", 1.0, 3, lambda g: speckled(g, (0.9, 0.9, 0.88), 0.9, 0.10, 8)),
    ("black", 1.0, 1, lambda g: speckled(g, (0.12, 0.12, 0.12), 0.08, 0.1)),
    ("glass", 2.0, 3, lambda g: speckled(g, (0.2, 0.22, 0.24), 0.04, 0.15, 2)),
    ("lamp", 0.3, 2, lambda g: speckled(g, (0.9, 0.9, 0.9), 1.0, 0.1, 8)),
    ("asphalt", 4.0, 8, asphalt),
    ("paving", 2.0, 6, paving),
    ("brick", 1.5, 6, bricks),
    ("grass", 3.0, 6, grass),
    ("soil", 4.0, 6, soil),
    ("leaves", 1.4, 8, leaves),
    ("bark", 1.0, 3, bark),
    ("facade", 6.0, 36, facade),
    ("ground_floor", 4.0, 14, ground_floor),
    ("roof", 4.0, 6, roof_tiles),
    ("planks", 1.6, 5, planks),
    ("metal", 2.0, 2, metal),
    ("art", 1.0, 14, panel_art),
    ("sign", 1.0, 14, sign_face),
    ("wheel", 1.0, 3, wheel),
    ("cloth", 0.8, 6, cloth),
    ("fence", 1.0, 4, mesh_fence),
)


def draw_all(generator: Generator) -> list[Tile]:
    """Draw every tile of the plan."""
    drawn = []
    for group, metres, count, draw in _PLAN:
        for _ in range(count):
            image = np.clip(255.0 * draw(generator), 0.0, 255.0).astype(np.uint8)
            drawn.append(Tile(group, metres, image))
    return drawn

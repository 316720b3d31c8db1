"""Tiles of house fronts: windows with frames, shutters and blinds; shop fronts and doors."""

from __future__ import annotations

from numpy.random import Generator

from calibnet.datasets.synthetic.drawing import Colour, Image, colour, rectangle, scribble, speckled
from calibnet.datasets.synthetic.surface_tiles import bricks


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

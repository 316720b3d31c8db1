"""Pictures that are cut, damaged, huge, or none."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator

import numpy as np
from PIL import Image

from tests.hostile.inputs import Build, car, car_with
from tests.hostile.rows import FINE, Row, instead_of

SIZE = (400, 120)
PIXELS = np.random.default_rng(5).integers(0, 256, (SIZE[1], SIZE[0], 3), dtype=np.uint8)


def encoded(form: str, picture: Image.Image | None = None, **options: object) -> bytes:
    """A picture as a file."""
    file = io.BytesIO()
    (picture or Image.fromarray(PIXELS)).save(file, form, **options)
    return file.getvalue()


def chunk(name: bytes, content: bytes) -> bytes:
    """A chunk of a PNG."""
    return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))


def png(width: int, height: int, pixels: bytes, depth: int = 8, color: int = 2) -> bytes:
    """A PNG that says a size and holds these deflated bytes."""
    header = struct.pack(">IIBBBBB", width, height, depth, color, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", pixels) + chunk(b"IEND", b"")


WHOLE_PNG, WHOLE_JPEG = encoded("PNG"), encoded("JPEG", quality=90)
ROWS = zlib.compress(b"".join(b"\0" + row.tobytes() for row in PIXELS))
HALF = zlib.compress(b"".join(b"\0" + row.tobytes() for row in PIXELS[: SIZE[1] // 2]))
FOREIGN = {
    ".png": {
        "cut in half": WHOLE_PNG[: len(WHOLE_PNG) // 2],
        "cut at the end": WHOLE_PNG[:-6],
        "cut in its header": WHOLE_PNG[:20],
        "lower half gone": png(*SIZE, HALF),
        "deflated data cut": png(*SIZE, ROWS[: len(ROWS) // 2]),
        "deflated data damaged": png(*SIZE, ROWS[:5000] + b"\0" * 400 + ROWS[5400:]),
        "a wrong checksum": WHOLE_PNG[:-20] + b"\0\0\0\0" + WHOLE_PNG[-16:],
        "30000 x 30000": png(30_000, 30_000, zlib.compress(b"\0" * 1000)),
        "30000 x 30000 of zeros": png(30_000, 30_000, zlib.compress(bytes(90_001 * 300))),
        "2^31 wide": png(2**31 - 1, 1, ROWS),
        "nothing wide": png(0, 120, ROWS),
        "another size": encoded("PNG", Image.fromarray(PIXELS[:, :200])),
        "turned": encoded("PNG", Image.fromarray(PIXELS.transpose(1, 0, 2))),
        "a depth of 3": png(*SIZE, ROWS, depth=3),
        "a colour type of 7": png(*SIZE, ROWS, color=7),
        "a million text chunks": WHOLE_PNG[:33] + chunk(b"tEXt", b"a\0" + b"b" * 1000) * 3000 + WHOLE_PNG[33:-300],
        "a gif": encoded("GIF"),
        "SVG": b"<svg xmlns='http://www.w3.org/2000/svg'/>",
        "text": b"hello\n" * 100,
    },
    ".jpg": {
        "cut in half": WHOLE_JPEG[: len(WHOLE_JPEG) // 2],
        "cut in its header": WHOLE_JPEG[:100],
        "lower half gone": WHOLE_JPEG[: len(WHOLE_JPEG) // 2] + b"\xff\xd9",
        "lower quarter gone": WHOLE_JPEG[: 3 * len(WHOLE_JPEG) // 4] + b"\xff\xd9",
        "65535 x 65535": WHOLE_JPEG.replace(struct.pack(">HH", SIZE[1], SIZE[0]), b"\xff\xff\xff\xff", 1),
        "no size": WHOLE_JPEG.replace(struct.pack(">HH", SIZE[1], SIZE[0]), b"\0\0\0\0", 1),
        "only markers": b"\xff\xd8\xff\xd9",
        "another size": encoded("JPEG", Image.fromarray(PIXELS[:60])),
    },
    ".bmp": {
        "cut": encoded("BMP")[:5000],
        "a huge size": encoded("BMP")[:18] + struct.pack("<ii", 2**30, 2**30) + encoded("BMP")[26:],
    },
    ".tiff": {
        "cut": encoded("TIFF")[:5000],
        "no tag": b"II*\0\x08\0\0\0\0\0",
        "tags that lead back": b"II*\0\x08\0\0\0\1\0\0\1\3\0\1\0\0\0\x10\0\0\0\x08\0\0\0",
    },
    ".webp": {"cut": encoded("WEBP")[:2000], "a header alone": encoded("WEBP")[:30]},
}
SIXTEEN = PIXELS[:, :, 0].astype(np.uint16) * 16
GOOD = {
    ".png": {
        "RGB": WHOLE_PNG,
        "grey": encoded("PNG", Image.fromarray(PIXELS[:, :, 0])),
        "palette": encoded("PNG", Image.fromarray(PIXELS).quantize(64)),
        "alpha": encoded("PNG", Image.fromarray(PIXELS).convert("RGBA")),
        "16 bits": encoded("PNG", Image.fromarray(SIXTEEN)),
    },
    ".jpg": {"JPEG": WHOLE_JPEG, "progressive": encoded("JPEG", progressive=True)},
    ".webp": {"WebP": encoded("WEBP")},
    ".tiff": {"TIFF": encoded("TIFF")},
    ".bmp": {"BMP": encoded("BMP")},
}


def picture(suffix: str, content: bytes) -> Build:
    """A car's folder whose picture is this."""
    return car_with("images/0000.png", suffix, content)


def rows() -> Iterator[Row]:
    """Of pictures of every format."""
    yield from instead_of("picture", car, "car/images/0000.png", "missing")
    for suffix, contents in FOREIGN.items():
        for what, content in contents.items():
            yield Row(f"picture {suffix}: {what}", picture(suffix, content), words=(f"0000{suffix}",))
    for suffix, contents in GOOD.items():
        for what, content in contents.items():
            yield Row(f"picture {suffix} that is good: {what}", picture(suffix, content), FINE, ("Saved",))

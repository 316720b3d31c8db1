"""``calibration.yaml`` as nobody should write it."""

from __future__ import annotations

from collections.abc import Iterator

from tests.hostile.inputs import car_exported, changed
from tests.hostile.rows import FINE, Row, instead_of

PLACE = "car/calibration.yaml"
WIDTH, HEIGHT = "width: 400", "height: 120"
MATRIX = "camera_matrix: [[232, 0, 200], [0, 232, 60], [0, 0, 1]]"
LENS = "distortion: [0, 0, 0, 0, 0]"
EXTRINSIC = "camera_from_lidar: [[0, -1, 0, 0.06], [0, 0, -1, -0.08], [1, 0, 0, -0.27], [0, 0, 0, 1]]"
WHOLE = {"width": WIDTH, "height": HEIGHT, "camera_matrix": MATRIX, "distortion": LENS, "camera_from_lidar": EXTRINSIC}


def text(**lines: str | None) -> str:
    """The file with some lines changed, left out or added."""
    return "\n".join(line for line in (WHOLE | lines).values() if line is not None) + "\n"


BOMB = "a: &a [x,x,x,x,x,x,x,x,x]\n" + "".join(
    f"{chr(98 + n)}: &{chr(98 + n)} [{','.join([f'*{chr(97 + n)}'] * 9)}]\n" for n in range(9)
)
OTHERS = (
    "image_width: 400\nimage_height: 120\ncamera_matrix: {rows: 3, cols: 3, data: [232, 0, 200, 0, 232, 60, 0, 0, 1]}\n"
    "distortion_model: plumb_bob\ndistortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n" + EXTRINSIC,
    "height: 120\nwidth: 400\ndistortion_model: equidistant\nd: [0.1, 0, 0, 0]\nk: [232, 0, 200, 0, 232, 60, 0, 0, 1]\n"
    "---\n",
    "cam0: {camera_model: omni, distortion_model: radtan, distortion_coeffs: [0, 0, 0, 0], resolution: [400, 120], "
    "intrinsics: [1.2, 232, 232, 200, 60], T_cam_lidar: [[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]}",
    '{"camera": {"camera_model": "plumb_bob", "distortion_coeffs": [0, 0, 0, 0, 0], "intrinsics": [232, 232, 200, 60]},'
    ' "results": {"T_lidar_camera": [0, 0, 0, 0.5, -0.5, 0.5, -0.5]}}',
    "transforms:\n- header: {frame_id: velodyne}\n  child_frame_id: cam_optical\n  transform: {translation: {x: 0, y: 0"
    ", z: 0}, rotation: {x: -0.5, y: 0.5, z: -0.5, w: 0.5}}\n---\n",
    "kit:\n  camera0/camera_link: {x: 0, y: 0, z: 0, roll: 0, pitch: 0, yaw: 0}\n"
    "  velodyne_top: {x: 0, y: 0, z: 0, roll: 0, pitch: 0, yaw: 0}\n",
    "<?xml version='1.0'?><opencv_storage><image_width>400</image_width><image_height>120</image_height>"
    "<K type_id='opencv-matrix'><rows>3</rows><cols>3</cols><dt>d</dt><data>232 0 200 0 232 60 0 0 1</data></K>"
    "<D>0 0 0 0 0</D></opencv_storage>",
    "<robot><joint type='fixed'><parent link='velodyne'/><child link='cam_optical'/><origin xyz='0.2 0 -0.1' "
    "rpy='-1.57 0 -1.57'/></joint></robot>",
    "<launch><node pkg='tf' type='static_transform_publisher' args='0.2 0 -0.1 -1.57 0 -1.57 velodyne cam_optical 9'/>"
    "</launch>",
    "launch:\n- node: {exec: static_transform_publisher, args: '--x 0.2 --qx -0.5 --qy 0.5 --qz -0.5 --qw 0.5 "
    "--frame-id velodyne --child-frame-id cam_optical'}\n",
    "P2: 232 0 200 0 0 232 60 0 0 0 1 0\nTr: 0 -1 0 0 0 0 -1 0 1 0 0 0\n",
)
"""Whole calibrations as other tools write them."""
VALUES = {
    "nested a thousand times": "x: " + "[" * 1000 + "]" * 1000,
    "nested a hundred thousand times": "x: " + "[" * 100_000,
    "nested mappings": "x: " + "{a: " * 500 + "}" * 500,
    "aliases that multiply": BOMB,
    "one alias": "x: &a [1]\ny: *a",
    "an alias of itself": "x: &a [*a]",
    "a merge of an alias": "x: &a {b: 1}\ny: {<<: *a}",
    "an odd date": "x: !!timestamp 2011-99-99",
    "an int that is none": "x: !!int abc",
    "a float that is none": "x: !!float abc",
    "an unknown tag": "x: !thing 1",
    "code": "x: !!python/object/apply:os.system ['touch harm']",
    "an unclosed list": "x: [1, 2",
    "a tab": "x:\n\t- 1",
    "a null character": "x: \0",
    "a key that is a list": "? [1, 2]\n: 3",
    "two documents": "x: 1\n---\ny: 2",
    "a directive": "%YAML 9.9\n---\nx: 1",
    "a key twice": "width: 401",
}
WRONG = {
    "width": ["-400", "0", "4.5", "yes", "'4e2'", "[400]", "{a: 1}", "~", "1e3", ".inf", ".nan", "9" * 400, "9" * 5000],
    "height": ["-1", "0", "text", "!!int 0x", "99999999999999999999"],
    "camera_matrix": [
        "[]",
        "1",
        "text",
        "[[1, 2], [3, 4]]",
        "[[232, 0, 200], [0, 232, 60]]",
        "[[.nan, 0, 200], [0, 232, 60], [0, 0, 1]]",
        "[[.inf, 0, 200], [0, 232, 60], [0, 0, 1]]",
        "[[0, 0, 200], [0, 232, 60], [0, 0, 1]]",
        "[[-232, 0, 200], [0, 232, 60], [0, 0, 1]]",
        "[[1e400, 0, 200], [0, 232, 60], [0, 0, 1]]",
        "[[232, 0, 200], [0, 232, 60], [0, 0, 2]]",
        "[[a, 0, 200], [0, 232, 60], [0, 0, 1]]",
        "{fx: 1}",
        "[[[232]]]",
        "[[2011-01-01, 0, 200], [0, 232, 60], [0, 0, 1]]",
    ],
    "distortion": ["[1, 2]", "text", "[.nan, 0, 0, 0, 0]", "[a, b, c, d]", "[[0, 0], [0, 0]]", "{k1: 0}"],
    "camera_from_lidar": [
        "[]",
        "[[1, 0, 0, 0], [0, 1, 0, 0]]",
        "[[0, -1, 0, .nan], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]",
        "[[0, -1, 0, .inf], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]",
        "[[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 2]]",
        "[[0, -9, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]",
        "[[0, 1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]",
        "[[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1]]",
        "text",
        "[[1e308, 0, 0, 0], [0, 1e308, 0, 0], [0, 0, 1e308, 0], [0, 0, 0, 1]]",
    ],
}


def rows() -> Iterator[Row]:
    """Of the calibration of a folder."""
    name = ("calibration.yaml",)
    yield Row("calibration: whole", changed(car_exported, PLACE, text()), FINE, ("camera_from_lidar",))
    yield from instead_of("calibration", car_exported, PLACE, "missing")
    for what, more in VALUES.items():
        yield Row(f"calibration: {what}", changed(car_exported, PLACE, text() + more + "\n"), words=name)
    for key, values in WRONG.items():
        for value in values:
            what = f"calibration: {key} {value[:60]}{f' of {len(value)} characters' if len(value) > 60 else ''}"
            yield Row(what, changed(car_exported, PLACE, text(**{key: f"{key}: {value}"})), words=name)
        yield Row(f"calibration: no {key}", changed(car_exported, PLACE, text(**{key: None})), words=name)
    for what, content in {
        "a number": b"7",
        "a list": b"- 1\n- 2",
        "text": b"hello",
        "latin-1": text().encode() + "größe: 1".encode("latin-1"),
        "utf-16": text().encode("utf-16"),
        "many keys": (text() + "\n".join(f"k{n}: 1" for n in range(100_000))).encode(),
        "a long comment": b"#" * 1_000_000 + b"\n" + text().encode(),
        "braces": b"{" * 1000,
        "JSON nested": b'{"a":' * 2000 + b"1" + b"}" * 2000,
        "XML of entities": b'<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa">'
        + b"".join(b'<!ENTITY a%d "%s">' % (n, b"&a%d;" % (n - 1) * 10 if n else b"&a;" * 10) for n in range(9))
        + b"]><x>&a8;</x>",
        "XML nested": b"<x>" * 5000,
        "XML outside": b'<!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/passwd">]><x><width>&a;</width></x>',
    }.items():
        yield Row(f"calibration: {what}", changed(car_exported, PLACE, content), words=name)

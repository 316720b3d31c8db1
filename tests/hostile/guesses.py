"""Guesses in other tools' files, priors and fixed axes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from tests.hostile.inputs import CAR, RUN, put
from tests.hostile.rows import FINE, USAGE, Make, Row

JOINT = "<joint type='fixed'><parent link='{parent}'/><child link='{child}'/><origin xyz='{xyz}' rpy='{rpy}'/></joint>"


def joint(**changes: str) -> str:
    """A fixed joint from the LiDAR to the camera, with what is changed."""
    said = {"parent": "velodyne", "child": "cam_optical", "xyz": "0.06 -0.08 -0.27", "rpy": "-1.57 0 -1.57"}
    return JOINT.format(**said | changes)


def robot(*inside: str) -> str:
    """A robot of these joints."""
    return f"<robot name='r'>{''.join(inside)}</robot>"


def tf(**changes: str) -> str:
    """A list of one transform of ROS, as `tf2_echo` or a recorded `/tf_static` has it."""
    said = {"parent": "velodyne", "child": "cam_optical", "x": "0", "w": "0.5"} | changes
    return (
        f"transforms:\n- header: {{frame_id: {said['parent']}}}\n  child_frame_id: {said['child']}\n  transform: "
        f"{{translation: {{x: {said['x']}, y: 0, z: 0}}, rotation: {{x: -0.5, y: 0.5, z: -0.5, w: {said['w']}}}}}\n"
    )


GUESSES: dict[str, tuple[str, str]] = {
    "a URDF that is empty": ("r.urdf", "<robot/>"),
    "a URDF whose place is a word": ("r.urdf", robot(joint(xyz="a b c"))),
    "a URDF whose place is NaN": ("r.urdf", robot(joint(xyz="nan 0 0"))),
    "a URDF whose place is infinite": ("r.urdf", robot(joint(xyz="1e999 0 0"))),
    "a URDF whose place is two numbers": ("r.urdf", robot(joint(xyz="0 0"))),
    "a URDF whose angles are 5000 digits": ("r.urdf", robot(joint(rpy="9" * 5000 + " 0 0"))),
    "a URDF whose place is on the moon": ("r.urdf", robot(joint(xyz="384400000 0 0"))),
    "a URDF of a circle": ("r.urdf", robot(joint(), joint(parent="cam_optical", child="velodyne"))),
    "a URDF of a joint to itself": ("r.urdf", robot(joint(parent="velodyne", child="velodyne"))),
    "a URDF of two trees": ("r.urdf", robot(joint(parent="velodyne", child="x"), joint(parent="y"))),
    "a URDF without names": ("r.urdf", robot(joint(parent="", child=""))),
    "a URDF of a joint that turns": ("r.urdf", robot(joint().replace("fixed", "revolute"))),
    "a URDF of escapes": ("r.urdf", robot(joint(parent="a&#27;[2J", child="b"))),
    "a URDF that is a xacro": ("r.urdf", robot(joint(xyz="${x} 0 0"))),
    "a URDF nested": ("r.urdf", "<robot>" * 20_000),
    "a URDF of entities": ("r.urdf", '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa">]><robot name="&a;"/>'),
    "a URDF of a file": ("r.urdf", '<!DOCTYPE r [<!ENTITY a SYSTEM "/etc/passwd">]>' + robot(joint(xyz="&a;"))),
    "a URDF that is cut": ("r.urdf", robot(joint())[:100]),
    "a chain of 20000 links": ("r.urdf", robot(*(joint(parent=f"l{n}", child=f"l{n + 1}") for n in range(20_000)))),
    "transforms of NaN": ("tf.yaml", tf(x=".nan")),
    "transforms of a word": ("tf.yaml", tf(x="far")),
    "transforms of no turn": ("tf.yaml", tf(w="7e300")),
    "transforms without names": ("tf.yaml", tf(parent="''", child="''")),
    "transforms to itself": ("tf.yaml", tf(child="velodyne")),
    "transforms that are none": ("tf.yaml", "transforms: []\n"),
    "transforms that are a number": ("tf.yaml", "transforms: 7\n"),
    "transforms of null": ("tf.yaml", "transforms: [~, ~]\n"),
    "koide3 of null": ("c.json", '{"camera": null, "results": null}'),
    "koide3 of six numbers": ("c.json", '{"results": {"T_lidar_camera": [0, 0, 0, 0.5, -0.5, 0.5]}}'),
    "koide3 of no turn": ("c.json", '{"results": {"T_lidar_camera": [0, 0, 0, 0, 0, 0, 0]}}'),
    "koide3 of texts": ("c.json", '{"results": {"T_lidar_camera": ["a", "b", 0, 0, 0, 0, 1]}}'),
    "kalibr of cameras that are a list": ("k.yaml", "cam0: [1, 2]\n"),
    "kalibr of an odd matrix": ("k.yaml", "cam0: {resolution: [400, 120], T_cam_lidar: [[1, 2], [3]]}\n"),
    "autoware of a word": ("a.yaml", "kit:\n  camera0/camera_link: {x: far, y: 0, z: 0, roll: 0, pitch: 0, yaw: 0}\n"),
    "autoware of a camera alone": (
        "a.yaml",
        "kit:\n  camera0/camera_link: {x: 0, y: 0, z: 0, roll: 0, pitch: 0, yaw: 0}\n",
    ),
    "an extrinsic that mirrors": (
        "g.yaml",
        "camera_from_lidar: [[0, 1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]\n",
    ),
}
PRIORS: list[list[str]] = [
    ["--prior-translation", "0cm"],
    ["--prior-translation", "-2cm"],
    ["--prior-translation", "nancm"],
    ["--prior-translation", "1e400m"],
    ["--prior-translation", "inf"],
    ["--prior-translation", "2deg"],
    ["--prior-translation", "2"],
    ["--prior-translation", ""],
    ["--prior-translation", "9" * 5000 + "m"],
    ["--prior-rotation", "2cm"],
    ["--prior-rotation", "0deg"],
    ["--prior-rotation", "1e-400deg"],
    ["--prior-rotation", "nandeg"],
    ["--prior-rotation", "1°\x1b[2J"],
    ["--fix", ""],
    ["--fix", "x,,y"],
    ["--fix", "up"],
    ["--fix", "roll,pitch,yaw,x,y,z"],
    ["--fix", "x\x1b[2J"],
    ["--fix", "y," * 5000],
]


def rows() -> Iterator[Row]:
    """Of guesses and priors."""
    for what, (name, content) in GUESSES.items():
        yield Row(f"--guess: {what}", guessed(name, content), words=(name,))
    yield Row("--guess: a URDF that is whole", guessed("r.urdf", robot(joint())), FINE, ("Saved",))
    for options in PRIORS:
        for command in ("folder", "rig"):

            def made(root: Path, options: list[str] = options, command: str = command) -> list[str]:
                put(CAR, root)
                return [command, CAR, "--headless", *options]

            shown = f"{options[0]} {options[1][:20]!r}{len(options[1]) if len(options[1]) > 20 else ''}"
            yield Row(f"{command} {shown}", made, USAGE, (options[0],))


def guessed(name: str, content: str) -> Make:
    """Calibrate a car from the guess in a file."""

    def made(root: Path) -> list[str]:
        put(CAR, root)
        (root / name).write_text(content)
        return ["folder", CAR, *RUN, "--guess", name]

    return made

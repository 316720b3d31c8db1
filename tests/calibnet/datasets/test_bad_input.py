"""Every kind of broken input, in every layout, gives one sentence that names the file."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

from calibnet.datasets import DATASETS
from calibnet.errors import DatasetError

ON_FILES = list(DATASETS.own)
"""The datasets that read images and scans from files."""


def read_all(layout) -> str:
    """Open and read everything; return the sentence of the error that this must raise."""
    with pytest.raises(DatasetError) as caught:
        list(layout.open())
    message = str(caught.value)
    assert message.endswith(".")
    assert "\n" not in message
    assert message.count(". ") == 0, "one sentence"
    assert ";" in message, "what is wrong; what to do"
    return message


@pytest.mark.parametrize("dataset", ON_FILES)
class TestEveryLayout:
    def test_missing_root(self, dataset, write_layout):
        layout = write_layout(dataset)
        shutil.rmtree(layout.root)
        message = read_all(layout)
        assert str(layout.root) in message
        assert "holds" in message

    @pytest.mark.parametrize("kind", ["images", "scans"])
    def test_missing_or_emptied_folder(self, dataset, kind, write_layout):
        layout = write_layout(dataset)
        folder = getattr(layout, kind)[0].parent
        for path in folder.iterdir():
            path.unlink()
        assert str(folder) in read_all(layout)
        folder.rmdir()
        assert str(folder) in read_all(layout)

    def test_missing_calibration(self, dataset, write_layout):
        layout = write_layout(dataset)
        layout.calibration.unlink()
        assert str(layout.calibration) in read_all(layout)

    @pytest.mark.parametrize("kind", ["images", "scans"])
    def test_a_file_without_a_partner_costs_one_frame(self, dataset, kind, write_layout):
        if dataset == "nuscenes":
            pytest.skip("its tables say what belongs together, see nuscenes/test_scene.py")
        layout = write_layout(dataset)
        missing = getattr(layout, kind)[1]
        missing.unlink()
        sequence = layout.open()
        assert any(missing.stem in note for note in sequence.notes)
        good, bad = [], []
        for position in range(len(sequence)):
            try:
                good.append(sequence[position].index)
            except DatasetError as error:  # of a folder, where one of a name is a bad frame
                bad.append(str(error))
        assert len(good) == 2
        if dataset != "folder":  # its frames have no numbers of their own
            assert good == [layout.indices[0], layout.indices[2]]
        assert [f"no {kind[:-1]} for {missing.stem}" in text for text in bad] == [True] * (dataset == "folder")

    def test_nothing_pairs(self, dataset, write_layout):
        if dataset == "nuscenes":
            pytest.skip("its tables say what belongs together, see nuscenes/test_scene.py")
        layout = write_layout(dataset)
        for number, scan in enumerate(layout.scans):
            scan.rename(scan.with_stem(f"{70 + 2 * number**2:010d}"))
        message = read_all(layout)
        assert str(layout.scans[0].parent) in message
        assert "0000000070" in message

    @pytest.mark.parametrize("kind", ["images", "scans"])
    def test_file_that_vanishes_after_opening(self, dataset, kind, write_layout):
        layout = write_layout(dataset)
        sequence = layout.open()
        getattr(layout, kind)[1].unlink()
        assert sequence[0].index == layout.indices[0]
        with pytest.raises(DatasetError, match=getattr(layout, kind)[1].name):
            sequence[1]

    def test_truncated_scan(self, dataset, write_layout):
        layout = write_layout(dataset)
        layout.scans[1].write_bytes(layout.scans[1].read_bytes()[:-7])
        message = read_all(layout)
        assert str(layout.scans[1]) in message
        assert "truncated" in message

    def test_empty_scan(self, dataset, write_layout):
        layout = write_layout(dataset)
        layout.scans[1].write_bytes(b"")
        message = read_all(layout)
        assert str(layout.scans[1]) in message
        assert "empty" in message

    def test_scan_without_a_finite_point(self, dataset, write_layout):
        layout = write_layout(dataset)
        np.full((9, 4), np.nan, np.float32).tofile(layout.scans[1])
        message = read_all(layout)
        assert str(layout.scans[1]) in message
        assert "finite" in message

    def test_nan_points_are_dropped(self, dataset, write_layout):
        layout = write_layout(dataset)
        points = layout.points[1].copy()
        points[3, 1], points[10, 3], points[20, 0] = np.nan, np.nan, np.inf
        layout.stored(points).tofile(layout.scans[1])
        points[10, 3] = 0.0  # a point without intensity is a point
        expected = np.delete(points, [3, 20], axis=0)
        np.testing.assert_array_equal(layout.open()[1].points, expected)

    @pytest.mark.parametrize("content", [b"", b"no image", b"\x89PNG\r\n\x1a\n" + bytes(40)])
    def test_unreadable_image(self, dataset, content, write_layout):
        layout = write_layout(dataset)
        layout.images[1].write_bytes(content)
        assert str(layout.images[1]) in read_all(layout)

    @pytest.mark.parametrize("lost", [4, 300])
    def test_truncated_image(self, dataset, lost, write_layout):
        layout = write_layout(dataset)
        layout.images[1].write_bytes(layout.images[1].read_bytes()[:-lost])
        message = read_all(layout)
        assert str(layout.images[1]) in message
        assert "truncated" in message

    def test_calibration_that_is_not_text(self, dataset, write_layout):
        layout = write_layout(dataset)
        layout.calibration.write_bytes(bytes(range(128, 256)))
        assert str(layout.calibration) in read_all(layout)


PROJECTION = {"kitti-odometry": "P2", "kitti-raw": "P_rect_02", "kitti-object": "P2"}
ROTATION = {"kitti-odometry": "Tr", "kitti-raw": "R_rect_00", "kitti-object": "Tr_velo_to_cam"}


def edit_row(layout, key: str, edit) -> None:
    """Change the numbers of one row of a KITTI calibration file; None deletes the row."""
    lines = []
    for line in layout.calibration.read_text().splitlines():
        name, _, numbers = line.partition(":")
        edited = edit(numbers.split()) if name == key else numbers.split()
        if edited is not None:
            lines.append(f"{name}: {' '.join(edited)}" if name else "")
    layout.calibration.write_text("\n".join(lines))


@pytest.mark.parametrize("dataset", PROJECTION)
class TestKittiCalibration:
    @pytest.mark.parametrize(
        ("edit", "problem"),
        [
            (lambda numbers: numbers[:-1], "instead of"),
            (lambda numbers: [*numbers[:-1], "nan"], "finite"),
            (lambda numbers: [*numbers[:-1], "1.0e"], "finite"),
            (lambda numbers: [], "instead of"),
            (lambda numbers: None, "no row"),
        ],
    )
    @pytest.mark.parametrize("rows", [PROJECTION, ROTATION])
    def test_malformed_row(self, dataset, rows, edit, problem, write_layout):
        layout = write_layout(dataset)
        edit_row(layout, rows[dataset], edit)
        message = read_all(layout)
        assert str(layout.calibration) in message
        assert rows[dataset] in message
        assert problem in message

    def test_singular_projection(self, dataset, write_layout):
        layout = write_layout(dataset)
        edit_row(layout, PROJECTION[dataset], lambda numbers: ["0", *numbers[1:]])
        message = read_all(layout)
        assert str(layout.calibration) in message
        assert "singular" in message

    def test_rotation_that_stretches(self, dataset, write_layout):
        layout = write_layout(dataset)
        edit_row(layout, ROTATION[dataset], lambda numbers: [str(1.1 * float(number)) for number in numbers])
        message = read_all(layout)
        assert str(layout.calibration) in message
        assert "orthonormal" in message

    def test_camera_that_is_not_there(self, dataset, write_layout):
        layout = write_layout(dataset)
        for camera in (3, 7, -1):
            with pytest.raises(DatasetError, match=f"no camera {camera}; cameras there: 2"):
                layout.open(camera=camera)

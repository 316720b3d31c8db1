from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor

from calibnet.alignment import Evidence
from calibnet.cascade import Cascade, SkippedStage, Stage
from calibnet.cascade import stage as stage_module
from calibnet.cascade.stage import View
from calibnet.datasets.frame import Frame
from calibnet.drive.convergence import Due
from calibnet.drive.solve import LOOKS
from calibnet.errors import CalibrationError, ConfigError, WeightsError
from calibnet.geometry import RANGES, depth_image, invert, miscalibration, orthonormal, pose_error, project, scaled
from calibnet.geometry.types import Extrinsic
from calibnet.network.features import FeatureExtractor
from calibnet.trace import CascadeTrace, StageTrace
from calibnet.weights import save_network, weights_path
from calibnet.weights.manifest import StageSettings
from tests.support.scene import REFERENCE, make_frame
from tests.support.tiny import TINY, tiny_network

INITIAL = miscalibration([2.0, -1.0, 3.0], [0.2, -0.1, 0.3]) @ REFERENCE


@pytest.fixture(scope="module")
def frame() -> Frame:
    return make_frame(3)


def cascade(
    numbers: tuple[int, ...] = (3, 4, 5),
    shared: bool = True,
    limit: float = math.inf,
    settings: dict[int, StageSettings] | None = None,
    **changes: Any,
) -> Cascade:
    """Random networks; with ``shared``, all with the first one's image branch; settings by stage."""
    networks = [tiny_network(seed=number, stage=number, **changes) for number in numbers]
    if shared:
        branch = {k: v for k, v in networks[0].features.state_dict().items() if k.startswith("image_")}
        for network in networks[1:]:
            network.features.load_state_dict(branch, strict=False)
    used = settings or {}
    return Cascade(
        [
            Stage(
                number, RANGES[number - 1], net, used.get(number, StageSettings()), limit if number == 5 else math.inf
            )
            for number, net in zip(numbers, networks, strict=True)
        ]
    )


@pytest.fixture(scope="module")
def trace(frame: Frame) -> CascadeTrace:
    return cascade().calibrate(frame, INITIAL, detail=True)


def test_stages_follow_one_another(trace: CascadeTrace) -> None:
    assert [stage.number for stage in trace.stages] == [3, 4, 5]
    assert [stage.range for stage in trace.stages] == list(RANGES[2:])
    assert np.array_equal(trace.initial, INITIAL) and np.array_equal(trace.stages[0].before, INITIAL)
    for one, following in zip(trace.stages, trace.stages[1:], strict=False):
        assert np.array_equal(one.after, following.before)
    for stage in trace.stages:
        np.testing.assert_allclose(stage.after, stage.correction @ stage.before, atol=1e-12)
        rotation = stage.after[:3, :3]
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1.0)
        assert not np.array_equal(stage.correction, np.eye(4))
    assert np.array_equal(trace.arrived, trace.stages[-1].after)


def test_what_the_image_does_not_confirm_is_not_applied(frame: Frame, trace: CascadeTrace) -> None:
    last = trace.stages[-1]
    assert trace.fits and last.match_error_px > 0.5 and not np.array_equal(trace.arrived, INITIAL)
    doubting = cascade(limit=last.match_error_px - 0.01).calibrate(frame, INITIAL)
    assert not doubting.fits and doubting.rejected and np.array_equal(doubting.corrected, INITIAL)
    assert np.array_equal(doubting.stages[-1].after, trace.stages[-1].after), "what the stages found can be seen"
    believing = cascade(limit=last.match_error_px + 0.01).calibrate(frame, INITIAL)
    assert believing.fits and np.array_equal(believing.arrived, trace.arrived)


def test_corrections_are_extended_by_the_gain_of_their_stage(frame: Frame, trace: CascadeTrace) -> None:
    plain, extended = (
        trace.stages[0],
        cascade((3,), settings={3: StageSettings(gain=1.5)}).calibrate(frame, INITIAL).stages[0],
    )
    np.testing.assert_allclose(extended.correction, scaled(plain.correction, 1.5), atol=1e-9)
    np.testing.assert_allclose(extended.after, extended.correction @ INITIAL, atol=1e-12)
    assert np.linalg.norm(extended.correction[:3, 3]) == pytest.approx(1.5 * np.linalg.norm(plain.correction[:3, 3]))


def test_only_the_finest_stage_judges(frame: Frame) -> None:
    coarse = cascade((3, 4), limit=0.01).calibrate(frame, INITIAL)
    assert coarse.fits and np.array_equal(coarse.arrived, coarse.stages[-1].after)


def test_a_drive_of_images_that_fit_no_scan_has_no_estimate(frame: Frame) -> None:
    with pytest.raises(CalibrationError, match=r"scan of frame 3 .* do not fit together after stage 5, .* px off"):
        cascade(limit=0.01).calibrate_drive([frame, frame], INITIAL)


def test_detail_has_the_shapes_and_units_of_the_contract(trace: CascadeTrace, frame: Frame) -> None:
    camera = trace.stages[0].camera
    assert camera.width % 32 == camera.height % 32 == 0
    window = 2 * TINY.radius + 1
    for stage in trace.stages:
        detail = stage.detail
        assert detail is not None
        assert detail.depth.dtype == np.float32
        np.testing.assert_array_equal(detail.depth, depth_image(frame.points, stage.before, camera))
        assert [scale.stride for scale in detail.scales] == [8, 16, 32]
        for scale, channels in zip(detail.scales, (4, 6, 8), strict=True):
            size = (camera.height // scale.stride, camera.width // scale.stride)
            assert scale.volume.shape == scale.probability.shape == (window, window, *size)
            assert scale.volume.dtype == scale.probability.dtype == np.float16
            assert np.abs(scale.volume).max() <= 1.01
            np.testing.assert_allclose(scale.probability.astype(np.float64).sum((0, 1)), 1.0, atol=0.01)
            assert scale.best.shape == (*size, 2) and scale.best.dtype == np.int64
            assert scale.before.shape == scale.after.shape == (channels, *size)
            assert scale.before.dtype == scale.after.dtype == np.float16
            assert scale.occupied.shape == size and scale.occupied.dtype == np.bool_ and scale.occupied.any()
        size = (camera.height // 8, camera.width // 8)
        assert detail.displacement.shape == (*size, 2) and detail.displacement.dtype == np.float32
        assert detail.confidence.shape == size and detail.confidence.dtype == np.float32
        assert detail.confidence.min() >= 0 and detail.confidence.max() <= 1
        assert np.array_equal(detail.confidence > 0, detail.scales[0].occupied)


def test_best_match_is_the_displacement_with_the_highest_probability(trace: CascadeTrace) -> None:
    detail = trace.stages[0].detail
    assert detail is not None
    for scale in detail.scales:
        for row, column in ((0, 0), (scale.best.shape[0] - 1, 1)):
            dx, dy = scale.best[row, column]
            cell = scale.probability[:, :, row, column]
            assert cell[dy + TINY.radius, dx + TINY.radius] == cell.max()


def test_occupied_cells_hold_points(trace: CascadeTrace) -> None:
    detail = trace.stages[1].detail
    assert detail is not None
    for scale in detail.scales:
        height, width = scale.occupied.shape
        blocks = detail.depth.reshape(height, scale.stride, width, scale.stride)
        np.testing.assert_array_equal(scale.occupied, (blocks > 0).any(axis=(1, 3)))


def test_detail_is_made_only_when_asked_for(frame: Frame, trace: CascadeTrace) -> None:
    silent = cascade().calibrate(frame, INITIAL)
    assert all(stage.detail is None for stage in silent.stages)
    assert np.array_equal(silent.arrived, trace.arrived), "looking changes nothing"


def test_times_are_told_by_part(trace: CascadeTrace) -> None:
    assert trace.milliseconds.keys() == {"preparation", "resize", "image_features", "verdict"}
    for stage in trace.stages:
        parts = {"projection", "lidar_features", "cost_volumes", "hourglass", "displacement", "pose"}
        assert stage.milliseconds.keys() == parts
        assert all(0 <= time < 60_000 for time in stage.milliseconds.values())


@pytest.mark.parametrize("head", ["geometric", "regression"])
def test_the_same_frame_gives_the_same_extrinsic(frame: Frame, head: str) -> None:
    one, again = (cascade((4,), head=head).calibrate(frame, INITIAL).arrived for _ in range(2))
    assert np.array_equal(one, again)


def test_the_frame_s_own_extrinsic_is_not_looked_at(frame: Frame) -> None:
    network = cascade((5,))
    lost = replace(frame, camera_from_lidar=np.full((4, 4), np.nan))
    assert np.array_equal(network.calibrate(lost, INITIAL).arrived, network.calibrate(frame, INITIAL).arrived)


def count_image_features(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    calls: list[int] = []
    original = FeatureExtractor.image

    def counted(self: FeatureExtractor, image: Tensor) -> list[Tensor]:
        calls.append(1)
        return original(self, image)

    monkeypatch.setattr(FeatureExtractor, "image", counted)
    return calls


def test_image_features_are_computed_once_where_the_branch_is_shared(
    frame: Frame, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = count_image_features(monkeypatch)
    shared = cascade()
    together = shared.calibrate(frame, INITIAL)
    assert len(calls) == 1
    shared.image_branches = [0, 1, 2]
    apart = shared.calibrate(frame, INITIAL)
    assert len(calls) == 1 + 3
    np.testing.assert_allclose(together.arrived, apart.arrived, atol=1e-9)


def test_stages_see_the_image_at_their_own_sizes(frame: Frame, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = count_image_features(monkeypatch)
    zooming = cascade(
        (1, 2, 3, 4, 5), settings={n: StageSettings(size) for n, size in enumerate((0.5, 0.5, 1.0, 2.0, 2.0), 1)}
    )
    trace = zooming.calibrate(frame, INITIAL, detail=True)
    assert len(calls) == 3, "one run of the image branch a size, not a stage"
    areas = [stage.camera.width * stage.camera.height for stage in trace.stages]
    assert areas[0] == areas[1] < areas[2] < areas[3] == areas[4]
    assert areas[2] == pytest.approx(64 * 128, rel=0.5) and areas[3] == pytest.approx(128 * 256, rel=0.3)
    for stage in trace.stages:
        assert stage.detail is not None and stage.detail.depth.shape == (stage.camera.height, stage.camera.width)
        assert stage.detail.scales[0].volume.shape[2:] == (stage.camera.height // 8, stage.camera.width // 8)


def test_rows_above_the_scan_are_spared_and_still_in_the_detail(frame: Frame, monkeypatch: pytest.MonkeyPatch) -> None:
    heights: list[int] = []
    original = FeatureExtractor.lidar

    def seen(self: FeatureExtractor, lidar: Tensor) -> list[Tensor]:
        heights.append(lidar.shape[2])
        return original(self, lidar)

    monkeypatch.setattr(FeatureExtractor, "lidar", seen)
    wide = make_frame(3, 128, 64)
    low = project(wide.points, INITIAL, wide.camera)
    scan = wide.points[low.index[low.pixels[:, 1] > 40]]
    stage = cascade((3,)).calibrate(replace(wide, points=scan), INITIAL, detail=True).stages[0]
    empty = stage.camera.height // 2
    assert heights[0] == stage.camera.height - empty
    detail = stage.detail
    assert detail is not None and detail.depth.shape == (stage.camera.height, stage.camera.width)
    assert not detail.displacement[: empty // 8].any() and detail.displacement[empty // 8 :].any()
    assert detail.confidence.shape == detail.displacement.shape[:2] == detail.scales[0].occupied.shape
    for scale in detail.scales:
        rows = empty // scale.stride
        assert not scale.occupied[:rows].any() and scale.occupied[rows:].any()
        for array in (scale.volume, scale.probability, scale.before, scale.after):
            assert array.shape[-2:] == scale.occupied.shape
            assert not array[..., :rows, :].any() and array[..., rows:, :].any()
        assert scale.best.shape[:2] == scale.occupied.shape and not scale.best[:rows].any()


def test_a_stage_of_two_rounds_is_the_stage_run_twice(frame: Frame, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Stage, "is_settled", lambda stage, correction: False)
    first = cascade((3,)).calibrate(frame, INITIAL, detail=True)
    second = cascade((3,)).calibrate(frame, first.arrived)
    calls = count_image_features(monkeypatch)
    both = cascade((3,), settings={3: StageSettings(looks=2)}).calibrate(frame, INITIAL, detail=True)
    assert len(calls) == 1, "the image is the same in both looks"
    (stage,) = both.stages
    np.testing.assert_allclose(stage.after, second.arrived, atol=1e-9)
    np.testing.assert_allclose(stage.correction @ INITIAL, stage.after, atol=1e-9)
    assert not np.allclose(stage.after, first.arrived, atol=1e-4)
    assert stage.detail is not None and first.stages[0].detail is not None
    np.testing.assert_array_equal(stage.detail.depth, first.stages[0].detail.depth)
    assert stage.milliseconds.keys() == first.stages[0].milliseconds.keys()


def test_a_stage_looks_again_until_the_next_one_can_take_over(frame: Frame, monkeypatch: pytest.MonkeyPatch) -> None:
    once = cascade((3,)).calibrate(frame, INITIAL).stages[0]
    found: list[np.ndarray] = []

    def is_settled(stage: Stage, correction: np.ndarray) -> bool:
        found.append(correction)
        return len(found) == 2

    monkeypatch.setattr(Stage, "is_settled", is_settled)
    stage = cascade((3,), settings={3: StageSettings(looks=5)}).calibrate(frame, INITIAL).stages[0]
    np.testing.assert_allclose(found[0], once.correction, atol=1e-9)
    np.testing.assert_allclose(found[1] @ found[0], stage.correction, atol=1e-9)


def test_networks_with_image_branches_of_their_own_use_them(frame: Frame, monkeypatch: pytest.MonkeyPatch) -> None:
    calls, sizes = count_image_features(monkeypatch), []
    resized = stage_module.resize_image
    monkeypatch.setattr(stage_module, "resize_image", lambda *seen: sizes.append(seen) or resized(*seen))
    different = cascade(shared=False)
    trace = different.calibrate(frame, INITIAL)
    assert (len(calls), len(sizes)) == (3, 1), "but one image, where they see it at one size"
    before = INITIAL
    for stage in different.stages:
        before = Cascade([stage]).calibrate(frame, before).arrived
    np.testing.assert_allclose(trace.arrived, before, atol=1e-9)


def test_neighbours_share_an_image_branch_of_their_own() -> None:
    """A stage may have its branch trained further while the stages at other image sizes keep theirs."""
    seeds = {1: 0, 2: 0, 3: 1, 4: 0, 5: 1}
    networks = {number: tiny_network(seed, stage=number) for number, seed in seeds.items()}
    stages = [Stage(number, RANGES[number - 1], network) for number, network in networks.items()]
    assert Cascade(stages).image_branches == [0, 0, 2, 0, 2]


def test_networks_of_other_sizes_do_not_share() -> None:
    wide = tiny_network(stage=4, widths=(8, 8, 16, 16, 24))
    deep = tiny_network(stage=5, blocks=(0, 0, 2, 0, 0))
    first = Stage(3, RANGES[2], tiny_network(stage=3))
    assert Cascade([first, Stage(4, RANGES[3], wide)]).image_branches == [0, 1]
    assert Cascade([first, Stage(5, RANGES[4], deep)]).image_branches == [0, 1]


@pytest.mark.parametrize("detail", [True, False])
def test_fewer_scales_and_shared_extractors_run_too(frame: Frame, detail: bool) -> None:
    small = cascade((3, 4), shared=False, multi_scale_volumes=False, share_extractor=True)
    stage = small.calibrate(frame, INITIAL, detail=detail).stages[0]
    assert stage.detail is None or [scale.stride for scale in stage.detail.scales] == [8]


def test_too_few_points_are_one_sentence(frame: Frame) -> None:
    backwards = miscalibration([0, 0, 180.0], [0, 0, 0]) @ REFERENCE
    empty = replace(frame, points=np.zeros((0, 4), np.float32))
    for view, extrinsic in ((frame, backwards), (empty, REFERENCE)):
        with pytest.raises(CalibrationError, match=r"frame 3 \(scene 3\).*x forward, y left, z up") as raised:
            cascade().calibrate(view, extrinsic)
        assert "\n" not in str(raised.value)


def test_small_and_large_images_run(frame: Frame) -> None:
    for width, height in ((90, 30), (500, 500), (700, 120)):
        view = make_frame(0, width, height)
        camera = cascade((5,)).calibrate(view, INITIAL).stages[0].camera
        assert camera.width * camera.height == pytest.approx(64 * 128, rel=0.5)


# Loading


def save(folder: Path, *numbers: int) -> None:
    for number in numbers:
        network = tiny_network(seed=number, stage=number)
        save_network(weights_path("compact", RANGES[number - 1], folder), network, network.state_dict(), {})


def test_stages_without_weights_are_skipped_and_named(tmp_path: Path, frame: Frame) -> None:
    save(tmp_path, 5, 3)
    loaded = Cascade.load("compact", folder=tmp_path)
    assert [stage.number for stage in loaded.stages] == [3, 5]
    assert [stage.number for stage in loaded.skipped] == [1, 2, 4]
    assert "calib-inspect train --preset compact --range 2/0.2" in loaded.skipped[2].reason
    assert [stage.number for stage in loaded.calibrate(frame, INITIAL).stages] == [3, 5]


def test_only_the_stages_asked_for_are_loaded(tmp_path: Path) -> None:
    save(tmp_path, 3, 4, 5)
    loaded = Cascade.load("compact", (5, 4), tmp_path)
    assert [stage.number for stage in loaded.stages] == [4, 5] and not loaded.skipped


def test_a_cascade_without_any_weights_says_how_to_train_them(tmp_path: Path) -> None:
    with pytest.raises(WeightsError, match=r"No stage.*Stage 4.*--range 2/0\.2"):
        Cascade.load("compact", (4,), tmp_path)
    with pytest.raises(WeightsError, match="Because"):
        Cascade([], [SkippedStage(1, RANGES[0], "Because.")])


@pytest.mark.parametrize("numbers", [(0,), (3, 6), (-1,)])
def test_there_are_five_stages(tmp_path: Path, numbers: tuple[int, ...]) -> None:
    save(tmp_path, 3, 5)
    with pytest.raises(ConfigError, match="1 to 5"):
        Cascade.load("compact", numbers, tmp_path)


def test_there_must_be_such_a_preset(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="compact, paper"):
        Cascade.load("huge", folder=tmp_path)


def test_weights_under_another_stage_s_name_are_refused(tmp_path: Path) -> None:
    save(tmp_path, 3)
    weights_path("compact", RANGES[2], tmp_path).rename(weights_path("compact", RANGES[3], tmp_path))
    with pytest.raises(WeightsError, match=r"5/0\.5"):
        Cascade.load("compact", (4,), tmp_path)


def test_rounding_is_removed_from_rotations() -> None:
    exact = miscalibration([5.0, -7.0, 11.0], [0.1, 0.2, 0.3])
    rounded = torch.from_numpy(exact).float().numpy().astype(np.float64)
    result = orthonormal(rounded)
    np.testing.assert_allclose(result[:3, :3] @ result[:3, :3].T, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(result, exact, atol=1e-6)
    np.testing.assert_allclose(result @ invert(result), np.eye(4), atol=1e-14)


class Drive:
    """Frames that count how often they are read; those in ``blind`` see no point."""

    def __init__(self, count: int, blind: frozenset[int] = frozenset()) -> None:
        self.count, self.blind, self.read = count, blind, [0] * count

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, position: int) -> Frame:
        self.read[position] += 1
        frame = make_frame(position % 3)
        points = frame.points[:0] if position in self.blind else frame.points
        return replace(frame, index=10 + position, points=points)


def test_a_drive_is_solved_by_all_its_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("calibnet.drive.solve.FRAMES_UNTIL_LAST_LOOK", 2)
    drive, told = Drive(4, blind=frozenset({1})), []
    estimate = cascade().calibrate_drive(drive, INITIAL, lambda *numbers: told.append(numbers))
    often = 3 * LOOKS + 1
    assert drive.read == [1, often, 1, often], "two frames in all passes of the three stages, all in the last one"
    assert told == [(number, 2 + 2 * often) for number in range(2 + 2 * often + 1)], "and once at the end"
    assert estimate.frames == 3 and [bad.frame for bad in estimate.skipped] == [11]
    assert "frame 11" in estimate.skipped[0].why
    assert [frame for frame, _ in estimate.history] == [10, 12, 13]
    np.testing.assert_array_equal(estimate.history[-1][1].covariance, estimate.covariance)
    rotation = estimate.camera_from_lidar[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
    assert (np.linalg.eigvalsh(estimate.covariance) > 0).all()


def test_edges_are_aligned_after_the_finest_stage_only(frame: Frame) -> None:
    coarse, fine = (cascade(numbers).calibrate_drive([frame, frame], INITIAL) for numbers in ((3, 4), (4, 5)))
    assert coarse.networks is None and fine.networks is not None
    assert not np.array_equal(fine.camera_from_lidar, fine.networks.camera_from_lidar)
    moved = pose_error(fine.camera_from_lidar, fine.networks.camera_from_lidar)
    assert moved.translation_cm < 5 * 14 and moved.rotation_deg < 5 * 0.21, "not farther than networks are wrong"
    assert fine.translation_cm > fine.networks.translation_cm, "what two equal frames get wrong alike is counted"


def test_a_long_drive_notes_the_estimate_down_now_and_then(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("calibnet.drive.solve.FRAMES_ALIGNED", 2)
    monkeypatch.setattr("calibnet.drive.convergence.POINTS", 2)
    gathered: list[int] = []
    monkeypatch.setattr("calibnet.drive.solve.gather", lambda frame, _: gathered.append(frame.index) or Evidence(()))
    estimate = cascade((5,)).calibrate_drive(Drive(5), INITIAL)
    assert gathered == [frame for frame, _ in estimate.history] == [11, 14]
    assert estimate.frames == 5 and estimate.networks is not None
    np.testing.assert_allclose(estimate.camera_from_lidar, estimate.networks.camera_from_lidar, atol=1e-9)


def test_the_curve_of_a_drive_ends_at_its_estimate(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("calibnet.drive.convergence.POINTS", 2)
    estimate = cascade((5,)).calibrate_drive(Drive(4, blind=frozenset({3})), INITIAL)
    assert [(frame, then.frames) for frame, then in estimate.history] == [(11, 2), (12, 3)]
    np.testing.assert_array_equal(estimate.history[-1][1].camera_from_lidar, estimate.camera_from_lidar)


def test_frames_that_fail_are_made_up_for_by_the_next() -> None:
    due = Due([1, 3, 4])
    assert [due.reached(position) for position in (0, 2, 3, 5, 6)] == [False, True, True, True, False]


def test_a_drive_without_a_usable_frame_is_an_error() -> None:
    with pytest.raises(CalibrationError, match="LiDAR point"):
        cascade().calibrate_drive(Drive(2, blind=frozenset({0, 1})), INITIAL)
    with pytest.raises(ValueError, match="no frames"):
        cascade().calibrate_drive([], INITIAL)


@pytest.mark.parametrize(
    ("stage", "angles", "offset", "settled"),
    [
        (1, [9.9, -9.9, 9.9], [0.9, -0.9, 0.9], True),
        (1, [0, 0, 10.1], [0, 0, 0], False),
        (1, [0, 0, 0], [0, -1.1, 0], False),
        (3, [1.9, 0, 0], [0.19, 0, 0], True),
        (3, [2.1, 0, 0], [0, 0, 0], False),
        (4, [0.9, 0, 0], [0.09, 0, 0], True),
        (5, [0, 0, 0], [0, 0, 0], False),
    ],
)
def test_a_stage_is_settled_within_the_range_of_the_next(
    stage: int, angles: list[float], offset: list[float], settled: bool
) -> None:
    assert (
        Stage(stage, RANGES[stage - 1], tiny_network(stage=stage)).is_settled(miscalibration(angles, offset)) is settled
    )


def wandering(monkeypatch: pytest.MonkeyPatch, corrections: dict[int, list[float]]) -> list[int]:
    """Let stages move by so many metres along x, whatever they see, the next number at each look; returns who ran."""
    ran: list[int] = []

    def correct(stage: Stage, frame: Frame, view: View, before: Extrinsic, *_: Any) -> StageTrace:
        ran.append(stage.number)
        correction = miscalibration([0, 0, 0], [corrections[stage.number].pop(0), 0, 0])
        return StageTrace(stage.number, stage.range, frame.camera, before, correction @ before, correction)

    monkeypatch.setattr(Stage, "correct", correct)
    return ran


def with_wider_stages() -> Cascade:
    whole = cascade((1, 2, 3, 4, 5))
    return Cascade(whole.stages[2:], wider=whole.stages[:2])


@pytest.mark.parametrize(
    ("first_try", "again", "expected"),
    [
        (0.55, {}, [3, 4, 5]),  # within 1.2 x 0.5 m
        (0.7, {2: 0.65, 3: 0.05}, [3, 4, 5, 2, 3, 4, 5]),
        (1.3, {1: 1.2, 2: 0.05, 3: 0.05}, [3, 4, 5, 1, 2, 3, 4, 5]),
        (4.5, {1: 1.2, 2: 0.05, 3: 0.05}, [3, 4, 5, 1, 2, 3, 4, 5]),
    ],
)
def test_what_leaves_the_range_is_looked_for_again_from_the_stage_whose_range_it_lies_in(
    frame: Frame,
    monkeypatch: pytest.MonkeyPatch,
    first_try: float,
    again: dict[int, float],
    expected: list[int],
) -> None:
    moves = {number: [again.get(number, 0.0)] for number in (1, 2)}
    moves |= {3: [first_try, again.get(3, 0.0)], 4: [0.0, 0.0], 5: [0.0, 0.0]}
    ran = wandering(monkeypatch, moves)
    trace = with_wider_stages().calibrate(frame, INITIAL)
    assert ran == expected and [stage.number for stage in trace.stages] == [3, 4, 5]
    assert [stage.number for stage in trace.wider] == expected[3:-3]
    assert trace.searched == RANGES[min(expected) - 1]
    moved = sum(again.values()) or first_try
    assert trace.rejected == (moved > 0.8), "farther than 1.6 times the range that was asked for"
    np.testing.assert_allclose(trace.arrived, miscalibration([0, 0, 0], [moved, 0, 0]) @ INITIAL, atol=1e-12)


def test_what_wanders_from_all_ranges_is_left_as_it_was(frame: Frame, monkeypatch: pytest.MonkeyPatch) -> None:
    wandering(monkeypatch, {1: [4.0], 2: [0.5], 3: [4.5, 0.0], 4: [0.0, 0.0], 5: [0.0, 0.0]})
    trace = with_wider_stages().calibrate(frame, INITIAL)
    assert trace.fits and trace.rejected
    np.testing.assert_array_equal(trace.corrected, INITIAL)
    np.testing.assert_allclose(trace.arrived[0, 3] - INITIAL[0, 3], 4.5, atol=1e-12)


def test_stages_that_were_asked_for_only_reject(frame: Frame, monkeypatch: pytest.MonkeyPatch) -> None:
    ran = wandering(monkeypatch, {3: [0.9], 4: [0.0], 5: [0.0]})
    trace = cascade((3, 4, 5)).calibrate(frame, INITIAL)
    assert ran == [3, 4, 5] and trace.wider == () and trace.rejected


def test_wider_stages_are_loaded_where_they_are_wanted(tmp_path: Path) -> None:
    save(tmp_path, 1, 3, 5)
    loaded = Cascade.load("compact", (3, 5), tmp_path, wider=True)
    assert [stage.number for stage in loaded.stages] == [3, 5] and [stage.number for stage in loaded.wider] == [1]
    assert Cascade.load("compact", (3, 5), tmp_path).wider == []


def test_a_further_look_that_fails_costs_no_result(frame: Frame, monkeypatch: pytest.MonkeyPatch) -> None:
    once = cascade((5,)).calibrate(frame, INITIAL)
    look, looks = Stage.look, list[int]()

    def blind_at_second(stage: Stage, *seen: Any, **options: Any) -> StageTrace:
        looks.append(stage.number)
        if len(looks) > 1:
            raise CalibrationError("Only 3 cells hold a LiDAR point.")
        return look(stage, *seen, **options)

    monkeypatch.setattr(Stage, "look", blind_at_second)
    trace = cascade((5,), settings={5: StageSettings(looks=2)}).calibrate(frame, INITIAL)
    assert looks == [5, 5]
    np.testing.assert_array_equal(trace.arrived, once.arrived)

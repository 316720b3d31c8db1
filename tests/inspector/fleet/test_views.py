"""What is made of a fleet: the history of a mount, the page, the catalogue, and a list to train on."""

from __future__ import annotations

import re
import time
from dataclasses import replace
from html import unescape
from pathlib import Path
from threading import Event
from urllib.error import HTTPError
from urllib.parse import quote, unquote, urlsplit
from urllib.request import Request, urlopen

import numpy as np
import pytest

from calibnet.errors import DatasetError
from calibnet.geometry import miscalibration
from calibnet.training.data import open_data
from inspector.cli.fleet import news
from inspector.fleet import viewing
from inspector.fleet.catalogue import end_server
from inspector.fleet.drives import Drive
from inspector.fleet.history import histories, judged_by_cars
from inspector.fleet.page import make_page
from inspector.fleet.table import FAILED, TABLE, Row, read_table, row_of, worst_first, write_table
from tests.inspector.fleet.conftest import Invoke, rows_of
from tests.support.fakes import REFERENCE
from tests.support.judged_drives import COVARIANCE, JudgedCascade

MOVED = miscalibration([0.0, 2.0, 0.0], [0.0, 0.0, 0.0]) @ REFERENCE


def row(drive: str, verdict: str = "accepted", found: np.ndarray = REFERENCE, **more: object) -> Row:
    of = row_of(
        Drive(str(more.pop("car", "a")), drive, "folder", "/data", date=str(more.pop("date", ""))),
        verdict=verdict,
        camera_from_lidar=tuple(found.ravel().tolist()),
        covariance=tuple(COVARIANCE.ravel().tolist()),
        sigma_deg=0.09,
        sigma_cm=1.7,
        moved_deg=0.0,
        moved_cm=0.0,
        given_camera_from_lidar=tuple(REFERENCE.ravel().tolist()),
    )
    return replace(of, **more)  # type: ignore[arg-type]


def test_a_mount_that_moved_is_found_between_its_drives() -> None:
    rows = [
        row("d4", "rejected", MOVED, date="2026-01-04"),
        row("d1", date="2026-01-01"),
        row("d2", date="2026-01-02"),
        row("d3", "rejected", MOVED, date="2026-01-03"),
    ]
    (history,) = histories(rows)
    (move,) = history.moves
    assert (move.before.drive, move.after.drive) == ("d2", "d3")
    assert move.rotation_deg == pytest.approx(2.0, abs=1e-6)
    assert history.sentence.startswith("The mount moved between d2 (2026-01-02) and d3 (2026-01-03), by 2.00°")


def test_a_wrong_camera_is_no_mount_that_moved() -> None:
    (history,) = histories([row("d1"), row("d2", "rejected", MOVED, cause="focal-length"), row("d3")])
    assert history.moves == ()
    assert history.sentence == "1 drive with wrong input (focal-length)."


def test_a_calibration_that_was_always_off_has_not_moved() -> None:
    (history,) = histories([row("d1", "rejected", MOVED), row("d2", "rejected", MOVED)])
    assert history.moves == ()
    assert "off on 2 drives" in history.sentence


def test_a_move_within_the_tolerance_is_none() -> None:
    little = miscalibration([0.0, 0.3, 0.0], [0.0, 0.0, 0.0]) @ REFERENCE
    (history,) = histories([row("d1"), row("d2", found=little)])
    assert history.moves == ()


def unsure(drive: str, found: np.ndarray = REFERENCE, **more: object) -> Row:
    """A drive that cannot tell by itself."""
    wide = {"covariance": tuple((4 * COVARIANCE).ravel().tolist()), "sigma_deg": 0.18, "sigma_cm": 3.4}
    return row(drive, "cannot tell", found, **wide, **more)


def test_drives_that_cannot_tell_do_so_together() -> None:
    rows = judged_by_cars([unsure("d1"), unsure("d2"), unsure("d3")])
    assert [(one.verdict, one.by_car, one.word) for one in rows] == [("cannot tell", "accepted", "accepted")] * 3
    assert rows[0].by_car_reason.startswith("3 drives of the car agree. The calibration is off by no more than")
    assert rows[0].by_car_moved_deg == pytest.approx(0.0, abs=1e-6)
    assert 0.17 < (rows[0].by_car_sigma_deg or 0.0) < 0.25, "what drives get wrong alike stays: 0.12° on three axes"


def test_two_drives_do_not_say_more_than_each_by_itself() -> None:
    rows = judged_by_cars([unsure("d1"), unsure("d2")])
    assert [one.by_car for one in rows] == ["", ""]


def test_a_mount_that_moved_is_told_by_drives_that_cannot_tell() -> None:
    rows = [unsure(f"d{at}", REFERENCE if at < 4 else MOVED) for at in range(1, 7)]
    (history,) = histories(rows)
    (move,) = history.moves
    assert (move.before.drive, move.after.drive, move.drives, move.certain) == ("d3", "d4", 3, True)
    assert move.rotation_deg == pytest.approx(2.0, abs=1e-6)
    judged = judged_by_cars(rows)
    assert [one.word for one in judged] == ["accepted"] * 3 + ["rejected"] * 3
    assert judged[3].by_car_moved_deg == pytest.approx(2.0, abs=1e-6)
    assert [one.drive for one in worst_first(judged)][:3] == ["d4", "d5", "d6"]


def test_the_command_ends_with_what_moved() -> None:
    moved = [unsure(f"d{at}", REFERENCE if at < 4 else MOVED, car=f"c{car}") for car in range(12) for at in range(1, 7)]
    still = [row(f"d{at}", car="still") for at in range(1, 4)]
    together, first, *others, rest = news(judged_by_cars([*moved, *still]))
    assert together == "72 of these verdicts come from all drives of the car together."
    assert first.startswith("c0: The mount moved between d3 and d4, by 2.00°")
    assert len(others) == 9
    assert rest == "2 more mounts moved."
    assert list(news(judged_by_cars(still))) == []


def test_the_last_drive_alone_only_seems_to_have_moved() -> None:
    (history,) = histories([*(unsure(f"d{at}") for at in range(1, 6)), unsure("d6", MOVED)])
    (move,) = history.moves
    assert (move.before.drive, move.after.drive, move.certain) == ("d5", "d6", False)
    assert "seems to have moved between d5 and d6, by 2.00°" in history.sentence
    assert "more drives are needed" in history.sentence
    assert [one.by_car for one in history.judged] == ["accepted"] * 5 + ["apart"]


def test_one_drive_in_the_middle_stands_apart() -> None:
    rows = [unsure(f"d{at}", MOVED if at == 3 else REFERENCE) for at in range(1, 7)]
    (history,) = histories(judged_by_cars(rows))
    assert history.moves == ()
    assert "d3 is an outlier." in history.sentence
    judged = list(history.judged)
    assert [one.word for one in judged].count("accepted") == 5
    assert judged[2].word == "apart"
    assert judged[2].by_car_reason == "It is an outlier: 5 other drives find the mount 2.00° / 1 cm away."


def test_a_drive_whose_frames_do_not_agree_stands_apart() -> None:
    torn = replace(unsure("d3"), covariance=tuple((64 * COVARIANCE).ravel().tolist()), sigma_deg=0.72, sigma_cm=13.6)
    rows = [unsure("d1"), unsure("d2"), torn, unsure("d4"), unsure("d5")]
    judged = judged_by_cars(rows)
    assert [one.by_car for one in judged] == ["accepted", "accepted", "apart", "accepted", "accepted"]
    assert judged[2].by_car_reason.startswith(
        "Its frames scatter 4 times as much as those of the other drives: the mount may have moved"
    )
    few = judged_by_cars([*rows[:2], replace(torn, frames=1), *(replace(one, frames=4) for one in rows[3:])])
    assert few[2].by_car != "apart", "fewer frames leave more open by themselves"


def test_a_car_whose_input_is_wrong_accepts_nothing() -> None:
    wrong = [row(f"w{at}", "rejected", MOVED, cause="focal-length") for at in range(4)]
    judged = judged_by_cars([*wrong, unsure("d1"), unsure("d2"), unsure("d3")])
    assert [one.by_car for one in judged[4:]] == ["cannot tell"] * 3
    assert [one.by_car for one in judged[:4]] == [""] * 4


def test_what_a_car_says_does_not_stay_when_its_drives_are_gone() -> None:
    (first, *_) = judged_by_cars([unsure("d1"), unsure("d2"), unsure("d3")])
    (again,) = judged_by_cars([first])
    assert again == unsure("d1")


def test_an_accepted_drive_that_stands_apart_is_no_longer_accepted() -> None:
    rows = [unsure(f"d{at}") for at in range(1, 4)] + [row("d4", "accepted", MOVED)] + [unsure("d5"), unsure("d6")]
    judged = {one.drive: one for one in judged_by_cars(rows)}
    assert (judged["d4"].verdict, judged["d4"].word) == ("accepted", "apart")


def test_the_worst_comes_first() -> None:
    rows = [
        row("good"),
        row("off", "rejected", moved_deg=1.0),
        row("lost", FAILED),
        row("far", "rejected", moved_deg=9.0),
    ]
    assert [one.drive for one in worst_first(rows)] == ["lost", "far", "off", "good"]


def test_a_table_is_read_as_it_was_written(tmp_path: Path) -> None:
    rows = [row("one"), replace(row("two", FAILED), camera_from_lidar=None, covariance=None, moved_deg=None)]
    write_table(rows, tmp_path / TABLE)
    assert read_table(tmp_path / TABLE) == rows


@pytest.mark.parametrize("data", [b"", b"PAR1 and nothing more", b"{}"])
def test_what_is_no_table_is_a_sentence(tmp_path: Path, data: bytes) -> None:
    (tmp_path / TABLE).write_bytes(data)
    with pytest.raises(DatasetError, match="is not a Parquet table"):
        read_table(tmp_path / TABLE)


def test_a_table_of_something_else_is_a_sentence(tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table({"a": [1]}), tmp_path / TABLE)
    with pytest.raises(DatasetError, match="car is missing"):
        read_table(tmp_path / TABLE)


def test_a_car_of_two_cameras_is_one_car(tmp_path: Path) -> None:
    two = [replace(row("d1"), camera="2"), replace(row("d1"), camera="3")]
    assert "<h1>2 drives of 1 car: 2 accepted</h1>" in make_page(two, tmp_path)
    assert "<h1>1 drive of 1 car: 1 accepted</h1>" in make_page(two[:1], tmp_path)


def test_foreign_names_are_text_on_the_page(tmp_path: Path) -> None:
    page = make_page([row("<script>alert(1)</script>", car='"><img src=x>', reason="<b>")], tmp_path)
    assert "<script>alert" not in page
    assert "<img src=x>" not in page
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in page


def test_a_long_reason_unfolds_and_loses_nothing(tmp_path: Path) -> None:
    reason = "It begins so. " + 40 * "Frame 7: cut. " + "<It ends so.>"
    page = make_page([row("d1", reason=reason), row("d2", reason="Short.")], tmp_path)
    (start, rest) = re.findall(r"<details><summary>(.*) …</summary>(.*)</details>", page)[0]
    assert len(start) <= 120 and unescape(f"{start} {rest}") == reason
    assert '<td class="reason">Short.</td>' in page


def test_the_reason_of_the_other_verdict_unfolds(tmp_path: Path) -> None:
    of_car = row("d1", "cannot tell", reason="Two frames.", by_car="rejected", by_car_reason="Off by 2°.")
    page = make_page([of_car, row("d2", reason="Good.", by_car="accepted", by_car_reason="All agree.")], tmp_path)
    folds = [re.sub("<[^>]+>", "|", fold) for fold in re.findall(r"<details>(.*?)</details>", page)]
    assert folds == ["|Off by 2°. …|||Alone: Two frames.|", "|Good. …|||By its car: All agree.|"]


def test_a_picture_is_of_the_result_or_else_of_what_a_rejected_drive_had(tmp_path: Path) -> None:
    one = row("d1", "rejected", report="drives/a/d1/index.html")
    pictures = tmp_path / one.folder / "pictures"
    pictures.mkdir(parents=True)
    for name in ("median_start", "worst_rejected-and-left-as-it-was", "best_corrected", "median_whole-drive-as-one"):
        (pictures / f"{name}.jpg").touch()
        shown = re.findall(r'<img loading="lazy" src="(.*?)"', make_page([one], tmp_path))
        assert shown == ([] if name == "median_start" else [f"{one.folder}/pictures/{name}.jpg"])


def test_a_recording_without_a_frame_is_not_offered(tmp_path: Path) -> None:
    whole, failed = (
        row("d1", "accepted", recording="d1.rrd", frames=3),
        row("d2", "failed", recording="d2.rrd", frames=0),
    )
    page = make_page([whole, failed], tmp_path)
    assert "d1.rrd" in page and "d2.rrd" not in page


def test_links_of_the_page_lead_to_files(invoke: Invoke, cars: Path) -> None:
    Path("DRIVES.csv").write_text("path,car,drive\ncar-a/monday,50% <a>,x/y?z#w\n")
    assert invoke("fleet", "DRIVES.csv", "--output", "all", "--workers", "0")[0] == 0
    code, out, _ = invoke("fleet-report", "all")
    assert code == 0
    assert out.startswith("Page: all/index.html")
    page = Path("all/index.html").read_text()
    links = set(re.findall(r'(?:href|src)="([^"]+)"', page)) - {"data:,"}
    assert len(links) == 4, "report, recording, picture, table"
    assert [link for link in links if not (Path("all") / unquote(link)).is_file()] == []


def test_the_catalogue_has_every_drive_with_its_verdict(invoke: Invoke, cars: Path, cascade: JudgedCascade) -> None:
    pytest.importorskip("datafusion", reason="the extra [fleet] is not installed")
    from rerun.catalog import CatalogClient

    from inspector.fleet.catalogue import serve

    for scan in (cars / "tuesday" / "clouds").iterdir():
        scan.write_bytes(scan.read_bytes()[:1001])
    invoke("fleet", str(cars / "monday"), str(cars / "tuesday"), "--output", "all", "--workers", "0")
    rows = [replace(one, by_car="rejected" if one.drive == "monday" else "") for one in rows_of(Path("all")).values()]
    with serve(rows, Path("all").absolute()) as catalogue:
        address, _, entry = catalogue.address.partition("/entry/")
        host = str(urlsplit(address).hostname)
        assert host.startswith("127.")
        assert host != "127.0.0.1", "Rerun's server answers any Host, so its address must not be known"
        (dataset,) = (one for one in CatalogClient(address).datasets() if str(one.id) == entry)
        table = dataset.segment_table().to_pydict()
        names = [one[0] for one in table["property:run:drive"]]
        words = [one[0] for one in table["property:verdict:word"]]
        known = [one[0] for one in table["property:known:word"]]
        ranks = [one[0] for one in table["property:known:rank"]]
        links = [one[0] for one in table["property:known:open"]]
        assert links == [dataset.segment_url(segment) for segment in table["rerun_segment_id"]]
        assert len(dataset.blueprints()) == 2
        assert dataset.default_blueprint() is not None
    assert dict(zip(names, words, strict=True)) == {"monday": "accepted", "tuesday": "failed"}
    assert dict(zip(names, known, strict=True)) == {"monday": "rejected", "tuesday": "failed"}, "as the table has it"
    assert dict(zip(names, ranks, strict=True)) == {"tuesday": 1, "monday": 2}, "the worst first"


def test_the_catalogue_ends_while_a_viewer_is_open() -> None:
    """Rerun's server does not shut down before its last viewer closes, which would make Ctrl-C useless."""
    viewer_closes = Event()

    class Server:
        def shutdown(self) -> None:
            viewer_closes.wait()

    began = time.monotonic()
    end_server(Server())
    assert time.monotonic() - began < 20.0
    viewer_closes.set()


def test_the_catalogue_in_a_browser_is_behind_the_guard_of_all_pages(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(viewing, "fetch_viewer", lambda folder: (folder / "index.html").write_text("the viewer"))
    data = "rerun+http://127.7.8.9:4711/entry/abc"
    with viewing.open_viewer(data, in_browser=True, headless=False) as said:
        page = said.removeprefix("In a browser: ")
        address, _, query = page.partition("?")
        assert f"url={quote(data, safe='')}" in query
        with urlopen(address) as answer:
            assert answer.read() == b"the viewer"
            assert "http://127.7.8.9:4711;" in answer.headers["content-security-policy"]
        stranger = Request(address, headers={"Host": "evil.example"})
        for code, request in ((403, stranger), (404, Request(f"http://{urlsplit(address).netloc}/"))):
            with pytest.raises(HTTPError) as refused:
                urlopen(request)
            assert refused.value.code == code


def test_a_list_gives_training_the_drives_with_a_good_calibration(invoke: Invoke, cars: Path) -> None:
    invoke("fleet", str(cars / "monday"), str(cars / "tuesday"), "--output", "all", "--workers", "0", "--frames", "0:1")
    file = Path("all") / TABLE
    rows = [replace(one, verdict="rejected") if one.drive == "tuesday" else one for one in read_table(file)]
    write_table([replace(one, selection="0:1") for one in rows], file)
    (good,) = open_data(f"list:{file}")
    assert (good.name, len(good)) == ("folder/monday", 1)
    (bad,) = open_data(f"list:{file}:rejected")
    assert bad.name == "folder/tuesday"
    with pytest.raises(DatasetError, match="has no drive that is failed"):
        open_data(f"list:{file}:failed")


def test_a_list_hears_what_the_car_of_a_drive_says(cars: Path, tmp_path: Path) -> None:
    drive = Drive("a", "monday", "folder", str(cars / "monday"))
    for alone, by_car, accepted in [
        ("accepted", "apart", False),
        ("accepted", "rejected", False),
        ("cannot tell", "accepted", True),
        ("cannot tell", "", False),
        ("rejected", "accepted", False),
    ]:
        write_table([row_of(drive, verdict=alone, by_car=by_car)], tmp_path / TABLE)
        if accepted:
            assert [one.name for one in open_data(f"list:{tmp_path / TABLE}")] == ["folder/monday"]
        else:
            with pytest.raises(DatasetError, match="has no drive that is accepted"):
                open_data(f"list:{tmp_path / TABLE}")

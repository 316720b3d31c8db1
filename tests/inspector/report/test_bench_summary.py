"""The first table of ``bench``: a line a method, every run counted once."""

from __future__ import annotations

from typing import Any

from inspector.report.bench_summary import summary


def measured(rig: str, runs: int, degrees: float, centimetres: float, **more: Any) -> dict[str, Any]:
    errors = {"rotation_deg": {"mean": degrees}, "translation_cm": {"mean": centimetres}}
    return {"range": "5/0.5", "rig": rig, "of": "frames", "runs": runs, "refused": 0, **errors, **more}


def method(rows: list[dict[str, Any]], samples: int | None, **more: Any) -> dict[str, Any]:
    costs = {"parameters": 2_000_000, "multiply_adds": 0, "latency_ms": 12.0, "trained_on": []}
    return {"rows": rows, "samples_trained": samples, "audit": {}, "claims": [], **costs, **more}


REFUSED = {"runs": 4, "refused": 4, "why": "The method rejects all that it finds."}
HALF = measured("", 4, 9, 9, refused=2)
CONTENT = {
    "ranges": ["5/0.5"],
    "initial": [measured("A", 2, 4, 40), measured("B", 6, 8, 80), measured("C", 4, 5, 50)],
    "methods": {
        "trained": method(
            [
                measured("A", 2, 1, 10, in_rig=True, refused=1),
                measured("B", 6, 3, 2, in_rig=True),
                measured("C", 4, 5, 55, in_rig=False, of_runs=9),
            ],
            10_000,
            audit={"range": "5/0.5", "grey": REFUSED, "swapped": HALF},
            claims=[{"range": "±1 m", "rotation_deg": 0.1, "translation_cm": 2.0, "rig": "", "source": ""}],
        ),
        "untrained": method(
            [measured("A", 2, 2, 20, in_rig=False), {"range": "5/0.5", "rig": "C", "of": "frames", **REFUSED}],
            0,
            audit={"range": "1/0.1", "grey": HALF},
            costs_of="1/0.1",
        ),
        "absent": method([{"range": "5/0.5", "rig": "", "in_rig": None, "why": "There are no weights."}], None),
    },
}
CONTENT["methods"]["untrained"]["rows"][1]["in_rig"] = False  # type: ignore[index]


def test_means_are_over_runs_and_rigs_stand_where_trained_methods_know_them() -> None:
    heads, body = summary(CONTENT, "5/0.5")
    cells = {line[0]: dict(zip(heads, line, strict=True)) for line in body}
    assert (cells["trained"]["rigs trained on"], cells["trained"]["other rigs"]) == ("2.50° / 4.0 cm", "5.00° / 55 cm")
    assert cells["no correction"]["rigs trained on"] == "7.00° / 70 cm"
    assert (cells["untrained"]["rigs trained on"], cells["untrained"]["other rigs"]) == ("2.00° / 20 cm", "refused")
    assert (cells["trained"]["refused"], cells["untrained"]["refused"]) == ("1 of 12 (17)", "4 of 6")
    assert (cells["trained"]["grey image"], cells["trained"]["other image"]) == ("refused", "50% refused")
    assert cells["untrained"]["grey image"] == "–", "its audit is of another range"
    assert (cells["trained"]["parameters"], cells["untrained"]["parameters"]) == ("2.00 M", "–")
    assert cells["trained"]["its paper"] == "0.1° / 2 cm from ±1 m"
    assert list(cells["absent"].values())[1:6] == ["not run", "–", "–", "–", "–"]


def test_columns_of_which_nothing_is_known_are_left_out() -> None:
    entry = method([measured("A", 2, 2, 20, in_rig=False)], 0)
    heads, _ = summary({"ranges": ["5/0.5"], "methods": {"only": entry}}, "5/0.5")
    assert heads == ["method", "of", "other rigs", "refused", "a frame", "parameters"]

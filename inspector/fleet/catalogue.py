"""All recordings of a fleet in Rerun's catalogue: a table to sort and filter, whose rows open in our layout.

Rerun's server reads the recordings where they are. Their properties are the table's columns
(`inspector.record.outcome`), the table's layout is a blueprint of ours, and the layout of the drives is taken from one
of the recordings.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import Thread
from typing import Any

from rerun.chunk import RrdReader

from calibnet.errors import ConfigError
from calibnet.runtime.text import one_line
from inspector import entities
from inspector.fleet.extra import require_extra
from inspector.fleet.table import Row, worst_first
from inspector.programs import own_address

DATASET = "fleet"
PATIENCE_S = 1.0
KNOWN = "known"
"""Name of a layer over each recording, and of its property with the columns of the fleet's table."""
RUN, OUTCOME, TOLD = (f"property:{name}" for name in (entities.RUN, entities.OUTCOME, KNOWN))
LINK, RANK = f"{TOLD}:open", f"{TOLD}:rank"
SHOWN = {
    LINK: "open",
    RANK: "rank",
    f"{RUN}:car": "car",
    f"{RUN}:drive": "drive",
    f"{TOLD}:date": "date",
    f"{RUN}:camera": "camera",
    f"{TOLD}:word": "verdict",
    f"{OUTCOME}:cause": "cause",
    f"{TOLD}:moved_deg": "moved [°]",
    f"{TOLD}:moved_cm": "moved [cm]",
    f"{TOLD}:sigma_deg": "± (1σ) [°]",
    f"{TOLD}:sigma_cm": "± (1σ) [cm]",
    f"{TOLD}:by_car_moved_deg": "by its car [°]",
    f"{TOLD}:by_car_moved_cm": "by its car [cm]",
    f"{OUTCOME}:word": "alone",
    f"{OUTCOME}:error_deg": "error [°]",
    f"{OUTCOME}:error_cm": "error [cm]",
    f"{OUTCOME}:frames_used": "frames",
    f"{OUTCOME}:frames_skipped": "skipped",
    f"{OUTCOME}:reason": "why",
    f"{TOLD}:by_car_reason": "why by its car",
}
"""Columns in order, and their headings; all others can be switched on in the viewer."""
FIGURES = ("moved_deg", "moved_cm", "sigma_deg", "sigma_cm", "by_car_moved_deg", "by_car_moved_cm")
"""Columns of the fleet's table that are shown with two decimals."""


@dataclass(frozen=True)
class Catalogue:
    """A running server.

    Attributes:
        address: address of the fleet's table, for a viewer.
        count: number of drives in the table.
    """

    address: str
    count: int


@contextmanager
def serve(rows: Sequence[Row], folder: Path) -> Iterator[Catalogue]:
    """Serve the recordings of a fleet on this machine while the context is entered.

    Args:
        rows: rows of the fleet's table.
        folder: the fleet's folder.

    Raises:
        ConfigError: the extra is not installed, there are no recordings, or the server rejects one.
    """
    require_extra("datafusion")
    import rerun as rr

    recorded = {folder / row.recording: row for row in rows if row.recording and (folder / row.recording).is_file()}
    files = list(recorded)
    if not files:
        raise ConfigError(f"{folder} has no recordings of the drives in its table; run `calib-inspect fleet` again.")
    with ExitStack() as stack:
        ours = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="calib-inspect-")))
        try:
            server = rr.server.Server(host=own_address(), datasets={DATASET: files})
            stack.callback(end_server, server)
            dataset = server.client().get_dataset(DATASET)
            ranks = {row.folder: rank for rank, row in enumerate(worst_first(rows), start=1)}
            layers = [
                _layer(ours / f"{ranks[row.folder]}.rrd", file, row, ranks[row.folder], dataset)
                for file, row in recorded.items()
            ]
            dataset.register([layer.as_uri() for layer in layers], layer_name=KNOWN).wait()
            columns = {field.name for field in dataset.segment_table().schema()}
            table_layout(columns).save(entities.APPLICATION_ID, ours / "table.rbl")
            dataset.register_blueprint((ours / "table.rbl").as_uri(), segment_table=True)
            layout = max(files, key=lambda file: file.stat().st_size)  # that of a failed drive has no layout
            dataset.register_blueprint(layout.as_uri())
        except (RuntimeError, ValueError, LookupError, OSError) as error:
            said = one_line(str(error), 300)
            raise ConfigError(
                f"Rerun's server rejects the recordings of {folder} ({said}); run `calib-inspect fleet` again."
            ) from None
        yield Catalogue(f"{server.url()}/entry/{dataset.id}", len(files))


def end_server(server: Any) -> None:
    """End the server, without waiting long for viewers: its shutdown returns only when the last one has closed."""
    ending = Thread(target=server.shutdown, daemon=True)
    ending.start()
    ending.join(PATIENCE_S)


def _layer(layer: Path, recording: Path, row: Row, rank: int, dataset: Any) -> Path:
    """A file that adds to a recording the columns of the fleet's table, the drive's rank, and a link that opens it."""
    import rerun as rr

    (of, *_) = RrdReader(recording).recordings()
    stream = rr.RecordingStream(of.application_id, recording_id=of.recording_id, send_properties=False)
    stream.save(layer)
    known: dict[str, Any] = {
        "open": dataset.segment_url(of.recording_id),
        "rank": rank,
        "word": row.word,
        "date": row.date.removesuffix("T00:00:00"),
        "by_car_reason": row.by_car_reason,
    }
    figures = {name: getattr(row, name) for name in FIGURES}
    known |= {name: round(value, 2) for name, value in figures.items() if value is not None}
    stream.send_property(KNOWN, rr.AnyValues(**known))
    stream.disconnect()
    return layer


def table_layout(columns: set[str]) -> Any:
    """The layout of the table, with the columns that it has; the worst drives come first, as on the page."""
    import rerun as rr
    from rerun.blueprint.table import Column, SortBy, TableBlueprint, TableLayout

    shown = [
        Column(source, name=name, column_type=rr.components.Url if source == LINK else None)
        for source, name in SHOWN.items()
        if source in columns
    ]
    hidden = [Column(source, visible=False) for source in sorted(columns - SHOWN.keys())]
    return TableBlueprint(
        table_layout=TableLayout(columns=[*shown, *hidden]),
        sort_by=SortBy(RANK, direction="ascending") if RANK in columns else None,
    )

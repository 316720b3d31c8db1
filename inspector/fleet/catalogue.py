"""All recordings of a fleet in Rerun's own catalogue: a table to sort and filter, whose rows open with our layout.

Rerun's server reads the recordings where they lie. Their properties are the table's columns
(`inspector.record.outcome`), its layout is a blueprint of ours, and that of the drives is the one in a recording of the
fleet.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from calibnet.errors import ConfigError
from calibnet.runtime.text import one_line
from inspector import entities
from inspector.fleet.extra import require_extra
from inspector.fleet.table import Row
from inspector.programs import own_address

DATASET = "fleet"
RUN, OUTCOME = f"property:{entities.RUN}", f"property:{entities.OUTCOME}"
SHOWN = {
    f"{RUN}:car": "car",
    f"{RUN}:drive": "drive",
    f"{RUN}:date": "date",
    f"{RUN}:camera": "camera",
    f"{OUTCOME}:word": "verdict",
    f"{OUTCOME}:cause": "cause",
    f"{OUTCOME}:moved_deg": "moved [°]",
    f"{OUTCOME}:moved_cm": "moved [cm]",
    f"{OUTCOME}:sigma_deg": "sigma [°]",
    f"{OUTCOME}:sigma_cm": "sigma [cm]",
    f"{OUTCOME}:error_deg": "error [°]",
    f"{OUTCOME}:error_cm": "error [cm]",
    f"{OUTCOME}:frames_used": "frames",
    f"{OUTCOME}:frames_skipped": "skipped",
    "rerun_segment_id": "recording",
    f"{OUTCOME}:reason": "why",
}
"""Columns in their order, and what they are called; all others can be switched on in the viewer."""
LINK = "rerun_segment_id"


@dataclass(frozen=True)
class Catalogue:
    """A server that runs.

    Attributes:
        address: of the fleet's table, for a viewer.
        count: of drives in it.
    """

    address: str
    count: int


@contextmanager
def serve(rows: Sequence[Row], folder: Path) -> Iterator[Catalogue]:
    """Serve the recordings of a fleet on this machine while the context is entered.

    Args:
        rows: of its table.
        folder: of the fleet.

    Raises:
        ConfigError: the extra is not installed, there are no recordings, or the server does not take one.
    """
    require_extra("datafusion")
    import rerun as rr

    files = [folder / row.recording for row in rows if row.recording and (folder / row.recording).is_file()]
    if not files:
        raise ConfigError(f"{folder} holds no recording of the drives in its table; run `calib-inspect fleet` again.")
    with ExitStack() as stack:
        layouts = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="calib-inspect-")))
        try:
            server = stack.enter_context(rr.server.Server(host=own_address(), datasets={DATASET: list(files)}))
            dataset = server.client().get_dataset(DATASET)
            columns = {field.name for field in dataset.segment_table().schema()}
            table_layout(columns).save(entities.APPLICATION_ID, layouts / "table.rbl")
            dataset.register_blueprint((layouts / "table.rbl").as_uri(), segment_table=True)
            layout = max(files, key=lambda file: file.stat().st_size)  # one that failed has no layout of a drive
            dataset.register_blueprint(layout.as_uri())
        except (RuntimeError, ValueError, LookupError, OSError) as error:
            said = one_line(str(error), 300)
            raise ConfigError(f"Rerun's server does not take the recordings of {folder} ({said}).") from None
        yield Catalogue(f"{server.url()}/entry/{dataset.id}", len(files))


def table_layout(columns: set[str]) -> Any:
    """The layout of the table, with the columns that it has; those that failed and were rejected come last."""
    from rerun.blueprint.table import Column, SortBy, TableBlueprint, TableLayout

    shown = [Column(source, name=name) for source, name in SHOWN.items() if source in columns]
    hidden = [Column(source, visible=False) for source in sorted(columns - SHOWN.keys())]
    word = f"{OUTCOME}:word"
    return TableBlueprint(
        table_layout=TableLayout(columns=[*shown, *hidden]),
        sort_by=SortBy(word, direction="descending") if word in columns else None,
    )

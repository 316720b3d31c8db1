"""Sizes of a recording by group of entities, read from the file's footer."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

from rerun.chunk import RrdReader

RAW_VOLUMES = ("cost_volume", "probability", "slices", "marks")


def sizes_by_group(file: Path) -> dict[str, int]:
    """Bytes on disk of every group of entities, largest first; empty for a recording without a footer."""
    try:
        store = RrdReader(file).store()
    except RuntimeError:  # the disk was full, or Ctrl-C came before the footer was written
        return {}
    # Private in this version of Rerun, but the only access to the footer, which takes milliseconds.
    index = store._chunk_index().to_arrow()
    sizes: defaultdict[str, int] = defaultdict(int)
    for entity, size in zip(index["chunk_entity_path"].to_pylist(), index["chunk_byte_size"].to_pylist(), strict=True):
        sizes[group_of(entity.lstrip("/"))] += size
    return dict(sorted(sizes.items(), key=lambda item: -item[1]))


def group_of(entity: str) -> str:
    """The group of an entity path, in words for the terminal."""
    first, _, rest = entity.partition("/")
    if first == "image":
        return "image"
    if first == "overlay":
        return "overlays"
    if first == "world":
        return "3D scene"
    if first.startswith("stage_"):
        last = rest.rpartition("/")[2]
        if last in RAW_VOLUMES:
            return "raw volumes"
        return "hourglass" if last.startswith("hourglass") else "cost-volume maps"
    return "figures and legends"

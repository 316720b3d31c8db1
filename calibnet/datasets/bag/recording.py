"""An open bag: its topics, and messages by topic and time; every failure is one sentence."""

from __future__ import annotations

import weakref
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from calibnet.datasets.bag.mcap_file import McapFile, is_foreign
from calibnet.datasets.bag.messages import IMAGES, INFOS, POINTS, stamp_of
from calibnet.datasets.bag.unpacking import bound_unpacking
from calibnet.errors import DatasetError
from calibnet.runtime.reading import MEGABYTE, require_file

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys.store import Typestore

KINDS = (".bag", ".db3", ".mcap")
"""What a bag's file is called: ROS 1, and the two storages of ROS 2."""
METADATA_BYTES = 16 * MEGABYTE
"""Largest metadata.yaml of a ROS 2 bag."""
DEFINED = {
    *IMAGES,
    *POINTS,
    *INFOS,
    "tf2_msgs/msg/TFMessage",
    "sensor_msgs/msg/PointField",
    "sensor_msgs/msg/RegionOfInterest",
    "std_msgs/msg/Header",
    "builtin_interfaces/msg/Time",
    "geometry_msgs/msg/TransformStamped",
    "geometry_msgs/msg/Transform",
    "geometry_msgs/msg/Vector3",
    "geometry_msgs/msg/Quaternion",
}
"""Messages that are read, and those within them; a bag brings definitions of its own."""


class Topic(NamedTuple):
    """A topic, the type of its messages, and how many there are."""

    name: str
    type: str
    messages: int


class Stamped(NamedTuple):
    """When a message was recorded, in nanoseconds, and what time its own header says, in seconds."""

    recorded: int
    seconds: float


@dataclass(frozen=True)
class Message:
    """A message as it was deserialized, and its time."""

    content: Any
    seconds: float


class BagRecording:
    """One bag, or the several files of one."""

    def __init__(self, paths: Sequence[Path]) -> None:
        """Open it.

        Raises:
            DatasetError: it is missing, damaged, or of a kind that is not known here.
        """
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore

        self.paths = [file for path in paths for file in _parts(path)]
        for path in self.paths:
            for file in _files(path):  # which also makes them inputs, so that no output replaces them
                largest = METADATA_BYTES if file.suffix == ".yaml" else None
                require_file(file, "Bag", largest, DatasetError, "copy it again")
        bound_unpacking()
        old = any(path.suffix == ".bag" for path in self.paths)
        self._reader: AnyReader | McapFile
        with self.failures():
            if any(is_foreign(path) for path in self.paths):
                if len(self.paths) > 1:
                    raise DatasetError(
                        f"Bag {self} was not recorded by ROS 2, and such MCAP files are read one at a time; join them: "
                        "mcap merge A.mcap B.mcap -o AB.mcap."
                    )
                self._reader = McapFile(self.paths[0])
                for channel in self._reader.connections:
                    if channel.store is not None:
                        self._check_definitions(channel.store, channel.old)
            else:
                standard = get_typestore(Stores.ROS1_NOETIC if old else Stores.ROS2_HUMBLE)
                self._reader = AnyReader(self.paths, default_typestore=standard)
                self._reader.open()
                self._check_definitions(self._reader.typestore, old)
        weakref.finalize(self, _close, self._reader)

    @property
    def topics(self) -> list[Topic]:
        """All topics, sorted by name."""
        return sorted(Topic(name, info.msgtype or "", info.msgcount) for name, info in self._reader.topics.items())

    def of_type(self, types: Sequence[str]) -> list[Topic]:
        """The topics of one of some types that hold messages."""
        return [topic for topic in self.topics if topic.type in types and topic.messages]

    def times(self, topic: str) -> list[Stamped]:
        """When the messages of a topic were recorded, and the times that their headers say."""
        with self.failures():
            return [
                Stamped(recorded, self._stamp(connection, data) or recorded * 1e-9)
                for connection, recorded, data in self._reader.messages(self._connections(topic))
            ]

    def messages(self, topic: str, start: int | None = None, most: int | None = None) -> Iterator[Message]:
        """Messages of a topic from a time on.

        Args:
            topic: its name.
            start: nanoseconds, of `Stamped.recorded`; None for the first.
            most: how many.
        """
        with self.failures():
            found = self._reader.messages(self._connections(topic), start=start)
            for number, (connection, recorded, data) in enumerate(found):
                if number == most:
                    return
                yield Message(self._content(connection, data), self._stamp(connection, data) or recorded * 1e-9)

    def message(self, topic: str, at: int | None = None) -> Message:
        """The message of a topic that was recorded at a time, or its first.

        Raises:
            DatasetError: there is none, whatever its index promises, or it is damaged.
        """
        for message in self.messages(topic, at, 1):
            return message
        when = "" if at is None else f" at {at}"
        raise DatasetError(f"Bag {self} holds no message of {topic}{when} that can be read; it is damaged.")

    @contextmanager
    def failures(self) -> Iterator[None]:
        """Say in one sentence what a reader of bags, or one of the libraries below it, cannot read."""
        try:
            yield
        except (DatasetError, GeneratorExit):
            raise
        except Exception as error:  # bags are read by many hands, which fail in as many ways
            why = str(error).splitlines()[0][:200] if str(error) else type(error).__name__
            if isinstance(error, MemoryError):  # what a damaged record says of its own length
                why = "it promises more than there is memory for"
            raise DatasetError(
                f"Bag {self} cannot be read ({why}); reindex it (`rosbag reindex`, `ros2 bag reindex`, `mcap "
                "recover`), or copy it again."
            ) from None

    def _check_definitions(self, store: Typestore, old: bool) -> None:
        """Hold what a bag says of the messages that are read from it against what they are.

        Args:
            store: the types that its messages are decoded with.
            old: whether they are of ROS 1.

        Raises:
            DatasetError: a field is missing there, or of another type.
        """
        from rosbags.typesys import Stores, get_typestore

        standard = dict(get_typestore(Stores.ROS2_HUMBLE).fielddefs)
        if old:  # whose stored messages lack TFMessage, which is the same in both
            standard |= get_typestore(Stores.ROS1_NOETIC).fielddefs
        for name in sorted(store.fielddefs.keys() & DEFINED):
            fields = dict(store.fielddefs[name][1])
            wrong = [field for field, kind in standard[name][1] if fields.get(field) != kind]
            if wrong:
                raise DatasetError(
                    f"Bag {self} defines {name} without {', '.join(wrong)}, or otherwise than ROS does; it is damaged, "
                    "or was recorded with messages of your own under that name."
                )

    def __str__(self) -> str:
        """Its first file."""
        return str(self.paths[0])

    def _connections(self, topic: str) -> list[Any]:
        return [one for one in self._reader.connections if one.topic == topic]

    @contextmanager
    def _naming(self, connection: Any) -> Iterator[None]:
        try:
            yield
        except DatasetError as error:
            raise DatasetError(f"Bag {self}, {connection.topic}: {error}.") from None

    def _stamp(self, connection: Any, data: bytes) -> float:
        if isinstance(self._reader, McapFile):
            with self._naming(connection):
                return float(connection.stamp(data))
        return stamp_of(data, self._reader.is2)

    def _content(self, connection: Any, data: bytes) -> Any:
        if isinstance(self._reader, McapFile):
            with self._naming(connection):
                return connection.decode(data)
        return self._reader.deserialize(data, connection.msgtype)


def _parts(path: Path) -> list[Path]:
    """What libraries open: a file, a folder with its ``metadata.yaml``, or the bags in a folder that has none.

    Raises:
        DatasetError: there is none.
    """
    if not path.exists():
        raise DatasetError(f"Bag {path} does not exist; give a .bag, .db3 or .mcap file, or a ROS 2 bag's folder.")
    if not path.is_dir():
        if path.suffix not in KINDS and path.is_file():
            raise DatasetError(
                f"Bag {path} ends with none of {', '.join(KINDS)}; call it by its kind, and reindex first what a "
                "recorder left as .active (`rosbag reindex`)."
            )
        return [path]
    if (path / "metadata.yaml").exists():
        return [path]
    found = sorted(file for file in path.iterdir() if file.suffix in KINDS)
    if not found:
        raise DatasetError(f"Folder {path} holds no bag; give a .bag, .db3 or .mcap file, or a ROS 2 bag's folder.")
    return found


def _files(path: Path) -> list[Path]:
    """The files of a bag, which libraries open by their names."""
    if not path.is_dir():
        return [path]
    return sorted(file for file in path.iterdir() if file.suffix in (".yaml", ".db3", ".mcap", ".zstd"))


def _close(reader: Any) -> None:
    """Close a reader that is still open."""
    if getattr(reader, "stack", None) is not None:
        reader.close()

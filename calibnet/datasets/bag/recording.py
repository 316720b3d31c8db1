"""An open bag: its topics, and messages by topic and time, with every failure as one sentence."""

from __future__ import annotations

import weakref
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from calibnet.datasets.bag.mcap_file import McapFile, is_foreign
from calibnet.datasets.bag.messages import IMAGES, INFOS, LIVOX, POINTS, stamp_of
from calibnet.datasets.bag.unpacking import bound_unpacking
from calibnet.errors import DatasetError
from calibnet.runtime.reading import MEGABYTE, require_file

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader
    from rosbags.interfaces.typing import Typesdict
    from rosbags.typesys.store import Typestore

KINDS = (".bag", ".db3", ".mcap")
"""File name suffixes of bags: of ROS 1, and of the two storages of ROS 2."""
METADATA_BYTES = 16 * MEGABYTE
"""Largest metadata.yaml of a ROS 2 bag."""
DEFINED = {
    *IMAGES,
    *POINTS,
    *(scan.replace("CustomMsg", "CustomPoint") for scan in LIVOX),
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
"""Message types that are read, including nested ones; a bag has definitions of its own."""
LIVOX_POINT = "uint32 offset_time\nfloat32 x\nfloat32 y\nfloat32 z\nuint8 reflectivity\nuint8 tag\nuint8 line\n"
LIVOX_SCAN = (
    "std_msgs/Header header\nuint64 timebase\nuint32 point_num\nuint8 lidar_id\nuint8[3] rsvd\nCustomPoint[] points\n"
)
"""Livox's messages, which ROS does not define, nor an old bag of ROS 2 that has them."""


class Topic(NamedTuple):
    """A topic, the type of its messages, and their number."""

    name: str
    type: str
    messages: int


class Stamped(NamedTuple):
    """Recording time of a message in nanoseconds, and the time stamp in its header in seconds."""

    recorded: int
    seconds: float

    def as_recorded(self) -> Stamped:
        """The same message, with the time of its recording for its stamp."""
        return Stamped(self.recorded, self.recorded * 1e-9)


@dataclass(frozen=True)
class Message:
    """A deserialized message and its time."""

    content: Any
    seconds: float


class BagRecording:
    """One bag, which may consist of several files."""

    def __init__(self, paths: Sequence[Path]) -> None:
        """Open a bag.

        Raises:
            DatasetError: it is missing, damaged, or of an unsupported kind.
        """
        from rosbags.highlevel import AnyReader

        self.paths = [file for path in paths for file in _parts(path)]
        for path in self.paths:
            for file in _files(path):  # also registers them as inputs, so that no output replaces them
                largest = METADATA_BYTES if file.suffix == ".yaml" else None
                require_file(file, "Bag", largest, DatasetError, "copy it again")
        bound_unpacking()
        old = any(path.suffix == ".bag" for path in self.paths)
        self._reader: AnyReader | McapFile
        with self.failures():
            if any(is_foreign(path) for path in self.paths):
                if len(self.paths) > 1:
                    raise DatasetError(
                        f"Bag {self} was not recorded by ROS 2; several such MCAP files have to be joined first: "
                        "mcap merge A.mcap B.mcap -o AB.mcap."
                    )
                self._reader = McapFile(self.paths[0])
                for channel in self._reader.connections:
                    if channel.store is not None:
                        self._check_definitions(channel.store, channel.old)
            else:
                self._reader = AnyReader(self.paths, default_typestore=_standard(old))
                self._reader.open()
                self._check_definitions(self._reader.typestore, old)
        weakref.finalize(self, _close, self._reader)

    @property
    def topics(self) -> list[Topic]:
        """All topics, sorted by name."""
        return sorted(Topic(name, info.msgtype or "", info.msgcount) for name, info in self._reader.topics.items())

    def of_type(self, types: Sequence[str]) -> list[Topic]:
        """The topics with messages of one of the types."""
        return [topic for topic in self.topics if topic.type in types and topic.messages]

    def times(self, topic: str) -> list[Stamped]:
        """Recording times and time stamps of all messages of a topic."""
        with self.failures():
            return [
                Stamped(recorded, self._stamp(connection, data) or recorded * 1e-9)
                for connection, recorded, data in self._reader.messages(self._connections(topic))
            ]

    def messages(self, topic: str, start: int | None = None, most: int | None = None) -> Iterator[Message]:
        """Messages of a topic from a time on.

        Args:
            topic: name of the topic.
            start: recording time of the first message in nanoseconds; None for the very first.
            most: largest number of messages.
        """
        with self.failures():
            found = self._reader.messages(self._connections(topic), start=start)
            for number, (connection, recorded, data) in enumerate(found):
                if number == most:
                    return
                yield Message(self._content(connection, data), self._stamp(connection, data) or recorded * 1e-9)

    def message(self, topic: str, at: int | None = None) -> Message:
        """The message of a topic that was recorded at a given time, or the first one.

        Raises:
            DatasetError: there is none, or it is damaged.
        """
        for message in self.messages(topic, at, 1):
            return message
        when = "" if at is None else f" at {at}"
        raise DatasetError(
            f"Bag {self} has no readable message of {topic}{when}; it is damaged, so copy or record it again."
        )

    @contextmanager
    def failures(self) -> Iterator[None]:
        """A context that turns every error of the bag libraries into one sentence."""
        try:
            yield
        except (DatasetError, GeneratorExit):
            raise
        except Exception as error:  # bags are read by many libraries, which raise many errors
            why = str(error).splitlines()[0][:200] if str(error) else type(error).__name__
            if isinstance(error, MemoryError):  # a damaged record may state a huge length
                why = "it states a size beyond the available memory"
            raise DatasetError(
                f"Bag {self} cannot be read ({why}); reindex it (`rosbag reindex`, `ros2 bag reindex`, `mcap "
                "recover`), or copy it again."
            ) from None

    def _check_definitions(self, store: Typestore, old: bool) -> None:
        """Check the definitions in a bag of the messages that are read.

        Args:
            store: types with which its messages are decoded.
            old: whether they are of ROS 1.

        Raises:
            DatasetError: a field is missing or has another type.
        """
        standard = _fields(old)
        for name in sorted(store.fielddefs.keys() & DEFINED):
            fields = dict(store.fielddefs[name][1])
            wrong = [field for field, kind in standard[name][1] if fields.get(field) != kind]
            if wrong:
                raise DatasetError(
                    f"Bag {self} defines {name} without {', '.join(wrong)}, or differently from ROS; it is damaged, "
                    "or was recorded with custom messages of that name."
                )

    def __str__(self) -> str:
        """The path of its first file."""
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


def _standard(old: bool) -> Typestore:
    """ROS's message types, of ROS 1 or 2, and Livox's."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if old else Stores.ROS2_HUMBLE)
    for scan in LIVOX:
        store.register(get_types_from_msg(LIVOX_SCAN, scan))
        store.register(get_types_from_msg(LIVOX_POINT, scan.replace("CustomMsg", "CustomPoint")))
    return store


@cache
def _fields(old: bool) -> Typesdict:
    """The definitions of ROS's message types and Livox's."""
    fields = dict(_standard(False).fielddefs)
    return fields | _standard(True).fielddefs if old else fields  # ROS 1's stored types lack TFMessage


def _parts(path: Path) -> list[Path]:
    """The paths to open: a file, a folder with ``metadata.yaml``, or the bags in a folder without one.

    Raises:
        DatasetError: there is none.
    """
    if not path.exists():
        raise DatasetError(f"Bag {path} does not exist; give a .bag, .db3 or .mcap file, or a ROS 2 bag's folder.")
    if not path.is_dir():
        if path.suffix not in KINDS and path.is_file():
            raise DatasetError(
                f"Bag {path} does not end with one of {', '.join(KINDS)}; rename it, and first reindex a file that a "
                "recorder left as .active (`rosbag reindex`)."
            )
        return [path]
    if (path / "metadata.yaml").exists():
        return [path]
    found = sorted(file for file in path.iterdir() if file.suffix in KINDS)
    if not found:
        raise DatasetError(f"Folder {path} is not a bag; give a .bag, .db3 or .mcap file, or a ROS 2 bag's folder.")
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

"""MCAP files that were not recorded by ROS 2: with Foxglove's schemas, ROS 1 messages, or ROS 2 ones by a bridge.

rosbags reads only those of ROS 2; others are read by the format's own library, with the same bounds.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

from calibnet.datasets.bag.foxglove import AS_ROS
from calibnet.datasets.bag.messages import IMAGES, INFOS, POINTS, TRANSFORMS, stamp_of

MAGIC = b"\x89MCAP0\r\n"
HEADER = 64
READ = (*IMAGES, *POINTS, *INFOS, *TRANSFORMS)
Decode = Callable[[bytes], Any]


class Info(NamedTuple):
    """The type of a topic's messages, as named by ROS 2, and their number."""

    msgtype: str
    msgcount: int


@dataclass(frozen=True)
class Channel:
    """A topic's messages of one schema.

    Attributes:
        id: id of the channel in the file.
        topic: name of the topic.
        msgtype: type in ROS 2.
        decode: makes a message with ROS's fields from its bytes; None if it is not supported.
        stamp: time stamp of a message in seconds; 0 for none.
        store: types with which a ROS message is decoded, from its own definition; None for other messages.
        old: whether it is of ROS 1.
    """

    id: int
    topic: str
    msgtype: str
    decode: Decode | None
    stamp: Callable[[bytes], float]
    store: Any = None
    old: bool = False


def is_foreign(path: Path) -> bool:
    """Whether a file is an MCAP file that was not recorded by ROS 2."""
    if path.suffix != ".mcap" or path.is_dir():
        return False
    with path.open("rb") as file:
        start = file.read(HEADER)
    length = int.from_bytes(start[17:21], "little")
    return start.startswith(MAGIC) and start[21 : 21 + length] != b"ros2"


class McapFile:
    """An open file, with the part of `rosbags.highlevel.AnyReader`'s interface that is used here.

    Attributes:
        connections: channels of the file.
        topics: topics by name.
    """

    def __init__(self, path: Path) -> None:
        """Open a file and read its summary."""
        from mcap.reader import NonSeekingReader, make_reader

        self.stack: Any = path.open("rb")
        self._make: Callable[[], Any] = lambda: make_reader(_rewound(self.stack), validate_crcs=True)
        counts: dict[int, int] = {}
        channels: dict[int, tuple[Any, Any]] = {}
        summary = self._make().get_summary()
        if summary is not None and not summary.channels:  # they are optional there, but the seeking reader needs them
            self._make = lambda: NonSeekingReader(_rewound(self.stack), validate_crcs=True)
        if summary is not None and summary.statistics is not None and summary.channels:
            counts = dict(summary.statistics.channel_message_counts)
            channels = {key: (one, summary.schemas.get(one.schema_id)) for key, one in summary.channels.items()}
        else:  # it was not closed properly, or has no statistics
            for schema, channel, _ in self._make().iter_messages():
                counts[channel.id] = counts.get(channel.id, 0) + 1
                channels[channel.id] = (channel, schema)
        self.connections = [_channel(channel, schema) for channel, schema in channels.values()]
        self.topics: dict[str, Info] = {}
        for one in self.connections:
            more = counts.get(one.id, 0)
            known = self.topics.get(one.topic, Info(one.msgtype, 0))
            self.topics[one.topic] = Info(one.msgtype, known.msgcount + more)

    def messages(self, channels: Iterable[Channel], start: int | None = None) -> Iterator[tuple[Channel, int, bytes]]:
        """Messages in order of time, from a start in nanoseconds: channel, recording time and bytes."""
        wanted = {one.id: one for one in channels}
        names = [one.topic for one in wanted.values()]
        for _, channel, message in self._make().iter_messages(topics=names, starting_at=start):
            if channel.id in wanted:
                yield wanted[channel.id], int(message.log_time), message.data

    def close(self) -> None:
        """Close the file."""
        self.stack.close()


def _rewound(file: Any) -> Any:
    file.seek(0)
    return file


def _channel(channel: Any, schema: Any) -> Channel:
    """A channel, with the decoder of its messages."""
    name = "" if schema is None else str(schema.name)
    if name in AS_ROS:
        kind, as_ros = AS_ROS[name]
        own = _decoder(channel.message_encoding, schema)
        if own is None:
            return Channel(channel.id, channel.topic, name, None, lambda _: 0.0)
        decode: Decode = lambda data: as_ros(own(data))  # noqa: E731
        return Channel(channel.id, channel.topic, kind, decode, lambda data: float(decode(data).header.seconds))
    package, _, last = name.rpartition("/")
    kind = f"{package.removesuffix('/msg')}/msg/{last}" if package else name
    old = channel.message_encoding == "ros1"
    if kind not in READ or channel.message_encoding not in ("ros1", "cdr"):
        return Channel(channel.id, channel.topic, kind, None, lambda data: stamp_of(data, not old))
    store = _store(kind, old, schema.data.decode() if schema.encoding.endswith("msg") else "")
    read = store.deserialize_ros1 if old else store.deserialize_cdr
    return Channel(
        channel.id, channel.topic, kind, lambda data: read(data, kind), lambda data: stamp_of(data, not old), store, old
    )


def _decoder(encoding: str, schema: Any) -> Decode | None:
    """The decoder of a message that is not of ROS; None if its encoding is not supported."""
    if encoding == "json":
        return lambda data: json.loads(data, object_hook=lambda fields: SimpleNamespace(**fields))
    if encoding == "protobuf":
        from mcap_protobuf.decoder import DecoderFactory

        return DecoderFactory().decoder_for(encoding, schema)
    return None


@cache
def _store(kind: str, old: bool, definition: str) -> Any:
    """The types to decode a ROS message, from the definition in the file or, without one, ROS's own."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    if not definition.strip():
        return get_typestore(Stores.ROS1_NOETIC if old else Stores.ROS2_HUMBLE)
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(definition, kind))
    return store

"""What people see of a log: its messages, read by the definitions that stand in the file."""

import json
import re
import struct
from collections import defaultdict

import numpy as np
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader

NUMBERS = {
    "float64": "d", "uint32": "I", "int32": "i", "int64": "q", "int8": "b", "uint8": "B",
    "bool": "?",
}  # fmt: skip


def read_topics(path):
    """By topic, each message's time [s] and content; of an unfinished log as far as it goes."""
    schemas, channels, topics = {}, {}, defaultdict(list)
    for found in _records(path):
        kind = type(found).__name__
        if kind == "Schema":
            schemas[found.id] = found
        elif kind == "Channel":
            channels[found.id] = found
        elif kind == "Message" and channels[found.channel_id].schema_id:
            channel = channels[found.channel_id]
            schema = schemas[channel.schema_id]
            topics[channel.topic].append((found.log_time * 1e-9, _content(channel, schema, found)))
    return dict(topics)


def read_signal(path, name):
    """Times and numbers that are seen of a signal, in the order of its samples."""
    field = re.sub(r"\W", "_", name)
    found = [
        message
        for topic, messages in read_topics(path).items()
        if topic.startswith("/signals")
        for _, message in messages
        if field in message
    ]
    found.sort(key=lambda message: message["order"])
    values = np.array([message[field] for message in found], dtype=np.float64)
    return np.array([message["time"] for message in found]), values


def read_by_index(path, topic):
    """Times of a topic's messages [ns] as a reader finds them that goes by the summary."""
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        return [message.log_time for _, _, message in reader.iter_messages(topics=[topic])]


def _records(path):
    with path.open("rb") as stream:
        records = iter(StreamReader(stream, validate_crcs=True).records)
        while True:
            try:
                yield next(records)
            except Exception:
                return


def _content(channel, schema, message):
    if channel.message_encoding == "json":
        assert schema.encoding == "jsonschema"
        return json.loads(message.data)
    assert (channel.message_encoding, schema.encoding) == ("ros1", "ros1msg")
    content, end = _take(_types(schema), schema.name, message.data, 0)
    assert end == len(message.data), "a message that its definition does not explain"
    return content


def _types(schema):
    """Fields by the name of the type, of a definition in the language of ROS 1."""
    types, name = defaultdict(list), schema.name
    for line in schema.data.decode().splitlines():
        words = line.partition("#")[0].split()
        if words[:1] == ["MSG:"]:
            name = words[1]
        elif len(words) == 2:
            types[name].append(tuple(words))
    return types


def _take(types, kind, data, place):
    """A value of a type, and where the next one begins."""
    listed = re.fullmatch(r"(.+)\[(\d*)\]", kind)
    if listed:
        kind, count = listed[1], listed[2]
        if count:
            count = int(count)
        else:
            (count,) = struct.unpack_from("<I", data, place)
            place += 4
        values = []
        for _ in range(count):
            value, place = _take(types, kind, data, place)
            values.append(value)
        return values, place
    if kind in NUMBERS:
        form = f"<{NUMBERS[kind]}"
        return struct.unpack_from(form, data, place)[0], place + struct.calcsize(form)
    if kind == "string":
        (size,) = struct.unpack_from("<I", data, place)
        return data[place + 4 : place + 4 + size].decode(), place + 4 + size
    if kind == "time":
        seconds, nanoseconds = struct.unpack_from("<II", data, place)
        return {"sec": seconds, "nsec": nanoseconds}, place + 8
    content = {}
    for field, name in types[kind]:
        content[name], place = _take(types, field, data, place)
    return content, place

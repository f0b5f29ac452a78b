"""An MCAP log, written by a thread of its own so that the control loop never waits for a disk."""

import json
import queue
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal

from poise.errors import MissingExtraError, PoiseError

Message = tuple[str, str, int, Any]
"""Topic, schema name, time [ns], and the JSON object (or a function that makes it, run later)."""

SCHEMAS: dict[str, dict[str, Any]] = {
    "poise.Signal": {
        "type": "object",
        "properties": {
            "time": {"type": "number", "description": "[s]"},
            "value": {"type": ["number", "null", "string", "array"], "items": {"type": "number"}},
        },
    },
    "poise.Joints": {
        "type": "object",
        "properties": {
            "time": {"type": "number", "description": "[s]"},
            "name": {"type": "array", "items": {"type": "string"}},
            "position": {"type": "array", "items": {"type": "number"}, "description": "[rad]"},
            "velocity": {"type": "array", "items": {"type": "number"}, "description": "[rad/s]"},
            "torque": {"type": "array", "items": {"type": "number"}, "description": "[N m]"},
        },
    },
    "foxglove.FrameTransforms": {
        "type": "object",
        "properties": {"transforms": {"type": "array", "items": {"type": "object"}}},
    },
    "foxglove.SceneUpdate": {
        "type": "object",
        "properties": {
            "deletions": {"type": "array", "items": {"type": "object"}},
            "entities": {"type": "array", "items": {"type": "object"}},
        },
    },
}
"""What the messages look like; Foxglove knows its own by their names."""

_CHUNK_BYTES = 256 * 1024
_STOP: Message = ("", "", 0, None)


class McapLog:
    """Writes JSON messages to an MCAP file from a thread.

    What was put in more than `flush_dt` ago is in the file, whatever happens to the process: every
    flush closes a chunk, and a reader needs no more than whole chunks.

    Args:
        path: the file, overwritten.
        metadata: texts that say what the log is of.
        flush_dt: wall-clock time between flushes [s].
        capacity: messages that may wait for the writer.
        on_full: "block" makes the caller wait, "drop" counts the message in `dropped`.

    Raises:
        MissingExtraError: the package mcap is not installed.
        PoiseError: the file cannot be made.
    """

    def __init__(
        self,
        path: Path,
        *,
        metadata: Mapping[str, str],
        flush_dt: float,
        capacity: int,
        on_full: Literal["block", "drop"],
    ) -> None:
        try:
            from mcap.writer import Writer
        except ModuleNotFoundError as error:
            raise MissingExtraError("mcap", "sim", "Writing a log") from error
        self.path = path
        self.dropped = 0
        self._block = on_full == "block"
        self._flush_dt = flush_dt
        self._queue: queue.Queue[Message] = queue.Queue(capacity)
        self._failure: OSError | None = None
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        try:
            self._stream = path.open("wb")
        except OSError as error:
            raise self._error(error) from error
        try:
            self._writer = Writer(self._stream, chunk_size=_CHUNK_BYTES)
            self._writer.start(profile="", library="poise")
            self._writer.add_metadata("poise", dict(metadata))
            self._writer.flush()
        except OSError as error:
            with suppress(OSError):
                self._stream.close()
            raise self._error(error) from error
        self._thread = threading.Thread(target=self._run, name="poise-log", daemon=True)
        self._thread.start()

    def put(self, message: Message) -> None:
        """Hand a message to the writer."""
        if self._block:
            self._queue.put(message)
            return
        try:
            self._queue.put_nowait(message)
        except queue.Full:
            self.dropped += 1

    def close(self) -> None:
        """Write all that waits, finish the file and close it.

        Raises:
            PoiseError: the log could not be written, because the disk is full for example.
        """
        if self._thread.is_alive():
            self._queue.put(_STOP)
            self._thread.join()
        try:
            self._stream.close()
        except OSError as error:
            self._failure = self._failure or error
        if self._failure is not None:
            raise self._error(self._failure) from self._failure

    def _error(self, cause: OSError) -> PoiseError:
        return PoiseError(f"the log {str(self.path)!r} cannot be written: {cause}")

    def _run(self) -> None:
        due = time.monotonic() + self._flush_dt
        while True:
            try:
                message = self._queue.get(timeout=max(0.0, due - time.monotonic()))
            except queue.Empty:
                message = None
            # After a failure the queue is still emptied, or a blocking caller would wait for ever.
            if self._failure is None:
                try:
                    self._handle(message)
                    if time.monotonic() >= due:
                        self._writer.flush()
                except OSError as error:
                    self._failure = error
            if message is _STOP:
                return
            if time.monotonic() >= due:
                due = time.monotonic() + self._flush_dt

    def _handle(self, message: Message | None) -> None:
        if message is None:
            return
        if message is _STOP:
            self._writer.finish()
            self._stream.flush()
            return
        topic, schema, stamp, content = message
        data = json.dumps(content() if callable(content) else content, allow_nan=False)
        self._writer.add_message(
            self._channel(topic, schema), log_time=stamp, data=data.encode(), publish_time=stamp
        )

    def _channel(self, topic: str, schema: str) -> int:
        if topic not in self._channels:
            if schema not in self._schemas:
                text = json.dumps({"title": schema, **SCHEMAS[schema]}).encode()
                self._schemas[schema] = self._writer.register_schema(schema, "jsonschema", text)
            self._channels[topic] = self._writer.register_channel(
                topic, "json", self._schemas[schema]
            )
        return self._channels[topic]

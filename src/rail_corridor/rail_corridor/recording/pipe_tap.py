"""A process of the run tells the recorder what its nodes publish: the near end of a pipe.

A pipe keeps order and loses nothing: when the recorder falls behind it fills, and the writer
waits. So a recording is complete by construction, and the run is no faster than its recorder.
"""

from __future__ import annotations

import os
import select
from collections.abc import Callable, Sequence
from typing import Final

from rail_msgs_py.message_definition import type_name
from rail_msgs_py.topics.qos_text import offered_profiles
from rail_msgs_py.topics.tick import CLOCK
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.waveform import STAMP_AT, Waveform

from .frames import (
    KEPT,
    MESSAGE,
    MOST_CHANNELS,
    REPEATED,
    STAMP_BYTES,
    ChannelInfo,
    channel_frame,
    head,
)
from .topic_selection import EVERY_TOPIC, TopicSelection

#: Handed over at least this often, in bytes and in messages.
_MOST_BYTES: Final = 256 * 1024
_MOST_PARTS: Final = 512
#: Shorter messages are not worth a look whether they repeat the one before.
_WORTH_A_LOOK: Final = 1024
#: Why a tap tells nothing any longer that has been closed in good order.
CLOSED: Final = "closed"


class PipeTap:
    """Tap of one process.

    Parameters
    ----------
    fd : int
        Writing end of a pipe; it is made non-blocking, and closed by `close`.
    at_once : bool
        Whether each message is handed over before it is published, as it must be where the
        process may be killed; otherwise a tick at a time, which costs a third.
    besides : frozenset of str
        Topics of which the publishers here do not tell, as they are heard otherwise.
    selection : TopicSelection
        Of the others nothing is told.
    stall_s : float, optional
        Wall time after which a recorder that takes nothing is given up; never if not given.
    """

    def __init__(
        self,
        fd: int,
        *,
        at_once: bool = False,
        besides: frozenset[str] = frozenset(),
        selection: TopicSelection = EVERY_TOPIC,
        stall_s: float | None = None,
    ) -> None:
        os.set_blocking(fd, False)
        self._fd = fd
        self._besides, self._selection = besides, selection
        self._stall_s = stall_s
        self._most = 0 if at_once else _MOST_BYTES
        self._parts: list[bytes] = []
        self._bytes = 0
        self._channels = 0
        #: Why nothing is told any longer, None while all is well.
        self.broken: str | None = None

    def __call__(self, topic: Topic, name: str) -> Callable[[bytes], None] | None:
        """Sink of a publisher; None for one that does not tell."""
        return None if name in self._besides else self.select(topic, name)

    def select(self, topic: Topic, name: str) -> Callable[[bytes], None] | None:
        """Function that tells the messages of a topic; None for one that is not recorded."""
        return self.open(topic, name) if self._selection.takes(topic, name) else None

    def open(self, topic: Topic, name: str) -> Callable[[bytes], None]:
        """Function that tells the messages of a topic."""
        self._channels = number = self._channels + 1
        if number > MOST_CHANNELS:
            raise ValueError(f"a process has no more than {MOST_CHANNELS} publishers")
        info = ChannelInfo(name, type_name(topic.type), offered_profiles(topic.qos))
        self.send(channel_frame(number, info))
        put = self._put
        if topic.view is Waveform:
            return _Repetitions(number, put).tell
        closes_tick = topic is CLOCK
        return lambda raw: put(MESSAGE, number, raw, closes_tick)

    def _put(self, kind: int, channel: int, body: bytes, closes_tick: bool = False) -> None:
        parts = self._parts
        parts.append(head(kind, channel, len(body)))
        parts.append(body)
        self._bytes += len(body)
        if self._bytes > self._most or closes_tick or len(parts) >= _MOST_PARTS:
            self.flush()

    def send(self, frame: bytes) -> None:
        """Tell a frame, at once."""
        self._parts.append(frame)
        self.flush()

    def flush(self) -> None:
        """Hand over what waits; returns when the pipe has taken it."""
        parts = self._parts[:]
        self._parts.clear()
        self._bytes = 0
        if self.broken is not None:
            return
        try:
            _write(self._fd, parts, self._stall_s)
        except BrokenPipeError:
            self.broken = "the recorder has ended"
        except OSError as error:
            self.broken = error.strerror or str(error)

    def close(self) -> None:
        """Hand over the rest, and close the pipe."""
        if self._fd >= 0:
            self.flush()
            os.close(self._fd)
            self._fd = -1
            self.broken = self.broken or CLOSED


class _Repetitions:
    """Tells the blocks of one transmitter; of one that is sent again, its stamp alone."""

    def __init__(self, channel: int, put: Callable[[int, int, bytes], None]) -> None:
        self._channel, self._put = channel, put
        self._length = -1
        self._before = self._after = b""
        self._kept = False

    def tell(self, raw: bytes) -> None:
        """Tell one block."""
        if len(raw) < _WORTH_A_LOOK:
            self._put(MESSAGE, self._channel, raw)
        elif (
            len(raw) == self._length and raw.endswith(self._after) and raw.startswith(self._before)
        ):
            if self._kept:
                self._put(REPEATED, self._channel, raw[STAMP_AT : STAMP_AT + STAMP_BYTES])
            else:
                self._kept = True
                self._put(KEPT, self._channel, raw)
        else:
            self._kept = False
            self._length = len(raw)
            self._before, self._after = raw[:STAMP_AT], raw[STAMP_AT + STAMP_BYTES :]
            self._put(MESSAGE, self._channel, raw)


def _write(fd: int, parts: Sequence[bytes], stall_s: float | None) -> None:
    """Write all of the parts, waiting for room where there is none."""
    waiting: list[bytes | memoryview] = list(parts)
    first = 0
    while first < len(waiting):
        try:
            written = os.writev(fd, waiting[first:])
        except BlockingIOError:
            room = select.poll()
            room.register(fd, select.POLLOUT)
            if not room.poll(None if stall_s is None else 1000.0 * stall_s):
                raise TimeoutError(f"the recorder took nothing for {stall_s:g} s") from None
            continue
        while first < len(waiting) and written >= len(waiting[first]):
            written -= len(waiting[first])
            first += 1
        if written:
            waiting[first] = memoryview(waiting[first])[written:]

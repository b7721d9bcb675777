"""What a tap tells arrives: all of it, in order, as it was, however slow the other end is."""

from __future__ import annotations

import fcntl
import os
import threading
from collections.abc import Iterator

import numpy as np
import pytest

from rail_corridor.recording.frames import (
    CHANNEL,
    KEPT,
    MESSAGE,
    REPEATED,
    FrameReader,
    channel_of,
    repeated,
)
from rail_corridor.recording.mcap_recorder import CHUNK_BYTES
from rail_corridor.recording.pipe_tap import PipeTap
from rail_msgs_py.stamps import clock_to_cdr
from rail_msgs_py.topics.ranging import VRS_RX, WRS_TX
from rail_msgs_py.topics.tick import CLOCK, FAILED, READY
from rail_msgs_py.topics.world import STATE
from rail_msgs_py.waveform import RepeatedBlock, Waveform, silence

TX = "/wayside/wrs1/zone1/tx"


class Far:
    """The far end of a pipe."""

    def __init__(self, fd: int) -> None:
        self.reader = FrameReader(fd)
        self.kinds: list[int] = []
        self.messages: dict[str, list[bytes]] = {}
        self._names: dict[int, str] = {}
        self._kept: dict[int, bytes] = {}

    def read(self) -> None:
        """Take what is there, waiting for something if there is nothing."""
        for kind, number, body in self.reader.read():
            self.kinds.append(kind)
            if kind == CHANNEL:
                self._names[number] = channel_of(body).topic
                self.messages[self._names[number]] = []
                continue
            raw = repeated(self._kept[number], body) if kind == REPEATED else bytes(body)
            if kind == KEPT:
                self._kept[number] = raw
            self.messages[self._names[number]].append(raw)

    def read_all(self) -> None:
        """Read until the pipe is closed."""
        try:
            while True:
                self.read()
        except EOFError:
            pass


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    """Return the ends of a pipe, reading and writing; the writer is the tap's to close."""
    ends = os.pipe()
    fcntl.fcntl(ends[1], fcntl.F_SETPIPE_SZ, 1024 * 1024)
    yield ends
    os.close(ends[0])


def block(stamp_ns: int, value: complex, samples: int = 960) -> bytes:
    return Waveform(stamp_ns, 4e6, 2.4e9, 1, np.full((1, samples), value)).to_cdr()


def test_everything_arrives_as_it_was(pipe: tuple[int, int]) -> None:
    tap, far = PipeTap(pipe[1]), Far(pipe[0])
    clock = tap(CLOCK, "/clock")
    send = tap(WRS_TX, TX)
    assert clock
    assert send
    ring = RepeatedBlock(Waveform(0, 4e6, 2.4e9, 1, np.full((1, 960), 0.5 + 0.1j)))
    quiet = RepeatedBlock(silence(0, 4e6, 2.4e9, 1))
    other = RepeatedBlock(Waveform(0, 4e6, 2.4e9, 1, np.full((1, 960), 0.25j)))
    again = [ring.at(t) for t in range(5)] + [quiet.at(5), ring.at(6), ring.at(7)]
    again += [other.at(8), other.at(9)]
    sent = [view.to_cdr() for view in again]
    sent += [block(10, 1.0, 480), block(11, 2.0), block(12, 2.0, 961)]
    clocks = [clock_to_cdr(t) for t in range(len(sent))]
    for stamp, raw in zip(clocks, sent, strict=True):
        clock(stamp)
        send(raw)
    tap.close()
    far.read_all()
    assert far.messages == {"/clock": clocks, TX: sent}


def test_a_block_that_repeats_travels_as_its_stamp(pipe: tuple[int, int]) -> None:
    tap, far = PipeTap(pipe[1], at_once=True), Far(pipe[0])
    send = tap(WRS_TX, TX)
    assert send
    ring = RepeatedBlock(Waveform(0, 4e6, 2.4e9, 1, np.full((1, 960), 0.5)))
    for tick in range(6):
        send(ring.at(tick).to_cdr())
    send(block(6, 3.0))
    tap.close()
    far.read_all()
    assert far.kinds == [CHANNEL, MESSAGE, KEPT, *[REPEATED] * 4, MESSAGE]


def test_a_reader_that_falls_behind_is_waited_for(pipe: tuple[int, int]) -> None:
    # More than a pipe holds, and a chunk: the writer must stop until somebody reads.
    tap, far = PipeTap(pipe[1]), Far(pipe[0])
    send = tap(VRS_RX, "/train_a/vrs/channel_1/rx")
    assert send
    sent = [block(tick, complex(tick)) for tick in range(3 * CHUNK_BYTES // 15_000)]
    begun, done = threading.Event(), threading.Event()

    def write() -> None:
        begun.set()
        for raw in sent:
            send(raw)
        tap.close()
        done.set()

    writer = threading.Thread(target=write)
    writer.start()
    begun.wait()
    assert not done.is_set()
    far.read_all()
    writer.join()
    assert far.messages["/train_a/vrs/channel_1/rx"] == sent
    assert tap.broken == "closed"


def test_a_tick_is_handed_over_with_the_next_clock_and_at_once_where_asked() -> None:
    for at_once, early in ((False, 0), (True, 1)):
        read_end, write_end = os.pipe()
        tap, far = PipeTap(write_end, at_once=at_once), Far(read_end)
        clock, state = tap(CLOCK, "/clock"), tap(STATE, "/world/state")
        assert clock
        assert state
        far.read()
        state(b"truth")
        os.set_blocking(read_end, False)
        try:
            far.read()
        except BlockingIOError:
            assert not early
        assert len(far.messages["/world/state"]) == early
        clock(clock_to_cdr(0))
        far.read()
        assert len(far.messages["/world/state"]) == len(far.messages["/clock"]) == 1
        tap.close()
        os.close(read_end)


def test_without_a_reader_nothing_is_told_and_nobody_stopped() -> None:
    read_end, write_end = os.pipe()
    tap = PipeTap(write_end, at_once=True)
    state = tap(STATE, "/world/state")
    assert state
    os.close(read_end)
    assert tap.broken is None
    for _ in range(3):
        state(b"truth")
    assert tap.broken == "the recorder has ended"
    tap.close()


def test_a_reader_that_takes_nothing_is_given_up_where_asked(pipe: tuple[int, int]) -> None:
    tap = PipeTap(pipe[1], at_once=True, stall_s=0.01)
    state = tap(STATE, "/world/state")
    assert state
    for _ in range(3):
        state(bytes(600_000))
    assert tap.broken == "the recorder took nothing for 0.01 s"
    tap.close()


def test_topics_that_are_heard_otherwise_are_not_told(pipe: tuple[int, int]) -> None:
    tap = PipeTap(pipe[1], besides=frozenset({"/ready"}))
    assert tap(READY, "/ready") is None
    assert tap(FAILED, "/failed") is not None
    tap.open(READY, "/ready")(b"heard")
    tap.close()
    far = Far(pipe[0])
    far.read_all()
    assert far.messages == {"/failed": [], "/ready": [b"heard"]}

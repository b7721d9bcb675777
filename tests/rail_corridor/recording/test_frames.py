"""Frames in a pipe: cut anywhere, they come out as they went in."""

from __future__ import annotations

import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rail_corridor.recording.frames import (
    ATTACHMENT,
    CHANNEL,
    MESSAGE,
    METADATA,
    Attachment,
    ChannelInfo,
    FrameReader,
    attachment_frame,
    attachment_of,
    channel_frame,
    channel_of,
    head,
    metadata_frame,
    metadata_of,
)


def read_in_pieces(raw: bytes, sizes: list[int]) -> list[tuple[int, int, bytes]]:
    """Return the frames of bytes that are written to a pipe in pieces of these sizes."""
    read_end, write_end = os.pipe()
    reader, found, at = FrameReader(read_end), [], 0
    try:
        for size in [*sizes, len(raw)]:
            piece = raw[at : at + min(size, 60_000)]
            while piece:
                at += os.write(write_end, piece)
                found += [(kind, number, bytes(body)) for kind, number, body in reader.read()]
                piece = raw[at : at + 60_000] if size == len(raw) else b""
        os.close(write_end)
        with pytest.raises(EOFError):
            list(reader.read())
    finally:
        os.close(read_end)
    return found


FRAMES = st.lists(
    st.tuples(st.integers(1, 6), st.integers(0, 65_535), st.binary(max_size=200)), max_size=8
)


@given(FRAMES, st.lists(st.integers(1, 100), max_size=20))
def test_frames_cut_anywhere_come_out_whole(
    frames: list[tuple[int, int, bytes]], sizes: list[int]
) -> None:
    raw = b"".join(head(kind, number, len(body)) + body for kind, number, body in frames)
    assert read_in_pieces(raw, sizes) == frames


def test_one_larger_than_any_buffer() -> None:
    body = os.urandom(3_000_000)
    raw = head(MESSAGE, 1, 3) + b"abc" + head(MESSAGE, 2, len(body)) + body + head(MESSAGE, 3, 0)
    assert read_in_pieces(raw, []) == [(MESSAGE, 1, b"abc"), (MESSAGE, 2, body), (MESSAGE, 3, b"")]


def test_what_is_amid_a_frame_at_the_end_is_left_out() -> None:
    raw = head(MESSAGE, 1, 3) + b"abc" + head(MESSAGE, 1, 5) + b"de"
    assert read_in_pieces(raw, []) == [(MESSAGE, 1, b"abc")]


def test_bodies_say_what_was_said() -> None:
    info = ChannelInfo("/train_ä/vrs", "std_msgs/msg/Header", "- history: keep_last\n")
    attachment = Attachment("scenario.yaml", "application/yaml", bytes(range(256)))
    values = {"ticks": "480", "complete": "true"}
    raw = channel_frame(7, info) + attachment_frame(attachment) + metadata_frame("end", values)
    (a, number, one), (b, _, two), (c, _, three) = read_in_pieces(raw, [10, 20])
    assert (a, b, c) == (CHANNEL, ATTACHMENT, METADATA)
    assert (number, channel_of(memoryview(one))) == (7, info)
    assert attachment_of(memoryview(two)) == attachment
    assert metadata_of(memoryview(three)) == ("end", values)

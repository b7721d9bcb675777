"""Waveforms: message, view and serialised bytes say the same; foreign layouts are refused."""

from __future__ import annotations

import array
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

from rail_msgs_py.waveform import RepeatedBlock, Waveform, silence

# NaN, infinities, signed zeros and subnormal numbers included.
ANY_FLOAT = st.floats(width=64)


@st.composite
def waveforms(draw: st.DrawFn) -> Waveform:
    """Any block: no antenna, no sample, and every bit pattern of a number included."""
    shape = (draw(st.integers(0, 3)), draw(st.integers(0, 9)))
    parts = draw(hnp.arrays(np.float64, (*shape, 2), elements=ANY_FLOAT))
    return Waveform(
        draw(st.integers(0, 10**15)),
        draw(ANY_FLOAT),
        draw(ANY_FLOAT),
        draw(st.integers(0, 99)),
        parts.view(np.complex128)[..., 0],
    )


def assert_same(one: Waveform, other: Waveform) -> None:
    """Assert that two views are the same to the bit; every NaN counts as one."""
    assert one.stamp_ns == other.stamp_ns
    assert one.channel == other.channel
    assert one.samples.shape == other.samples.shape
    for a, b in ((one.sample_rate_hz, other.sample_rate_hz), (one.carrier_hz, other.carrier_hz)):
        assert a == b or (math.isnan(a) and math.isnan(b))
    a, b = (np.ascontiguousarray(w.samples).view(np.float64) for w in (one, other))
    assert np.array_equal(a, b, equal_nan=True)
    assert np.array_equal(np.signbit(a[~np.isnan(a)]), np.signbit(b[~np.isnan(b)]))


def message_of(labels: tuple[str, ...], sizes: tuple[int, ...], values: int, offset: int) -> Any:
    """Return a message with this layout and zeros for data."""
    message = Float64MultiArray()
    message.layout.dim = [
        MultiArrayDimension(label=label, size=size, stride=1)
        for label, size in zip(labels, sizes, strict=True)
    ]
    message.layout.data_offset = offset
    message.data = array.array("d", bytes(8 * values))
    return message


@given(waveforms())
def test_message_and_bytes_carry_the_same_block(block: Waveform) -> None:
    assert_same(Waveform.from_msg(block.to_msg()), block)
    assert_same(Waveform.from_cdr(block.to_cdr()), block)
    # what another node would make of the bytes, and the bytes another node would make
    assert_same(Waveform.from_msg(deserialize_message(block.to_cdr(), Float64MultiArray)), block)
    assert_same(Waveform.from_cdr(bytes(serialize_message(block.to_msg()))), block)


@given(waveforms())
def test_the_bytes_are_those_of_the_middleware(block: Waveform) -> None:
    ours = deserialize_message(block.to_cdr(), Float64MultiArray)
    theirs = block.to_msg()
    assert ours.layout == theirs.layout
    assert ours.data.tobytes() == theirs.data.tobytes()


def test_the_layout_is_the_documented_one() -> None:
    samples = np.array([[1 + 2j, 3 + 4j], [5 + 6j, 7 + 8j]])
    message = Waveform(1_500_000_000, 4e6, 2.4e9, 3, samples).to_msg()
    assert [dim.label for dim in message.layout.dim] == ["antenna", "sample", "iq"]
    assert [dim.size for dim in message.layout.dim] == [2, 2, 2]
    assert [dim.stride for dim in message.layout.dim] == [8, 4, 2]
    assert message.layout.data_offset == 4
    assert list(message.data) == [1.5, 4e6, 2.4e9, 3, 1, 2, 3, 4, 5, 6, 7, 8]


def test_samples_that_do_not_lie_in_memory_one_after_the_other() -> None:
    grid = np.arange(24.0).reshape(4, 6) * (1 - 2j)
    block = Waveform(0, 1.0, 0.0, 0, grid[::2, ::3])
    for view in (Waveform.from_cdr(block.to_cdr()), Waveform.from_msg(block.to_msg())):
        assert_same(view, block)


def test_the_view_of_bytes_cannot_write_into_the_message() -> None:
    view = Waveform.from_cdr(Waveform(0, 1.0, 0.0, 0, np.ones((1, 3), np.complex128)).to_cdr())
    assert not view.samples.flags.writeable


@pytest.mark.parametrize(
    ("labels", "sizes", "values", "offset"),
    [
        ((), (), 0, 0),
        (("antenna", "sample"), (1, 2), 8, 4),
        (("antenna", "sample", "re"), (1, 2, 2), 8, 4),
        (("antenna", "sampel", "iq"), (1, 2, 2), 8, 4),
        (("antenna", "sample", "iq"), (1, 2, 2), 8, 0),
        (("antenna", "sample", "iq"), (1, 2, 3), 8, 4),
        (("antenna", "sample", "iq"), (1, 2, 2), 7, 4),
        (("antenna", "sample", "iq"), (1, 2, 2), 9, 4),
        (("antenna", "sample", "iq"), (0, 0, 2), 3, 4),
        (("antenna", "sample", "iq"), (0, 0, 2), 0, 4),
        (("antenna", "sample", "iq", "more"), (1, 2, 2, 1), 8, 4),
    ],
)
def test_foreign_layouts_are_refused(
    labels: tuple[str, ...], sizes: tuple[int, ...], values: int, offset: int
) -> None:
    message = message_of(labels, sizes, values, offset)
    with pytest.raises(ValueError, match="not a waveform"):
        Waveform.from_msg(message)
    with pytest.raises(ValueError, match="not a waveform"):
        Waveform.from_cdr(bytes(serialize_message(message)))


@pytest.mark.parametrize("place", [0, 3])
@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan])
def test_a_stamp_or_channel_that_is_no_number_is_refused(place: int, value: float) -> None:
    message = silence(0, 4e6, 2.4e9, 1).to_msg()
    message.data[place] = value
    with pytest.raises(ValueError):
        Waveform.from_msg(message)
    with pytest.raises(ValueError):
        Waveform.from_cdr(bytes(serialize_message(message)))


def test_cut_short_bytes_are_refused() -> None:
    raw = Waveform(0, 4e6, 2.4e9, 1, np.ones((1, 8), np.complex128)).to_cdr()
    with pytest.raises(ValueError):
        Waveform.from_cdr(raw[:-8])


@given(waveforms(), st.integers(0, 10**15))
def test_a_repeated_block_changes_nothing_but_its_stamp(block: Waveform, stamp_ns: int) -> None:
    again = Waveform(stamp_ns, block.sample_rate_hz, block.carrier_hz, block.channel, block.samples)
    assert_same(Waveform.from_cdr(RepeatedBlock(block).at(stamp_ns).to_cdr()), again)


def test_silence_has_a_channel_but_no_sample_and_no_power() -> None:
    block = Waveform.from_cdr(silence(7, 4e6, 2.4e9, 5).to_cdr())
    assert (block.stamp_ns, block.channel, block.silent) == (7, 5, True)
    assert block.power_dbm == -math.inf


def test_power_is_the_mean_square_in_milliwatt() -> None:
    samples = np.array([[3 + 4j, 0, 3 - 4j, 0]])  # mean 12.5 mW
    block = Waveform(0, 4e6, 2.4e9, 1, samples)
    assert block.power_dbm == pytest.approx(10 * math.log10(12.5))
    assert not block.silent
    assert Waveform(0, 4e6, 2.4e9, 1, samples * 0).power_dbm == -math.inf

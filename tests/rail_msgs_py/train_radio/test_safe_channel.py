"""The safe channel: only what the right peer sealed now, for me, once and in order."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rail_msgs_py.train_radio.safe_channel import SafeChannel
from rail_msgs_py.train_radio.safe_frame import (
    FRAME_BYTES,
    GREETING_BIT,
    DirectionKeys,
    FrameKind,
    Header,
    SafetyCode,
    payload_of,
    read_header,
    write_header,
)
from rail_msgs_py.train_radio.safe_result import (
    Accepted,
    Greeted,
    Opened,
    Rejected,
    RejectionReason,
)

SECRET = b"a secret for the tests"
CONTROLLER, TRAIN, OTHER_TRAIN = 1, 101, 102
REPORT, AUTHORITY = FrameKind.LOCATION_REPORT, FrameKind.MOVEMENT_AUTHORITY
SECOND = 1_000_000_000


def end(own: int, peer: int, seed: int, drift: float = 0.0) -> SafeChannel:
    """An end; its clocks do not drift unless said otherwise."""
    kind = REPORT if own == CONTROLLER else AUTHORITY
    draw = np.random.default_rng(seed).bytes
    return SafeChannel(SECRET, own, peer, [kind], draw, max_age_s=1.0, clock_drift=drift)


def greet(one: SafeChannel, other: SafeChannel, time_ns: int) -> None:
    """Bring both ends into a session: a greeting, its answer, and data that proves the rest."""
    assert other.open(one.seal(kind_from(one), b"", time_ns), time_ns) == Greeted(False)
    assert one.open(other.seal(kind_from(other), b"", time_ns), time_ns) == Greeted(True)
    assert isinstance(other.open(one.seal(kind_from(one), b"", time_ns), time_ns), Accepted)
    assert one.established and other.established


def kind_from(sender: SafeChannel) -> FrameKind:
    return AUTHORITY if sender.own == CONTROLLER else REPORT


def pair() -> tuple[SafeChannel, SafeChannel]:
    """Controller and train in a session made at time 0."""
    controller = end(CONTROLLER, TRAIN, 1)
    train = end(TRAIN, CONTROLLER, 2)
    greet(train, controller, 0)
    return controller, train


def reason(opened: Opened) -> RejectionReason:
    assert isinstance(opened, Rejected), opened
    return opened.reason


@pytest.mark.parametrize(
    ("message", "mac"),
    [
        ("", "bb1d6929e95937287fa37d129b756746"),
        ("6bc1bee22e409f96e93d7e117393172a", "070a16b46b4d4144f79bdd9dd04a287c"),
        (
            "6bc1bee22e409f96e93d7e117393172aae2d8a571e03ac9c9eb76fac45af8e5130c81c46a35ce411",
            "dfa66747de9ae63030ca32611497c827",
        ),
    ],
)
def test_the_safety_code_is_that_of_rfc_4493(message: str, mac: str) -> None:
    code = SafetyCode(bytes.fromhex("2b7e151628aed2a6abf7158809cf4f3c"))
    assert code.of(bytes.fromhex(message)).hex() == mac[:16]


def test_a_frame_is_one_burst_and_stands_as_documented() -> None:
    _, train = pair()
    frame = train.seal(REPORT, b"payload", 4 * SECOND + 1999)
    assert len(frame) == FRAME_BYTES == 64
    assert frame[0] == 0x21 and frame[1] == 7
    assert frame[2:10].hex() == "0065000100000002"
    assert int.from_bytes(frame[10:16], "big") == 4_000_001
    assert frame[24:56] == b"payload".ljust(32, b"\0")


def test_data_arrives_with_its_age_and_what_was_lost() -> None:
    controller, train = pair()
    assert controller.silence_s(0) == pytest.approx(0.0, abs=2e-6)
    assert math.isinf(train.silence_s(0))
    for _ in range(3):
        train.seal(REPORT, b"lost", SECOND)
    opened = controller.open(train.seal(REPORT, b"here", 2 * SECOND), 2 * SECOND + 250_000_000)
    # Nothing was taken from the controller but its first greeting.
    age_s, doubt_s = pytest.approx(0.25, abs=2e-6), pytest.approx(0.0, abs=2e-6)
    assert opened == Accepted(REPORT, b"here", age_s, doubt_s, 5, 3, GREETING_BIT | 1)
    assert controller.silence_s(5 * SECOND) == pytest.approx(3.0, abs=2e-6)
    back = train.open(controller.seal(AUTHORITY, b"go", 3 * SECOND), 3 * SECOND)
    assert isinstance(back, Accepted)
    assert (back.kind, back.payload, back.sequence, back.feedback) == (AUTHORITY, b"go", 1, 5)


def test_every_single_bit_matters() -> None:
    controller, train = pair()
    frame = train.seal(REPORT, b"position", SECOND)
    for bit in range(8 * FRAME_BYTES):
        wrong = bytearray(frame)
        wrong[bit >> 3] ^= 1 << (bit & 7)
        assert isinstance(controller.open(bytes(wrong), SECOND), Rejected)
    assert isinstance(controller.open(frame, SECOND), Accepted)


@given(st.binary(min_size=1, max_size=FRAME_BYTES), st.integers(0, FRAME_BYTES - 1))
def test_any_altered_frame_is_rejected(burst: bytes, start: int) -> None:
    controller, train = pair()
    frame = train.seal(REPORT, b"position", SECOND)
    wrong = (frame[:start] + burst + frame[start + len(burst) :])[:FRAME_BYTES]
    if wrong != frame:
        assert isinstance(controller.open(wrong, SECOND), Rejected)


@given(
    st.binary(max_size=100) | st.binary(min_size=FRAME_BYTES, max_size=FRAME_BYTES),
    st.integers(0, 2**63),
)
def test_any_bytes_are_rejected_and_nothing_is_raised(raw: bytes, time_ns: int) -> None:
    controller, train = pair()
    for target in (controller, end(CONTROLLER, TRAIN, 3)):
        assert isinstance(target.open(raw, time_ns), Rejected)
    assert isinstance(controller.open(train.seal(REPORT, b"", SECOND), SECOND), Accepted)


@given(
    st.tuples(
        st.integers(0, 15),
        st.integers(0, 15),
        st.integers(0, 255),
        st.sampled_from([CONTROLLER, TRAIN]),
        st.sampled_from([CONTROLLER, TRAIN]),
        st.integers(0, 2**32 - 1),
        st.integers(0, 2**48 - 1).map(lambda ticks: 1000 * ticks),
        st.integers(0, 2**32 - 1),
        st.integers(0, 2**32 - 1),
    ),
    st.binary(min_size=32, max_size=32),
    st.integers(0, 2**60),
)
def test_even_who_has_the_keys_of_greetings_makes_nothing_raise(
    values: tuple[int, ...], payload: bytes, time_ns: int
) -> None:
    header = Header(*values)
    assert read_header(write_header(header)) == header
    keys = DirectionKeys(SECRET, TRAIN, CONTROLLER)
    opened = pair()[0].open(keys.greeting.seal(header, payload), time_ns)
    assert not isinstance(opened, Accepted)


def test_repetition_and_order() -> None:
    controller, train = pair()
    frames = [train.seal(REPORT, bytes([n]), SECOND) for n in range(3)]
    assert isinstance(controller.open(frames[1], SECOND), Accepted)
    assert reason(controller.open(frames[1], SECOND)) is RejectionReason.REPEATED
    assert reason(controller.open(frames[0], SECOND)) is RejectionReason.OUT_OF_ORDER
    assert isinstance(controller.open(frames[2], SECOND), Accepted)


def test_wrong_train_wrong_way_wrong_kind_and_wrong_key() -> None:
    controller, train = pair()
    other_end = end(CONTROLLER, OTHER_TRAIN, 4)
    other_train = end(OTHER_TRAIN, CONTROLLER, 5)
    greet(other_train, other_end, 0)
    authority = controller.seal(AUTHORITY, b"go", SECOND)
    assert reason(other_train.open(authority, SECOND)) is RejectionReason.WRONG_ADDRESS
    assert reason(controller.open(authority, SECOND)) is RejectionReason.UNEXPECTED_KIND
    readdressed = (
        write_header(read_header(authority)._replace(destination=OTHER_TRAIN)) + authority[24:]
    )
    assert reason(other_train.open(readdressed, SECOND)) is RejectionReason.UNKNOWN_SESSION
    report = train.seal(REPORT, b"", SECOND)
    forged = SafetyCode(bytes(16)).seal(read_header(report), payload_of(report))
    assert reason(controller.open(forged, SECOND)) is RejectionReason.SAFETY_CODE
    greeting = end(TRAIN, CONTROLLER, 6).seal(REPORT, b"", SECOND)
    assert reason(end(TRAIN, CONTROLLER, 7).open(greeting, SECOND)) is RejectionReason.WRONG_ADDRESS


def test_what_is_thrown_back_at_its_sender_has_another_key() -> None:
    authentication_key, nonces = bytes(range(32)), (bytes(16), bytes([1]) * 16)
    there, back, other = (
        DirectionKeys(authentication_key, *ends) for ends in ((1, 2), (2, 1), (1, 3))
    )
    for keys in (back, other):
        assert keys.greeting.of(b"hello") != there.greeting.of(b"hello")
        assert keys.session(*nonces).code.of(b"hello") != there.session(*nonces).code.of(b"hello")
    train = end(TRAIN, CONTROLLER, 8)
    greeting = train.seal(REPORT, b"", SECOND)
    header = read_header(greeting)._replace(source=CONTROLLER, destination=TRAIN)
    mirrored = write_header(header) + greeting[24:]
    assert reason(train.open(mirrored, SECOND)) is RejectionReason.SAFETY_CODE


def test_a_receiver_that_restarted_takes_nothing_recorded_before() -> None:
    controller, train = pair()
    # Still fresh, never received: the age and the numbers alone would let them pass.
    recorded = [train.seal(REPORT, bytes([n]), SECOND) for n in range(5)]
    controller = end(CONTROLLER, TRAIN, 8)
    for frame in recorded:
        assert reason(controller.open(frame, SECOND)) is RejectionReason.UNKNOWN_SESSION
    greet(controller, train, SECOND)
    for frame in recorded:
        assert reason(controller.open(frame, SECOND)) is RejectionReason.UNKNOWN_SESSION


def test_frames_of_a_sender_from_before_its_restart_are_of_no_use() -> None:
    controller, train = pair()
    recorded = [train.seal(REPORT, bytes([n]), SECOND) for n in range(5)]
    controller.seal(AUTHORITY, b"", SECOND)  # its last frame was a greeting
    train = end(TRAIN, CONTROLLER, 9)
    greet(train, controller, SECOND + 1000)
    for frame in recorded:
        assert reason(controller.open(frame, SECOND + 1000)) is RejectionReason.UNKNOWN_SESSION


def test_recorded_greetings_neither_make_nor_cut_a_session() -> None:
    controller = end(CONTROLLER, TRAIN, 1)
    train = end(TRAIN, CONTROLLER, 2)
    first = train.seal(REPORT, b"", 0)
    assert controller.open(first, 0) == Greeted(False)
    answer = controller.seal(AUTHORITY, b"", 0)
    assert train.open(answer, 0) == Greeted(True)
    assert isinstance(controller.open(train.seal(REPORT, b"", 0), 0), Accepted)
    assert reason(controller.open(first, 0)) is RejectionReason.REPEATED
    assert reason(train.open(answer, 0)) is RejectionReason.REPEATED
    # A restarted end has forgotten them, and still they prove nothing to it.
    controller = end(CONTROLLER, TRAIN, 3)
    assert controller.open(first, 0) == Greeted(False)
    assert not controller.established
    # Its answer to a recorded greeting makes the train offer itself anew, beside its session.
    assert train.open(controller.seal(AUTHORITY, b"", 1000), 1000) == Greeted(False)
    assert train.established


def test_answers_leave_every_other_frame_to_data() -> None:
    controller, train = pair()
    controller.seal(AUTHORITY, b"", 0)  # its last frame was a greeting
    kinds = []
    for n in range(1, 7):
        time_ns = n * SECOND // 2
        greeting = end(TRAIN, CONTROLLER, 20 + n).seal(REPORT, b"", time_ns)
        assert controller.open(greeting, time_ns) == Greeted(False)
        kinds.append(read_header(controller.seal(AUTHORITY, b"", time_ns)).kind)
    assert kinds == [FrameKind.GREETING, AUTHORITY] * 3
    assert train.established


def test_a_session_is_given_up_after_silence() -> None:
    controller, _ = pair()
    assert read_header(controller.seal(AUTHORITY, b"", 5 * SECOND)).kind == AUTHORITY
    assert read_header(controller.seal(AUTHORITY, b"", 5 * SECOND + 1)).kind == FrameKind.GREETING
    assert not controller.established


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1))
def test_after_any_storm_the_link_comes_back(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ends = {TRAIN: end(TRAIN, CONTROLLER, seed), CONTROLLER: end(CONTROLLER, TRAIN, seed + 1)}
    flight: list[tuple[int, int, bytes]] = []
    time_ns = 0
    for _ in range(120):
        time_ns += 100_000_000
        for own, peer in ((TRAIN, CONTROLLER), (CONTROLLER, TRAIN)):
            if rng.random() < 0.1:
                ends[own] = end(own, peer, int(rng.integers(2**40)))
            frame = ends[own].seal(kind_from(ends[own]), b"", time_ns)
            for _ in range(rng.integers(3)):
                flight.append((time_ns + int(rng.integers(2 * SECOND)), peer, frame))
        flight.sort(key=lambda item: item[0])
        while flight and flight[0][0] <= time_ns:
            _, to, frame = flight.pop(0)
            ends[to].open(frame, time_ns)
    # What is still on its way keeps coming while every new frame arrives at once.
    heard = dict.fromkeys(ends, 0)
    for _ in range(80):
        time_ns += 100_000_000
        for own, peer in ((TRAIN, CONTROLLER), (CONTROLLER, TRAIN)):
            frame = ends[own].seal(kind_from(ends[own]), b"", time_ns)
            heard[peer] = (
                heard[peer] + 1 if isinstance(ends[peer].open(frame, time_ns), Accepted) else 0
            )
        while flight and flight[0][0] <= time_ns:
            _, to, frame = flight.pop(0)
            ends[to].open(frame, time_ns)
    assert min(heard.values()) >= 10


def test_bad_arguments_are_quoted() -> None:
    draw = np.random.default_rng(0).bytes
    with pytest.raises(ValueError, match="must differ, got 5"):
        SafeChannel(SECRET, 5, 5, [REPORT], draw)
    with pytest.raises(ValueError, match=r"own .* got 65536"):
        SafeChannel(SECRET, 65536, 5, [REPORT], draw)
    with pytest.raises(ValueError, match="16 bytes or more, got 3"):
        SafeChannel(b"abc", 1, 5, [REPORT], draw)
    with pytest.raises(ValueError, match=r"max_age_s .* got nan"):
        SafeChannel(SECRET, 1, 5, [REPORT], draw, max_age_s=math.nan)
    with pytest.raises(ValueError, match=r"least_delay_s .* got 2\.0"):
        SafeChannel(SECRET, 1, 5, [REPORT], draw, least_delay_s=2.0)
    with pytest.raises(ValueError, match=r"clock_drift .* got -1"):
        SafeChannel(SECRET, 1, 5, [REPORT], draw, clock_drift=-1)
    with pytest.raises(ValueError, match=r"session_timeout_s .* got 0\.5"):
        SafeChannel(SECRET, 1, 5, [REPORT], draw, session_timeout_s=0.5)
    channel = SafeChannel(SECRET, 1, 5, [REPORT], draw)
    with pytest.raises(ValueError, match="got GREETING"):
        channel.seal(FrameKind.GREETING, b"", 0)
    with pytest.raises(ValueError, match="at most 32 bytes, got 33"):
        channel.seal(REPORT, bytes(33), 0)
    with pytest.raises(ValueError, match=r"time_ns .* got -1"):
        channel.seal(REPORT, b"", -1)

"""The roll call of participants: its message, and whom it takes for having answered."""

from __future__ import annotations

import socket
import struct
import time

import pytest

from rail_corridor.middleware.roll_call import RollCall, announcement, announcer_of

PREFIX = bytes(range(12))


def parameters(message: bytes) -> dict[int, list[bytes]]:
    """Return the parameters of an announcement by number."""
    found: dict[int, list[bytes]] = {}
    at = message.index(b"\x00\x03\x00\x00") + 4
    while True:
        kind, length = struct.unpack_from("<HH", message, at)
        if kind == 1:
            assert at + 4 == len(message)
            return found
        found.setdefault(kind, []).append(message[at + 4 : at + 4 + length])
        at += 4 + length


def test_an_announcement_says_who_and_where() -> None:
    message = announcement(PREFIX, [7410, 7412])
    assert message[:20] == b"RTPS\x02\x03\x00\x00" + PREFIX
    kind, _, length = struct.unpack_from("<BBH", message, 20)
    assert (kind, length) == (0x15, len(message) - 24)
    found = parameters(message)
    assert found[0x0050] == [PREFIX + b"\x00\x00\x01\xc1"]
    ports = [struct.unpack_from("<iI", locator)[1] for locator in found[0x0032]]
    assert ports == [7410, 7412]
    assert {locator[-4:] for locator in found[0x0032]} == {socket.inet_aton("127.0.0.1")}


@pytest.mark.parametrize(
    ("message", "prefix"),
    [
        (announcement(PREFIX, [7410]), PREFIX),
        (b"RTPS\x02\x03\x01\x0f" + PREFIX + b"\x07\x01\x1c\x00" + bytes(28), None),
        (b"RTPS", None),
        (b"", None),
        (b"HTTP" + announcement(PREFIX, [7410])[4:], None),
    ],
)
def test_only_an_announcement_is_an_answer(message: bytes, prefix: bytes | None) -> None:
    assert announcer_of(message) == prefix


def test_whoever_answers_is_counted_once(ros_domain: int) -> None:
    with RollCall(ros_domain) as roll_call, socket.socket(type=socket.SOCK_DGRAM) as there:
        there.bind(("127.0.0.1", 7400 + 250 * ros_domain + 10 + 2 * 97))
        there.settimeout(30.0)
        roll_call.ask()
        assert roll_call.listen() == set()
        ports = [struct.unpack_from("<iI", each)[1] for each in parameters(there.recv(2000))[0x32]]
        for _ in range(2):
            there.sendto(announcement(PREFIX, [1]), ("127.0.0.1", ports[0]))
        deadline_s = time.monotonic() + 30.0
        while not roll_call.listen():
            assert time.monotonic() < deadline_s
        assert roll_call.listen() == {PREFIX}


def test_a_domain_at_the_end_of_the_ports_is_asked_as_far_as_they_go() -> None:
    with RollCall(232) as roll_call:
        roll_call.ask()
        assert roll_call.listen() == set()

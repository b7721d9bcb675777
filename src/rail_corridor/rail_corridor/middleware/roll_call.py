"""Who is in a ROS domain on this host: each participant is asked, and answers at once.

A participant of Fast DDS announces itself before it listens, so the answers of those that were
there before it are lost, and they announce themselves again only every three seconds. A message of
discovery that comes once it does listen makes each of them answer once more: to the socket of the
roll call, which so knows who is there, and to the participant of this process, which learns of
them in milliseconds. It is the announcement of a participant of no endpoints that leaves within a
second (DDSI-RTPS 2.3, 8.5.3, 9.6.1 and 9.6.2.2; the numbers are from there).
"""

from __future__ import annotations

import os
import socket
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Final

_HOST: Final = "127.0.0.1"
#: Participants of a host that are asked: as many as the profiles of the corridor ask.
_PARTICIPANTS: Final = 100
_PORT_BASE, _DOMAIN_GAIN, _UNICAST_AT, _PARTICIPANT_GAIN = 7400, 250, 10, 2
_HEADER: Final = b"RTPS\x02\x03\x00\x00"  # version 2.3, vendor unknown
_ANNOUNCER: Final = b"\x00\x01\x00\xc2"
_LEASE_S: Final = 1
#: Participant announcer and detector, which are what answers are meant for; no endpoints.
_ENDPOINTS: Final = 0b11
_PORTS: Final = 65536
_LONGEST: Final = 65536


class RollCall:
    """Asks the participants of a domain on this host, and counts those that answer.

    Parameters
    ----------
    domain : int
        The ROS domain.
    """

    def __init__(self, domain: int) -> None:
        first = _PORT_BASE + _DOMAIN_GAIN * domain + _UNICAST_AT
        ports = range(first, first + _PARTICIPANT_GAIN * _PARTICIPANTS, _PARTICIPANT_GAIN)
        self._ports = [port for port in ports if port < _PORTS]
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((_HOST, 0))
        self._socket.setblocking(False)
        self._own = [port for port in _ports_of_this_process() if port in self._ports]
        #: Prefixes of the participants that have answered.
        self.answered: set[bytes] = set()

    def __enter__(self) -> RollCall:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Ask nobody any more."""
        self._socket.close()

    def ask(self) -> None:
        """Ask everybody; whoever has answered before answers again."""
        ports = [self._socket.getsockname()[1], *self._own]
        message = announcement(os.urandom(12), ports)
        for port in self._ports:
            if port not in self._own:
                try:
                    self._socket.sendto(message, (_HOST, port))
                except OSError:  # nobody listens there, which the system may say one call later
                    continue

    def listen(self) -> set[bytes]:
        """Take the answers that have come; the prefixes of all participants that have answered."""
        while True:
            try:
                prefix = announcer_of(self._socket.recv(_LONGEST))
            except BlockingIOError:
                return self.answered
            except OSError:  # of a port that nobody listens at
                continue
            if prefix is not None:
                self.answered.add(prefix)


def announcement(prefix: bytes, ports: list[int]) -> bytes:
    """Message of a participant without endpoints that listens at these ports of this host."""
    locators = [struct.pack("<iI12s4s", 1, port, b"", socket.inet_aton(_HOST)) for port in ports]
    parameters = (
        (0x0015, b"\x02\x03\x00\x00"),  # protocol version
        (0x0016, b"\x00\x00\x00\x00"),  # vendor
        (0x0050, prefix + b"\x00\x00\x01\xc1"),  # participant
        *((0x0032, locator) for locator in locators),  # where it hears discovery
        *((0x0031, locator) for locator in locators[:1]),  # and data
        (0x0002, struct.pack("<iI", _LEASE_S, 0)),
        (0x0058, struct.pack("<I", _ENDPOINTS)),
        (0x0001, b""),  # end
    )
    fields = b"".join(struct.pack("<HH", kind, len(value)) + value for kind, value in parameters)
    # From the announcer to any reader, the first of its messages, a list of parameters.
    head = struct.pack("<HH4s4siI", 0, 16, b"", _ANNOUNCER, 0, 1)
    data = head + b"\x00\x03\x00\x00" + fields
    return _HEADER + prefix + struct.pack("<BBH", 0x15, 0b101, len(data)) + data


def announcer_of(message: bytes) -> bytes | None:
    """Prefix of the participant that announces itself in a message, None in another message."""
    if len(message) < 20 or message[:4] != b"RTPS":
        return None
    return message[8:20] if _ANNOUNCER in message[20:] else None


def _ports_of_this_process() -> Iterator[int]:
    """Yield the UDP ports that are open in this process; none where the system does not say."""
    mine = set()
    try:
        entries = [*Path("/proc/self/fd").iterdir()]
        lines = Path("/proc/self/net/udp").read_text().splitlines()[1:]
    except OSError:
        return
    for entry in entries:
        try:
            mine.add(os.readlink(entry))
        except OSError:
            continue
    for line in lines:
        words = line.split()
        if f"socket:[{words[9]}]" in mine:
            yield int(words[1].rpartition(":")[2], 16)

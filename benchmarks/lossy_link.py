"""Two or more hosts on one machine, joined by a wire that loses packets.

Each host is a network namespace with one Ethernet device of its own (a TAP); this process carries
the frames from each to all others and drops some, drawn from a seed. It takes no module of the
kernel but ``tun`` - many kernels are built without ``netem`` - and leaves nothing behind:
namespaces and devices end with the processes that are in them, however those end.

It takes the right to make namespaces: root, or ``unshare --user --map-root-user`` where users may.
"""

from __future__ import annotations

import ctypes
import fcntl
import os
import random
import select
import struct
import subprocess
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, TypeVar

_T = TypeVar("_T")

MTU = 1500
#: Frames that a host may have waiting for the wire: a queue that overflows would lose as well.
QUEUE = 20_000

_CLONE_NEWNET = 0x40000000
_TUNSETIFF = 0x400454CA
_IFF_TAP, _IFF_NO_PI = 0x0002, 0x1000
_DEVICE = "wire"


class NoLinkError(OSError):
    """Machine or user may not have such a link."""


@dataclass
class Direction:
    """What has gone one way: frames that came to the wire, and those of them it dropped."""

    frames: int = 0
    dropped: int = 0
    octets: int = 0

    @property
    def loss(self) -> float:
        """Fraction of frames that were dropped."""
        return self.dropped / self.frames if self.frames else 0.0


class LinkedHost:
    """One end: a network namespace, which a thread of this process is in."""

    def __init__(self, address: str) -> None:
        self.address = address
        # A namespace belongs to a thread, and what that thread starts is in it as well.
        self._thread = ThreadPoolExecutor(1, thread_name_prefix=f"host_{address}")
        try:
            self.wire = self._thread.submit(self._make).result()
        except BaseException:
            self._thread.shutdown()
            raise

    def _make(self) -> int:
        libc = ctypes.CDLL(None, use_errno=True)
        if libc.unshare(_CLONE_NEWNET) != 0:
            reason = os.strerror(ctypes.get_errno())
            raise NoLinkError(f"no network namespace: {reason} (root has that right)")
        try:
            wire = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
            try:
                flags = _IFF_TAP | _IFF_NO_PI
                fcntl.ioctl(wire, _TUNSETIFF, struct.pack("16sH22x", _DEVICE.encode(), flags))
            except OSError:
                os.close(wire)
                raise
        except OSError as error:
            raise NoLinkError(f"no TAP device: {error}") from error
        try:
            for command in (
                "link set lo up",
                f"addr add {self.address}/24 dev {_DEVICE}",
                f"link set {_DEVICE} up mtu {MTU} txqueuelen {QUEUE}",
            ):
                ip = ["ip", *command.split()]
                subprocess.run(ip, check=True, capture_output=True, text=True)
        except (OSError, subprocess.CalledProcessError) as error:
            os.close(wire)
            raise NoLinkError(f"no address for the device: {error}") from error
        return wire

    def start(self, command: list[str], **options: Any) -> subprocess.Popen[str]:
        """Start a program on this host."""
        return self._inside(lambda: subprocess.Popen(command, text=True, **options))

    def counter(self, protocol: str, name: str) -> int:
        """Counter of the network stack of this host, such as ('Udp', 'RcvbufErrors')."""
        text = self._inside(Path("/proc/thread-self/net/snmp").read_text)
        names, values = (
            line.split()[1:] for line in text.splitlines() if line.startswith(f"{protocol}:")
        )
        return int(dict(zip(names, values, strict=True))[name])

    def overflow(self) -> int:
        """Frames that did not find room in the queue before the wire."""
        text = self._inside(Path("/proc/thread-self/net/dev").read_text)
        line = next(line for line in text.splitlines() if line.strip().startswith(_DEVICE))
        return int(line.split(":")[1].split()[11])

    def _inside(self, work: Callable[[], _T]) -> _T:
        return self._thread.submit(work).result()

    def close(self) -> None:
        """Let go of the device and the namespace."""
        with suppress(OSError):
            os.close(self.wire)
        self._thread.shutdown()


class LossyLink:
    """A wire between hosts, for a ``with`` statement.

    Parameters
    ----------
    loss : float
        Probability that a frame is lost, either way, each for itself.
    seed : int
        Seed of the losses; each way has its own sequence.
    hosts : int
        How many there are.

    Raises
    ------
    NoLinkError
        On entry, where the machine or the user may not have such a link.
    """

    def __init__(self, loss: float, seed: int = 1, hosts: int = 2) -> None:
        self.loss, self.seed = loss, seed
        self.hosts: list[LinkedHost] = []
        #: From each host to the others.
        self.ways = tuple(Direction() for _ in range(hosts))

    def __enter__(self) -> LossyLink:
        try:
            for number in range(1, len(self.ways) + 1):
                self.hosts.append(LinkedHost(f"10.99.0.{number}"))
            self._end, self._ended = os.pipe()
        except BaseException:
            self._close_hosts()
            raise
        self._carrier = threading.Thread(target=self._carry, name="wire", daemon=True)
        self._carrier.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        os.close(self._ended)
        self._carrier.join()
        os.close(self._end)
        self._close_hosts()

    def _close_hosts(self) -> None:
        for host in self.hosts:
            host.close()

    def _carry(self) -> None:
        """Carry frames until the pipe is closed."""
        wires = [host.wire for host in self.hosts]
        routes = {
            source: (
                [wire for wire in wires if wire != source],
                way,
                random.Random(f"{self.seed} {index}").random,
            )
            for index, (source, way) in enumerate(zip(wires, self.ways, strict=True))
        }
        poll = select.poll()
        for fd in (*wires, self._end):
            poll.register(fd, select.POLLIN)
        while True:
            for fd, _ in poll.poll():
                if fd == self._end:
                    return
                sinks, way, draw = routes[fd]
                self._carry_waiting(fd, sinks, way, draw)

    def _carry_waiting(
        self,
        source: int,
        sinks: list[int],
        way: Direction,
        draw: Callable[[], float],
        most: int = 64,
    ) -> None:
        """Carry what waits at one end, but look at the others now and then."""
        for _ in range(most):
            try:
                frame = os.read(source, 2048)
            except BlockingIOError:
                return
            way.frames += 1
            way.octets += len(frame)
            if draw() < self.loss:
                way.dropped += 1
                continue
            for sink in sinks:
                os.write(sink, frame)

"""The seven threats of EN 50159:2010, done to the byte frames of radio links.

Whoever does them hears every link, remembers frames for as long as the run lasts (through any
restart), alters, holds back and sends what he likes; he knows the layout and the algorithms, but
no key. For each frame sent each threat strikes with its own probability:

============= ==============================================================================
repetition    sends a frame again: at once, one of the link's last 16, or any one remembered
deletion      takes the frame away
insertion     adds a frame with a fitting header and random content, or one that is random
              throughout, or this frame with a newer number and time-stamp
resequencing  holds the frame back until one to three later ones have passed
corruption    flips one to eight bits, or fills a run of bytes, or all of it, at random
delay         holds the frame back for a random time
masquerade    brings a frame of another link here, as it is or with its addresses changed; adds
              one sealed with a key of his own; throws the frame back to its sender
============= ==============================================================================

Deterministic: the same frames in the same order and the same generator give the same arrivals.
"""

from __future__ import annotations

import heapq
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, fields
from enum import Enum
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from rail_msgs_py.stamps import seconds_to_ns
from rail_msgs_py.train_radio.fixed_point import check_number
from rail_msgs_py.train_radio.quantities import LONGEST_DELAY
from rail_msgs_py.train_radio.safe_frame import (
    CODE_BYTES,
    FRAME_BYTES,
    LAST_SEQUENCE,
    LAST_TIME_NS,
    PAYLOAD_BYTES,
    SafetyCode,
    payload_of,
    read_header,
    write_header,
)

#: Identities of sender and receiver.
Link: TypeAlias = tuple[int, int]

RECENT_FRAMES: Final = 16
#: What is sent at the heels of a frame comes so much later [ns].
AFTER_NS: Final = 1000
_HELD_FRAMES = 3
_FLIPPED_BITS = 8
_BLOCK = 4096


class Threat(Enum):
    """A threat of EN 50159, 4.2."""

    REPETITION = "repetition"
    DELETION = "deletion"
    INSERTION = "insertion"
    RESEQUENCING = "resequencing"
    CORRUPTION = "corruption"
    DELAY = "delay"
    MASQUERADE = "masquerade"


@dataclass(frozen=True, slots=True)
class ThreatRates:
    """Probability, per frame sent, of each threat; 0 to 1."""

    repetition: float = 0.0
    deletion: float = 0.0
    insertion: float = 0.0
    resequencing: float = 0.0
    corruption: float = 0.0
    delay: float = 0.0
    masquerade: float = 0.0

    def __post_init__(self) -> None:
        """Check the ranges."""
        for field in fields(self):
            check_number(field.name, getattr(self, field.name), 0.0, 1.0)


class Arrival(NamedTuple):
    """A frame that comes out at the far end of a link.

    `threat` is None for a frame sent on this link that nobody touched; `sent_ns` is when these
    very bytes were sent on any link, -1 if they never were.
    """

    time_ns: int
    link: Link
    frame: bytes
    threat: Threat | None
    sent_ns: int


class FrameThreats:
    """Radio links on which the threats are at work.

    Parameters
    ----------
    rates : ThreatRates
    rng : generator
    latency_s : float
        Of an untouched frame.
    longest_delay_s : float
        A delay is uniform up to this.
    memory : int
        Frames remembered, an even sample of all that were sent.
    """

    def __init__(
        self,
        rates: ThreatRates,
        rng: np.random.Generator,
        *,
        latency_s: float = 0.0,
        longest_delay_s: float = LONGEST_DELAY.default,
        memory: int = 1024,
    ) -> None:
        check_number("latency_s", latency_s, 0.0, 60.0)
        check_number("memory", memory, 1, 1 << 20)
        self.act(rates, longest_delay_s)
        self._uniform: list[float] = []
        self._rng = rng
        self._latency_ns = seconds_to_ns(latency_s)
        self._memory = memory
        self._archive: list[tuple[Link, bytes, int]] = []
        self._recent: dict[Link, deque[tuple[bytes, int]]] = {}
        self._held: dict[Link, list[tuple[int, bytes, Threat, int]]] = {}
        self._queue: list[tuple[int, int, Arrival]] = []
        self._sent = self._queued = 0
        self._wrong_key = SafetyCode(rng.bytes(16))
        self._insertions = (self._fitting, self._random, self._renumbered)
        self._masquerades = (
            self._brought_here,
            self._readdressed,
            self._sealed_with_another_key,
            self._thrown_back,
        )
        #: How often each threat has struck.
        self.strikes: Counter[Threat] = Counter()

    def act(self, rates: ThreatRates, longest_delay_s: float) -> None:
        """From now on strike at these rates, and delay by so much at most [s]."""
        check_number("longest_delay_s", longest_delay_s, 0.0, 3600.0)
        self._rates = [(threat, getattr(rates, threat.value)) for threat in Threat]
        self._longest_ns = seconds_to_ns(longest_delay_s)

    def send(self, link: Link, frame: bytes, time_ns: int) -> None:
        """Take a frame of the link's sender; what it leads to comes out of `arrivals`."""
        draws = self._uniform
        if len(draws) < len(self._rates):
            draws += self._rng.random(_BLOCK).tolist()  # one by one costs ten times as much
        struck = [threat for threat, rate in self._rates if draws.pop() < rate]
        self._remember(link, frame, time_ns)
        if not struck:
            self._add(link, frame, time_ns, None, time_ns)
        else:
            self.strikes.update(struck)
            self._own_frame(link, frame, time_ns, struck)
            if Threat.REPETITION in struck:
                self._repeat(link, frame, time_ns)
            if Threat.INSERTION in struck:
                self._one_of(self._insertions)(link, frame, time_ns)
            if Threat.MASQUERADE in struck:
                self._one_of(self._masquerades)(link, frame, time_ns)
        self._release(link, time_ns)

    def arrivals(self, until_ns: int) -> list[Arrival]:
        """Frames that arrive up to a time and were not given before, in order of arrival."""
        due = []
        while self._queue and self._queue[0][0] <= until_ns:
            due.append(heapq.heappop(self._queue)[2])
        return due

    def _below(self, limit: int) -> int:
        if not self._uniform:
            self._uniform += self._rng.random(_BLOCK).tolist()
        return int(self._uniform.pop() * limit)

    def _one_of(
        self, ways: tuple[Callable[[Link, bytes, int], None], ...]
    ) -> Callable[[Link, bytes, int], None]:
        return ways[self._below(len(ways))]

    def _add(
        self, link: Link, frame: bytes, time_ns: int, threat: Threat | None, sent_ns: int = -1
    ) -> None:
        arrival = Arrival(time_ns + self._latency_ns, link, frame, threat, sent_ns)
        heapq.heappush(self._queue, (arrival.time_ns, self._queued, arrival))
        self._queued += 1

    def _remember(self, link: Link, frame: bytes, time_ns: int) -> None:
        self._recent.setdefault(link, deque(maxlen=RECENT_FRAMES)).append((frame, time_ns))
        self._sent += 1
        if len(self._archive) < self._memory:
            self._archive.append((link, frame, time_ns))
            return
        place = self._below(self._sent)  # reservoir sampling (Vitter, 1985, algorithm R)
        if place < self._memory:
            self._archive[place] = (link, frame, time_ns)

    def _own_frame(self, link: Link, frame: bytes, time_ns: int, struck: list[Threat]) -> None:
        if Threat.DELETION in struck:
            return
        threat: Threat | None = None
        sent_ns = time_ns
        arrives_ns = time_ns
        if Threat.DELAY in struck:
            threat = Threat.DELAY
            arrives_ns += self._below(self._longest_ns + 1)
        if Threat.CORRUPTION in struck:
            threat = Threat.CORRUPTION
            frame, sent_ns = self._corrupted(frame), -1
        if Threat.RESEQUENCING in struck:
            held = self._held.setdefault(link, [])
            # One more than the frames to wait for: `_release` counts this one too.
            count = 2 + self._below(_HELD_FRAMES)
            held.append((count, frame, threat or Threat.RESEQUENCING, sent_ns))
        else:
            self._add(link, frame, arrives_ns, threat, sent_ns)

    def _release(self, link: Link, time_ns: int) -> None:
        held = self._held.get(link)
        if not held:
            return
        rest = []
        for count, frame, threat, sent_ns in held:
            if count == 1:
                self._add(link, frame, time_ns + AFTER_NS, threat, sent_ns)
            else:
                rest.append((count - 1, frame, threat, sent_ns))
        self._held[link] = rest

    def _corrupted(self, frame: bytes) -> bytes:
        damaged = bytearray(frame)
        choice = self._below(3)
        if choice == 0:
            for bit in self._rng.choice(8 * len(frame), 1 + self._below(_FLIPPED_BITS), False):
                damaged[bit >> 3] ^= 1 << (bit & 7)
        else:
            start = self._below(len(frame)) if choice == 1 else 0
            length = 1 + self._below(len(frame) - start) if choice == 1 else len(frame)
            damaged[start : start + length] = self._rng.bytes(length)
        if damaged == frame:
            damaged[0] ^= 1
        return bytes(damaged)

    def _repeat(self, link: Link, frame: bytes, time_ns: int) -> None:
        choice = self._below(3)
        if choice == 0:
            self._add(link, frame, time_ns + AFTER_NS, Threat.REPETITION, time_ns)
            return
        if choice == 1:
            recent = self._recent[link]
            frame, sent_ns = recent[self._below(len(recent))]
        else:
            link, frame, sent_ns = self._archive[self._below(len(self._archive))]
        self._add(link, frame, time_ns + AFTER_NS, Threat.REPETITION, sent_ns)

    def _random(self, link: Link, _frame: bytes, time_ns: int) -> None:
        self._add(link, self._rng.bytes(FRAME_BYTES), time_ns, Threat.INSERTION)

    def _fitting(self, link: Link, frame: bytes, time_ns: int) -> None:
        content = self._rng.bytes(PAYLOAD_BYTES + CODE_BYTES)
        self._add(link, self._next_header(frame) + content, time_ns, Threat.INSERTION)

    def _renumbered(self, link: Link, frame: bytes, time_ns: int) -> None:
        header = self._next_header(frame)
        self._add(link, header + frame[len(header) :], time_ns, Threat.INSERTION)

    def _next_header(self, frame: bytes) -> bytes:
        """Header of a frame that follows one, by the clock of its sender."""
        header = read_header(frame)
        sequence = min(header.sequence + 1 + self._below(4), LAST_SEQUENCE)
        time_ns = min(header.time_ns + AFTER_NS, LAST_TIME_NS)
        return write_header(header._replace(sequence=sequence, time_ns=time_ns))

    def _foreign(self, link: Link) -> tuple[bytes, int] | None:
        others = [other for other in self._recent if other != link]
        return self._recent[others[self._below(len(others))]][-1] if others else None

    def _brought_here(self, link: Link, frame: bytes, time_ns: int) -> None:
        foreign = self._foreign(link)
        if foreign is None:
            self._sealed_with_another_key(link, frame, time_ns)
            return
        self._add(link, foreign[0], time_ns + AFTER_NS, Threat.MASQUERADE, foreign[1])

    def _readdressed(self, link: Link, frame: bytes, time_ns: int) -> None:
        foreign = self._foreign(link)
        if foreign is None:
            self._sealed_with_another_key(link, frame, time_ns)
            return
        ours, header = read_header(frame), read_header(foreign[0])
        # With the addresses, number and mark of this link, the content of the other.
        head = write_header(ours._replace(kind=header.kind, length=header.length))
        self._add(link, head + foreign[0][len(head) :], time_ns, Threat.MASQUERADE)

    def _sealed_with_another_key(self, link: Link, frame: bytes, time_ns: int) -> None:
        head = read_header(self._next_header(frame) + payload_of(frame))
        forged = self._wrong_key.seal(head, payload_of(frame))
        self._add(link, forged, time_ns, Threat.MASQUERADE)

    def _thrown_back(self, link: Link, frame: bytes, time_ns: int) -> None:
        source, destination = link
        back = (destination, source)
        self._add(back, frame, time_ns + AFTER_NS, Threat.MASQUERADE, time_ns)

"""An intruder who waits for ends to be started anew and plays to them how they began before.

He records what came over a link in the first ticks after its receiver was started: greetings,
answers, data. When a receiver is started anew, which its greetings tell him, he plays one of his
recordings to it, in the order and at the pace of then, or all of it in every tick for a while. If
an end ever offered a nonce a second time, the recorded answers would prove a session to it.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from .frame_threats import Link

#: Frames of a recording; a session stands after two or three.
RECORDED_FRAMES: Final = 12
#: Recordings kept of each link, the newest of them.
_KEPT = 8
_BURST_TICKS = 4


@dataclass
class _Tape:
    """Recordings of one link, and what is being played of one."""

    recordings: deque[list[bytes]] = field(default_factory=lambda: deque([[]], maxlen=_KEPT))
    playing: deque[list[bytes]] = field(default_factory=deque)


class DirectedReplay:
    """Records links, and plays to those who are started anew.

    Parameters
    ----------
    rng : generator
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._tapes: dict[Link, _Tape] = {}

    def hear(self, link: Link, frame: bytes) -> None:
        """Record a frame of a link if its receiver was started not long ago."""
        newest = self._tapes.setdefault(link, _Tape()).recordings[-1]
        if len(newest) < RECORDED_FRAMES:
            newest.append(frame)

    def restart(self, link: Link) -> None:
        """The receiver of a link is started anew: play to it, and record how it goes on."""
        tape = self._tapes.setdefault(link, _Tape())
        recorded = [each for each in tape.recordings if each]
        if recorded:
            chosen = recorded[int(self._rng.integers(len(recorded)))]
            at_pace = self._rng.random() < 0.5
            tape.playing = deque([[f] for f in chosen] if at_pace else [chosen] * _BURST_TICKS)
        tape.recordings.append([])

    def play(self, link: Link) -> list[bytes]:
        """Frames that come over a link in this tick beside its own."""
        playing = self._tapes.setdefault(link, _Tape()).playing
        return playing.popleft() if playing else []

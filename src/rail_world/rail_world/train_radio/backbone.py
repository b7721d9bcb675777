"""The backbone: the wired network between the zone controller and the base stations.

It is an open transmission system in the sense of EN 50159:2010 (category 3): an intruder sits on
it who does to its frames what `rail_world.train_radio.frame_threats` says, in both directions, so
that what
he sends is then modulated and heard like anything else. In each tick the frames from the trains
come first, then those to them:

========================== ===================================================================
link of a frame            (train, controller) or (controller, train); the train is its slot
base stations it goes by   those that it was sent by in this tick, if it was
                           else those that frames of its link went by last: where the intruder
                           finds the train
                           else all, as long as there was none
a frame by several bases   is one frame, which comes out at all of them
a frame of the other way,  one thrown back: comes out when the frames of its own way are next
                           carried
a frame that is delayed    comes out in the first tick that is not before its time
========================== ===================================================================

With no threat at work everything comes out where and in the tick in which it went in, and what
goes through one slot keeps its order.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import TypeAlias

import numpy as np

from rail_msgs_py.stamps import NANOSECONDS
from rail_msgs_py.train_radio.train_channel import CONTROLLER_IDENTITY

from .frame_threats import AFTER_NS, FrameThreats, Link, Threat, ThreatRates
from .threat_description import ThreatPeriod, rates_at

#: Slot and frame of each telegram, by base station.
Frames: TypeAlias = Mapping[str, Iterable[tuple[int, bytes]]]
Carried: TypeAlias = dict[str, list[tuple[int, bytes]]]


class Backbone:
    """Carries the frames of every tick: `up`, then `down`.

    Parameters
    ----------
    bases : iterable of str
        Base stations.
    periods : iterable of ThreatPeriod
        What the intruder does, and when.
    rng : generator
    """

    def __init__(
        self, bases: Iterable[str], periods: Iterable[ThreatPeriod], rng: np.random.Generator
    ) -> None:
        self._bases = tuple(bases)
        self._periods = tuple(periods)
        self._threats = FrameThreats(ThreatRates(), rng)
        self._by: dict[Link, tuple[str, ...]] = {}
        self._arrived: list[tuple[Link, bytes]] = []
        #: Frames carried; what the intruder adds is none of them.
        self.frames = 0

    def start_over(self) -> None:
        """Lose what the network has learnt and holds; the intruder keeps what is his."""
        self._by.clear()
        self._arrived.clear()

    @property
    def strikes(self) -> Counter[Threat]:
        """How often each threat has struck."""
        return self._threats.strikes

    def up(self, time_ns: int, received: Frames) -> Carried:
        """Frames that base stations heard in a tick -> frames that come to the controller."""
        return self._carry(time_ns, received, upward=True)

    def down(self, time_ns: int, ordered: Frames) -> Carried:
        """Frames that the controller sends in a tick -> frames that come to base stations."""
        return self._carry(time_ns, ordered, upward=False)

    def _carry(self, time_ns: int, frames: Frames, *, upward: bool) -> Carried:
        self._threats.act(*rates_at(self._periods, time_ns / NANOSECONDS))
        sent: dict[tuple[Link, bytes], tuple[str, ...]] = {}
        by: dict[Link, tuple[str, ...]] = {}
        for base in self._bases:
            for slot, frame in frames.get(base, ()):
                link = (slot, CONTROLLER_IDENTITY) if upward else (CONTROLLER_IDENTITY, slot)
                sent[link, frame] = (*sent.get((link, frame), ()), base)
                by[link] = tuple(dict.fromkeys((*by.get(link, ()), base)))
        self._by |= by
        for link, frame in sent:
            self._threats.send(link, frame, time_ns)
        self.frames += len(sent)
        self._arrived += (
            (arrival.link, arrival.frame) for arrival in self._threats.arrivals(time_ns + AFTER_NS)
        )
        out: Carried = {base: [] for base in self._bases}
        later = []
        for link, frame in self._arrived:
            if (link[1] == CONTROLLER_IDENTITY) is not upward:
                later.append((link, frame))
                continue
            slot = link[0] if upward else link[1]
            for base in sent.get((link, frame)) or self._by.get(link, self._bases):
                out[base].append((slot, frame))
        self._arrived = later
        return out

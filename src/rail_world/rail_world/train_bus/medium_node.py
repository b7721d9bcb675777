"""The bus cables of all trains as a node: takes what is driven onto them, delivers what arrives.

Topics in: ``/clock``, of every train both terminals' ``tx`` and the reflectometer's ``tx``.
Topics out: both terminals' ``rx``, the reflectometer's ``rx``, ``~/links``, ``~/done``.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log10, nan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rail_msgs_py.decoders import waveform
from rail_msgs_py.delivery import Send
from rail_msgs_py.topics.train_bus import (
    BUS_LINKS,
    BUS_RX,
    BUS_TX,
    REFLECTOMETER_RX,
    REFLECTOMETER_TX,
)
from rail_msgs_py.waveform import Waveform, silence
from rail_world.medium_node import MediumNode, MediumParameters

from .description import BusDescription
from .medium import BusMedium, bus_media


@dataclass(frozen=True)
class BusMediumParameters(MediumParameters):
    """Parameters of the buses."""


class _BusTrain(NamedTuple):
    """Medium and ports of one train."""

    medium: BusMedium
    head: str
    tail: str
    reflectometer: str
    to_head: Send
    to_tail: Send
    to_reflectometer: Send


class BusMediumNode(MediumNode[BusMediumParameters], name="bus_medium", namespace="/world"):
    """The buses as a node."""

    def setup(self) -> None:
        """Open the ports of all trains."""
        bus = self.part("train_bus", BusDescription)
        self._rate_hz = bus.sample_rate_hz
        self._tick_ns = self._world.tick_ns
        self._trains = [
            _BusTrain(
                medium,
                self.inputs.port(BUS_TX, waveform, train=name, end="head"),
                self.inputs.port(BUS_TX, waveform, train=name, end="tail"),
                self.inputs.port(REFLECTOMETER_TX, waveform, train=name),
                self.stream_out(BUS_RX, train=name, end="head"),
                self.stream_out(BUS_RX, train=name, end="tail"),
                self.stream_out(REFLECTOMETER_RX, train=name),
            )
            for name, medium in bus_media(bus, self._world.seed).items()
        ]
        self.inputs.clock()
        self._links = self.table_out(BUS_LINKS, (each.train for each in bus.trains))

    def on_tick(self, stamp_ns: int, items: dict[str, Any]) -> None:
        """Carry the frames from end to end, and the edges of the reflectometers back."""
        tick, time_s = stamp_ns // self._tick_ns, stamp_ns * 1e-9
        links = np.full((len(self._trains), len(BUS_LINKS.columns)), nan)
        for row, train in enumerate(self._trains):
            links[row, 0] = train.medium.grown(time_s)
            links[row, 1] = self._carry(train, tick, stamp_ns, items.get(train.head), True)
            links[row, 2] = self._carry(train, tick, stamp_ns, items.get(train.tail), False)
            self._reflect(train, tick, stamp_ns, items.get(train.reflectometer))
        self._links(stamp_ns, links)

    def _carry(
        self, train: _BusTrain, tick: int, stamp_ns: int, block: Waveform | None, to_tail: bool
    ) -> float:
        """Deliver a frame; the energy of its bits over the noise density [dB]."""
        publish = train.to_tail if to_tail else train.to_head
        if block is None or block.silent or block.sample_rate_hz != self._rate_hz:
            publish(silence(stamp_ns, self._rate_hz, 0.0, 0))
            return nan
        sent = np.ascontiguousarray(block.row.real)
        arrived = train.medium.carry(tick, stamp_ns * 1e-9, sent, to_tail=to_tail)
        publish(_block(stamp_ns, self._rate_hz, arrived.samples[None]))
        return 10.0 * log10(arrived.ebn0) if arrived.ebn0 > 0.0 else nan

    def _reflect(self, train: _BusTrain, tick: int, stamp_ns: int, block: Waveform | None) -> None:
        if block is None or block.silent:
            rate_hz = self._rate_hz if block is None else block.sample_rate_hz
            train.to_reflectometer(silence(stamp_ns, rate_hz, 0.0, 0))
            return
        sent = np.ascontiguousarray(block.samples.real)
        seen = train.medium.reflect(tick, stamp_ns * 1e-9, sent, block.sample_rate_hz)
        train.to_reflectometer(_block(stamp_ns, block.sample_rate_hz, seen))


def _block(stamp_ns: int, rate_hz: float, rows: NDArray[np.float64]) -> Waveform:
    return Waveform(stamp_ns, rate_hz, 0.0, 0, rows.astype(np.complex128))


if __name__ == "__main__":
    BusMediumNode.main()

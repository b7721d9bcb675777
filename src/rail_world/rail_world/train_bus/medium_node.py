"""The bus cables of all trains as a node: takes what is driven onto them, delivers what arrives.

Topics in: ``/clock``, of every train both terminals' ``tx`` and the reflectometer's ``tx``.
Topics out: both terminals' ``rx``, the reflectometer's ``rx``, ``~/links``, ``~/done``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import log10, nan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rail_msgs_py.failures import TickWatch
from rail_msgs_py.headers import header_to_cdr
from rail_msgs_py.inbox import TickInbox
from rail_msgs_py.node import CorridorNode
from rail_msgs_py.parameters import declare, parameter
from rail_msgs_py.stamps import clock_from_cdr
from rail_msgs_py.standalone import run_node
from rail_msgs_py.table import TableWriter
from rail_msgs_py.topics.tick import CLOCK, DONE
from rail_msgs_py.topics.train_bus import (
    BUS_LINKS,
    BUS_RX,
    BUS_TX,
    REFLECTOMETER_RX,
    REFLECTOMETER_TX,
)
from rail_msgs_py.waveform import Waveform, silence
from rail_world.media import read_part

from .description import BusDescription
from .medium import BusMedium, bus_media

_CLOCK_PORT = "clock"


@dataclass(frozen=True)
class BusMediumParameters:
    """Parameters of the buses."""

    world_file: str = parameter("", "JSON file with tracks, trains and media")
    timeout_s: float = parameter(
        2.0, "wall time after which a block is given up", unit="s", low=0.05, high=3600.0
    )


class _Train(NamedTuple):
    """Medium and ports of one train."""

    medium: BusMedium
    head: str
    tail: str
    reflectometer: str
    to_head: Callable[[bytes], None]
    to_tail: Callable[[bytes], None]
    to_reflectometer: Callable[[bytes], None]


class BusMediumNode(CorridorNode):
    """The buses as a node."""

    def __init__(
        self,
        *,
        namespace: str = "/world",
        context: Any = None,
        parameters: Mapping[str, Any] | None = None,
        services: bool = True,
    ) -> None:
        super().__init__(
            "bus_medium", namespace, context=context, parameters=parameters, services=services
        )
        self._p = declare(self, BusMediumParameters)
        described, part = read_part(self._p.world_file, "train_bus", BusDescription)
        self._rate_hz = part.sample_rate_hz
        self._tick_ns = described.tick_ns
        owners: dict[str, str] = {}
        self._trains: list[_Train] = []
        for name, medium in bus_media(part, described.seed).items():
            ends = [BUS_TX.name(train=name, end=end) for end in ("head", "tail")]
            probe = REFLECTOMETER_TX.name(train=name)
            for port, end in zip(ends, ("head", "tail"), strict=True):
                owners[port] = BUS_TX.owner(train=name, end=end)
                self._listen(port, BUS_TX, train=name, end=end)
            owners[probe] = REFLECTOMETER_TX.owner(train=name)
            self._listen(probe, REFLECTOMETER_TX, train=name)
            self._trains.append(
                _Train(
                    medium,
                    *ends,
                    probe,
                    self.stream_out(BUS_RX, train=name, end="head"),
                    self.stream_out(BUS_RX, train=name, end="tail"),
                    self.stream_out(REFLECTOMETER_RX, train=name),
                )
            )
        self._inbox: TickInbox[Waveform | None] = TickInbox([_CLOCK_PORT, *owners])
        self._watch = TickWatch(self, self._inbox, owners, self._p.timeout_s, self._advance)
        self.stream_in(CLOCK, self._on_clock)
        self._links = self.publisher(BUS_LINKS).publish
        names = tuple(bus.train for bus in part.trains)
        self._links_table = TableWriter(names, BUS_LINKS.columns)
        self._done = self.stream_out(DONE, node=self.get_fully_qualified_name())
        self.announce_when_connected()

    def _listen(self, port: str, topic: Any, **parts: object) -> None:
        def put(raw: bytes) -> None:
            block = Waveform.from_cdr(raw)
            self._inbox.put(block.stamp_ns, port, block)
            self._advance()

        self.stream_in(topic, put, **parts)

    def _on_clock(self, raw: bytes) -> None:
        self._inbox.put(clock_from_cdr(raw), _CLOCK_PORT, None)
        self._watch.begin()
        self._advance()

    def _advance(self) -> None:
        while self._inbox.complete:
            self._deliver(*self._inbox.take())

    def _deliver(self, stamp_ns: int, items: dict[str, Waveform | None]) -> None:
        self._watch.end()
        tick, time_s = stamp_ns // self._tick_ns, stamp_ns * 1e-9
        links = np.full((len(self._trains), len(BUS_LINKS.columns)), nan)
        for row, train in enumerate(self._trains):
            links[row, 0] = train.medium.grown(time_s)
            links[row, 1] = self._carry(train, tick, stamp_ns, items.get(train.head), True)
            links[row, 2] = self._carry(train, tick, stamp_ns, items.get(train.tail), False)
            self._reflect(train, tick, stamp_ns, items.get(train.reflectometer))
        self._links(self._links_table.write(stamp_ns, links))
        self._done(header_to_cdr(stamp_ns))

    def _carry(
        self, train: _Train, tick: int, stamp_ns: int, block: Waveform | None, to_tail: bool
    ) -> float:
        """Deliver a frame; the energy of its bits over the noise density [dB]."""
        publish = train.to_tail if to_tail else train.to_head
        if block is None or block.silent or block.sample_rate_hz != self._rate_hz:
            publish(silence(stamp_ns, self._rate_hz, 0.0, 0).to_cdr())
            return nan
        sent = np.ascontiguousarray(block.row.real)
        arrived = train.medium.carry(tick, stamp_ns * 1e-9, sent, to_tail=to_tail)
        publish(_block(stamp_ns, self._rate_hz, arrived.samples[None]))
        return 10.0 * log10(arrived.ebn0) if arrived.ebn0 > 0.0 else nan

    def _reflect(self, train: _Train, tick: int, stamp_ns: int, block: Waveform | None) -> None:
        if block is None or block.silent:
            rate_hz = self._rate_hz if block is None else block.sample_rate_hz
            train.to_reflectometer(silence(stamp_ns, rate_hz, 0.0, 0).to_cdr())
            return
        sent = np.ascontiguousarray(block.samples.real)
        seen = train.medium.reflect(tick, stamp_ns * 1e-9, sent, block.sample_rate_hz)
        train.to_reflectometer(_block(stamp_ns, block.sample_rate_hz, seen))


def _block(stamp_ns: int, rate_hz: float, rows: NDArray[np.float64]) -> bytes:
    return Waveform(stamp_ns, rate_hz, 0.0, 0, rows.astype(np.complex128)).to_cdr()


def main() -> None:
    """Run the buses on their own."""
    run_node(BusMediumNode)


if __name__ == "__main__":
    main()

"""The medium of the reference tones as a node.

Topics in: ``/world/state``, every reference station's ``tone``. Topics out: every train's
``doppler/rx``, ``~/done``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rail_msgs_py.failures import TickWatch
from rail_msgs_py.headers import header_to_cdr
from rail_msgs_py.inbox import TickInbox
from rail_msgs_py.node import CorridorNode
from rail_msgs_py.parameters import declare, parameter
from rail_msgs_py.standalone import run_node
from rail_msgs_py.table import figures_from_cdr
from rail_msgs_py.topics.doppler import REFERENCE_RX, REFERENCE_TX
from rail_msgs_py.topics.tick import DONE
from rail_msgs_py.topics.world import STATE
from rail_msgs_py.waveform import BlockReader, RepeatedBlock, Waveform, silence
from rail_world.media import read_part

from .description import ReferenceDescription
from .medium import ReferenceMedium

_STATE_PORT = "state"
_CHANNEL = 1


@dataclass(frozen=True)
class ReferenceMediumParameters:
    """Parameters of the medium."""

    world_file: str = parameter("", "JSON file with tracks, trains and media")
    timeout_s: float = parameter(
        2.0, "wall time after which a block is given up", unit="s", low=0.05, high=3600.0
    )


class ReferenceMediumNode(CorridorNode):
    """The medium of the reference tones as a node."""

    def __init__(
        self,
        *,
        namespace: str = "/world",
        context: Any = None,
        parameters: Mapping[str, Any] | None = None,
        services: bool = True,
    ) -> None:
        super().__init__(
            "reference_medium", namespace, context=context, parameters=parameters, services=services
        )
        self._p = declare(self, ReferenceMediumParameters)
        described, part = read_part(self._p.world_file, "doppler", ReferenceDescription)
        self._plan = plan = part
        self._tick_ns = described.tick_ns
        self._medium = ReferenceMedium(plan, described.network(), described.seed)
        owners: dict[str, str] = {}
        self._ports = [REFERENCE_TX.name(station=s.name) for s in plan.stations]
        for station, port in zip(plan.stations, self._ports, strict=True):
            owners[port] = REFERENCE_TX.owner(station=station.name)
            self.stream_in(
                REFERENCE_TX,
                lambda raw, port=port: self._put(port, raw),
                station=station.name,
            )
        self._out = [self.stream_out(REFERENCE_RX, train=train) for train in plan.trains]
        self._readers = {port: BlockReader() for port in self._ports}
        self._inbox: TickInbox[Any] = TickInbox([_STATE_PORT, *owners])
        self._watch = TickWatch(self, self._inbox, owners, self._p.timeout_s, self._advance)
        self.stream_in(STATE, self._on_state)
        self._done = self.stream_out(DONE, node=self.get_fully_qualified_name())
        self._silence = RepeatedBlock(silence(0, plan.sample_rate_hz, plan.carrier_hz, _CHANNEL))
        self.announce_when_connected()

    def _on_state(self, raw: bytes) -> None:
        trains = len(self._plan.trains)
        stamp_ns, state = figures_from_cdr(raw, trains, len(STATE.columns))
        self._inbox.put(stamp_ns, _STATE_PORT, state)
        self._watch.begin()
        self._advance()

    def _put(self, port: str, raw: bytes) -> None:
        stamp_ns, block = self._readers[port].read(raw)
        self._inbox.put(stamp_ns, port, block)
        self._advance()

    def _advance(self) -> None:
        while self._inbox.complete:
            self._deliver(*self._inbox.take())

    def _deliver(self, stamp_ns: int, items: dict[str, Any]) -> None:
        self._watch.end()
        state = items.get(_STATE_PORT)
        if state is None:
            return
        sent = {
            index: items[port].row
            for index, port in enumerate(self._ports)
            if port in items and not items[port].silent
        }
        heard = self._medium.receive(stamp_ns // self._tick_ns, stamp_ns * 1e-9, state, sent)
        plan = self._plan
        for train, publish in enumerate(self._out):
            if train in heard:
                samples = heard[train][None, :]
                block = Waveform(stamp_ns, plan.sample_rate_hz, plan.carrier_hz, _CHANNEL, samples)
                publish(block.to_cdr())
            else:
                publish(self._silence.at(stamp_ns))
        self._done(header_to_cdr(stamp_ns))


def main() -> None:
    """Run the medium on its own."""
    run_node(ReferenceMediumNode)


if __name__ == "__main__":
    main()

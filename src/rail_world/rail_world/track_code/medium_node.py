"""The rails as a node: takes what track circuits feed in, delivers what trains and circuits hear.

Topics in: ``/world/state``, every circuit's ``feed_end``. Topics out: every circuit's
``relay_end``, every train's ``rx``, ``~/done``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rail_msgs_py.failures import TickWatch
from rail_msgs_py.headers import header_to_cdr
from rail_msgs_py.inbox import TickInbox
from rail_msgs_py.node import CorridorNode
from rail_msgs_py.parameters import declare, parameter
from rail_msgs_py.standalone import run_node
from rail_msgs_py.table import figures_from_cdr
from rail_msgs_py.topics.tick import DONE
from rail_msgs_py.topics.track_code import CIRCUIT_RX, CIRCUIT_TX, CODE_RX
from rail_msgs_py.topics.world import STATE
from rail_msgs_py.waveform import BlockReader, Waveform
from rail_world.media import read_part

from .description import RailDescription
from .medium import RailMedium, TrainsOnRails

_STATE_PORT = "state"


@dataclass(frozen=True)
class RailMediumParameters:
    """Parameters of the rails."""

    world_file: str = parameter("", "JSON file with tracks, trains and media")
    timeout_s: float = parameter(
        2.0, "wall time after which a block is given up", unit="s", low=0.05, high=3600.0
    )


class RailMediumNode(CorridorNode):
    """The rails as a node."""

    def __init__(
        self,
        *,
        namespace: str = "/world",
        context: Any = None,
        parameters: Mapping[str, Any] | None = None,
        services: bool = True,
    ) -> None:
        super().__init__(
            "rail_medium", namespace, context=context, parameters=parameters, services=services
        )
        self._p = declare(self, RailMediumParameters)
        described, part = read_part(self._p.world_file, "track_code", RailDescription)
        self._rails = part
        self._tick_ns = described.tick_ns
        self._medium = RailMedium(part, described.seed, described.tick_s)
        self._lengths_m = np.array([train.vehicle.length_m for train in described.trains])
        self._trains = [train.name for train in described.trains]
        self._ports: list[str] = []
        self._circuit_out: list[Callable[[bytes], None]] = []
        owners: dict[str, str] = {}
        for circuit in part.circuits:
            port = CIRCUIT_TX.name(circuit=circuit.name)
            owners[port] = CIRCUIT_TX.owner(circuit=circuit.name)
            self._ports.append(port)
            self._circuit_out.append(self.stream_out(CIRCUIT_RX, circuit=circuit.name))
            self.stream_in(
                CIRCUIT_TX,
                lambda raw, port=port: self._on_block(port, raw),
                circuit=circuit.name,
            )
        self._train_out = [self.stream_out(CODE_RX, train=name) for name in self._trains]
        self._readers = {port: BlockReader() for port in self._ports}
        self._inbox: TickInbox[Any] = TickInbox([_STATE_PORT, *self._ports])
        self._watch = TickWatch(self, self._inbox, owners, self._p.timeout_s, self._advance)
        self.stream_in(STATE, self._on_state)
        self._done = self.stream_out(DONE, node=self.get_fully_qualified_name())
        self.announce_when_connected()

    def _on_state(self, raw: bytes) -> None:
        stamp_ns, state = figures_from_cdr(raw, len(self._trains), len(STATE.columns))
        self._inbox.put(stamp_ns, _STATE_PORT, state)
        self._watch.begin()
        self._advance()

    def _on_block(self, port: str, raw: bytes) -> None:
        stamp_ns, block = self._readers[port].read(raw)
        self._inbox.put(stamp_ns, port, None if block.silent else block.row.real)
        self._advance()

    def _advance(self) -> None:
        while self._inbox.complete:
            self._deliver(*self._inbox.take())

    def _deliver(self, stamp_ns: int, items: dict[str, Any]) -> None:
        self._watch.end()
        state = items.get(_STATE_PORT)
        if state is None:
            return
        front_m = state[:, STATE.index["chainage_m"]].copy()
        trains = TrainsOnRails(
            track=state[:, STATE.index["track_index"]].astype(np.intp),
            front_m=front_m,
            rear_m=front_m - self._lengths_m,
            on_line=state[:, STATE.index["on_line"]] > 0.0,
        )
        blocks = {
            index: items[port]
            for index, port in enumerate(self._ports)
            if items.get(port) is not None
        }
        # A block is what happens during the tick that ends at its stamp.
        tick, time_s = stamp_ns // self._tick_ns, stamp_ns * 1e-9
        heard = self._medium.propagate(tick, time_s, trains, blocks)
        for publish, samples in zip(self._train_out, heard.trains, strict=True):
            publish(self._block(stamp_ns, samples))
        for publish, samples in zip(self._circuit_out, heard.circuits, strict=True):
            publish(self._block(stamp_ns, samples))
        self._done(header_to_cdr(stamp_ns))

    def _block(self, stamp_ns: int, samples: NDArray[np.float64]) -> bytes:
        return Waveform(
            stamp_ns, self._rails.sample_rate_hz, 0.0, 0, samples[None].astype(np.complex128)
        ).to_cdr()


def main() -> None:
    """Run the rails on their own."""
    run_node(RailMediumNode)


if __name__ == "__main__":
    main()

"""Terminal of the train bus at one end of a train: messages to frames, and frames to messages.

Topics in: ``/clock``, ``rx``. Topics out: ``tx``, ``link``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from numpy.typing import NDArray

from rail_msgs_py.failures import TickWatch
from rail_msgs_py.inbox import TickInbox
from rail_msgs_py.node import Equipment
from rail_msgs_py.parameters import ParameterError, declare, parameter
from rail_msgs_py.stamps import NANOSECONDS, clock_from_cdr
from rail_msgs_py.standalone import run_node
from rail_msgs_py.table import TableWriter
from rail_msgs_py.topics.tick import CLOCK
from rail_msgs_py.topics.train_bus import BUS_LINK, BUS_RX, BUS_TX
from rail_msgs_py.waveform import Waveform, silence
from rail_signals.train_bus.frame import BusFrameFormat
from rail_signals.train_bus.receiver import NOT_FOUND, BusFrameReceiver

from .message import PAYLOAD_BYTES
from .terminal import OTHER, BusTerminal

_CLOCK, _BUS = "clock", "bus"


@dataclass(frozen=True)
class BusTerminalParameters:
    """Parameters of a terminal."""

    end: str = parameter("head", "end of the train it is at: head or tail")
    bit_rate_hz: float = parameter(1e6, "bits per second", unit="Hz", low=1e3, high=1e8)
    samples_per_bit: int = parameter(8, "samples of a bit, an even number", low=4, high=64)
    rise_time_s: float = parameter(
        150e-9, "rise time of the driver's edges", unit="s", low=0.0, high=1e-3
    )
    longest_delay_s: float = parameter(
        10e-6, "latest start of a frame within a block", unit="s", low=0.0, high=1e-3
    )
    answer_timeout_s: float = parameter(
        2.0, "age at which the word of the other end counts no more", unit="s", low=0.0, high=600.0
    )
    medium: str = parameter("/world/bus_medium", "full name of the node that carries the frames")
    tick_s: float = parameter(0.25, "time of a tick", unit="s", low=0.01, high=1.0)
    timeout_s: float = parameter(
        2.0, "wall time after which the medium is given up", unit="s", low=0.05, high=3600.0
    )


class BusTerminalNode(Equipment):
    """A terminal as a managed node; switched off it neither speaks nor listens."""

    def __init__(
        self,
        name: str = "bus_head",
        *,
        namespace: str = "/train_1",
        context: Any = None,
        parameters: Mapping[str, Any] | None = None,
        services: bool = True,
    ) -> None:
        super().__init__(name, namespace, context=context, parameters=parameters, services=services)
        self._p = p = declare(self, BusTerminalParameters)
        if p.end not in OTHER:
            raise ParameterError(f"{name}: end: {p.end}: must be head or tail")
        try:
            self._frame = BusFrameFormat(
                PAYLOAD_BYTES, p.bit_rate_hz, p.samples_per_bit, p.rise_time_s
            )
            self._receiver = BusFrameReceiver(self._frame, p.longest_delay_s)
        except ValueError as error:
            raise ParameterError(f"{name}: {error}") from None
        self._tick_ns = round(p.tick_s * NANOSECONDS)
        self._other = OTHER[p.end]  # type: ignore[index]
        self._terminal = BusTerminal(p.end, p.tick_s, p.answer_timeout_s)  # type: ignore[arg-type]
        train = namespace.strip("/")
        self._inbox: TickInbox[NDArray[np.float64] | None] = TickInbox([_CLOCK, _BUS])
        self._inbox.put(0, _BUS, None)
        self._watch = TickWatch(self, self._inbox, {_BUS: p.medium}, p.timeout_s, self._advance)
        self._send = self.stream_out(BUS_TX, train=train, end=p.end)
        self._link = self.publisher(BUS_LINK, train=train, end=p.end).publish
        self._table = TableWriter((train,), BUS_LINK.columns)
        self.stream_in(BUS_RX, self._on_block, train=train, end=p.end)
        self.stream_in(CLOCK, self._on_clock)
        self.announce_when_connected()

    def _on_clock(self, raw: bytes) -> None:
        self._inbox.put(clock_from_cdr(raw), _CLOCK, None)
        self._watch.begin()
        self._advance()

    def _on_block(self, raw: bytes) -> None:
        block = Waveform.from_cdr(raw)
        self._take(block.stamp_ns, None if block.silent else block.row.real)
        # What was heard in a tick is answered in the next.
        self._inbox.put(block.stamp_ns + self._tick_ns, _BUS, None)
        self._advance()

    def _take(self, stamp_ns: int, samples: NDArray[np.float64] | None) -> None:
        tick = stamp_ns // self._tick_ns
        if self.switched_on:
            found = NOT_FOUND if samples is None else self._receiver.receive(samples)
            self._terminal.take(tick, found)
        figures = np.array([self._terminal.figures(tick)])
        self._link(self._table.write(stamp_ns, figures))
        self._tell(stamp_ns, tick)

    def _tell(self, stamp_ns: int, tick: int) -> None:
        terminal = self._terminal
        if not (terminal.is_confirmed(tick) or terminal.lost or terminal.age_s(tick) < inf):
            level, text = DiagnosticStatus.OK, f"waits for the {self._other}"
        elif not terminal.is_confirmed(tick):
            level, text = DiagnosticStatus.ERROR, f"the {self._other} is not heard"
        elif terminal.loses(tick):
            level, text = DiagnosticStatus.WARN, f"loses messages of the {self._other}"
        else:
            level, text = DiagnosticStatus.OK, f"hears the {self._other}"
        values = [("sent", str(terminal.sent)), ("lost", str(terminal.lost))]
        self.report(level, "train bus", text, values, stamp_ns=stamp_ns)

    def _advance(self) -> None:
        while self._inbox.complete:
            self._watch.end()
            stamp_ns, _ = self._inbox.take()
            self._speak(stamp_ns)

    def _speak(self, stamp_ns: int) -> None:
        rate_hz = self._frame.sample_rate_hz
        if not self.switched_on:
            self._send(silence(stamp_ns, rate_hz, 0.0, 0).to_cdr())
            return
        wave = self._frame.waveform(self._terminal.payload(stamp_ns // self._tick_ns))
        self._send(Waveform(stamp_ns, rate_hz, 0.0, 0, wave[None].astype(np.complex128)).to_cdr())


def main() -> None:
    """Run a terminal on its own."""
    run_node(BusTerminalNode)


if __name__ == "__main__":
    main()

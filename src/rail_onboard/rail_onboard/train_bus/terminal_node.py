"""Terminal of the train bus at one end of a train: messages to frames, and frames to messages.

Topics in: ``/clock``, ``rx``. Topics out: ``tx``, ``link``.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from numpy.typing import NDArray

from rail_msgs_py.decoders import block
from rail_msgs_py.parameters import ParameterError, parameter
from rail_msgs_py.quantities import GIVE_UP, TICK
from rail_msgs_py.stamps import NANOSECONDS
from rail_msgs_py.tick_node import EquipmentNode
from rail_msgs_py.topics.train_bus import BUS_LINK, BUS_RX, BUS_TX
from rail_msgs_py.train_bus import quantities
from rail_msgs_py.waveform import Waveform, silence
from rail_signals.train_bus.frame import BusFrameFormat
from rail_signals.train_bus.receiver import NOT_DETECTED, BusFrameReceiver

from .message import PAYLOAD_BYTES, End
from .terminal import OTHER, BusTerminal


@dataclass(frozen=True)
class BusTerminalParameters:
    """Parameters of a terminal."""

    end: str = parameter("head", "end of the train it is at: head or tail")
    bit_rate_hz: float = quantities.BIT_RATE.parameter()
    samples_per_bit: int = quantities.SAMPLES_PER_BIT.parameter()
    rise_time_s: float = quantities.RISE_TIME.parameter()
    longest_delay_s: float = parameter(
        10e-6, "latest start of a frame within a block", unit="s", low=0.0, high=1e-3
    )
    answer_timeout_s: float = quantities.ANSWER_TIMEOUT.parameter()
    medium: str = parameter("/world/bus_medium", "full name of the node that carries the frames")
    protected: bool = parameter(
        False, "whether train protection waits to hear that the train is whole"
    )
    tick_s: float = TICK.parameter()
    timeout_s: float = GIVE_UP.parameter()


class BusTerminalNode(EquipmentNode[BusTerminalParameters], name="bus_head", namespace="/train_1"):
    """A terminal as a managed node; switched off it neither speaks nor listens."""

    #: Those of the kind, until its own have been declared.
    _p = BusTerminalParameters()

    @property
    def listed_name(self) -> str:
        """Full name under which the table of topics has this terminal."""
        return f"/{self.place}/bus_{self._p.end}"

    def setup(self) -> None:
        """Open the ports of its end of the train."""
        p, train = self._p, self.place
        if p.end not in OTHER:
            raise ParameterError(f"end: {p.end}: must be head or tail")
        self._end: End = p.end
        self._other = OTHER[p.end]
        self._frame = BusFrameFormat(PAYLOAD_BYTES, p.bit_rate_hz, p.samples_per_bit, p.rise_time_s)
        self._receiver = BusFrameReceiver(self._frame, p.longest_delay_s)
        self._tick_ns = round(p.tick_s * NANOSECONDS)
        # What was received in a tick is answered in the next.
        self._answer = self.inputs.internal_port("bus", p.medium, delay_ns=self._tick_ns)
        self._send = self.stream_out(BUS_TX, train=train, end=p.end)
        self._link = self.table_out(BUS_LINK, (train,), awaited=p.protected, train=train, end=p.end)
        self.blocks_in(BUS_RX, block, self._on_block, train=train, end=p.end)
        self.inputs.clock()

    def start_over(self) -> None:
        """Have received nothing of the other end."""
        self._terminal = BusTerminal(self._end, self._p.tick_s, self._p.answer_timeout_s)

    def _on_block(self, stamp_ns: int, received: Waveform | None) -> None:
        self._take(stamp_ns, None if received is None else received.row.real)
        self._answer(stamp_ns, None)

    def _take(self, stamp_ns: int, samples: NDArray[np.float64] | None) -> None:
        tick = stamp_ns // self._tick_ns
        if self.switched_on:
            frame = NOT_DETECTED if samples is None else self._receiver.receive(samples)
            self._terminal.take(tick, frame)
        self._link(stamp_ns, np.array([self._terminal.link_values(tick)]))
        self._report_link(stamp_ns, tick)

    def _report_link(self, stamp_ns: int, tick: int) -> None:
        terminal = self._terminal
        if not (terminal.is_confirmed(tick) or terminal.lost or terminal.age_s(tick) < inf):
            level, text = DiagnosticStatus.OK, f"waits for the {self._other}"
        elif not terminal.is_confirmed(tick):
            level, text = DiagnosticStatus.ERROR, f"the {self._other} is not received"
        elif terminal.loses(tick):
            level, text = DiagnosticStatus.WARN, f"loses messages of the {self._other}"
        else:
            level, text = DiagnosticStatus.OK, f"hears the {self._other}"
        values = [("sent", str(terminal.sent)), ("lost", str(terminal.lost))]
        self.report(level, "train bus", text, values, stamp_ns=stamp_ns)

    def on_tick(self, stamp_ns: int, items: dict[str, Any]) -> None:
        """Send the message of the tick."""
        rate_hz = self._frame.sample_rate_hz
        if not self.switched_on:
            self._send(silence(stamp_ns, rate_hz, 0.0, 0))
            return
        wave = self._frame.waveform(self._terminal.payload(stamp_ns // self._tick_ns))
        self._send(Waveform(stamp_ns, rate_hz, 0.0, 0, wave[None].astype(np.complex128)))


if __name__ == "__main__":
    BusTerminalNode.main()

"""One track circuit: senses whether it is occupied, and sends a code for the train in it.

Topics in: ``/clock``, ``relay_end``, ``occupancy`` of the circuits ahead. Topics out: ``feed_end``,
``message``, ``occupancy``.

What a circuit has sensed in one tick reaches those behind it in the next; until it does, and
wherever it does not, they take it to be occupied.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus

from rail_msgs_py.failures import TickWatch
from rail_msgs_py.inbox import TickInbox
from rail_msgs_py.node import Equipment
from rail_msgs_py.parameters import ParameterError, declare, parameter
from rail_msgs_py.stamps import NANOSECONDS, clock_from_cdr
from rail_msgs_py.standalone import run_node
from rail_msgs_py.table import TableWriter, figures_from_cdr
from rail_msgs_py.topics.tick import CLOCK
from rail_msgs_py.topics.track_code import CIRCUIT_RX, CIRCUIT_TX, CODE_SENT, OCCUPANCY
from rail_msgs_py.waveform import Waveform, silence, silent_stamp_ns
from rail_signals.ranging.band_level import band_levels_db
from rail_signals.track_code.profile import load_profile, profile_names
from rail_signals.track_code.signal import FmTransmitter
from rail_signals.track_code.word import as_number, encode

from .code_logic import Block, CodeLogic

_CLOCK_PORT = "clock"
#: A shunted circuit is this far below the level of a clear one at least [dB].
OCCUPIED_BELOW_DB = 12.0


@dataclass(frozen=True)
class TrackCodeTransmitterParameters:
    """Parameters of a track circuit; arrays: the circuit itself, then those ahead of it."""

    profile: str = parameter("tones27", "profile of the code")
    carrier_hz: float = parameter(1700.0, "carrier", unit="Hz", low=1.0)
    sample_rate_hz: float = parameter(16_000.0, "sample rate in the rails", unit="Hz", low=128.0)
    tick_s: float = parameter(0.1, "time of one tick", unit="s", low=0.01, high=1.0)
    ahead: tuple[str, ...] = parameter((), "circuits ahead, the nearest first")
    lengths_m: tuple[float, ...] = parameter((500.0,), "lengths", unit="m", low=1.0)
    limits_mps: tuple[float, ...] = parameter((20.0,), "speed limits", unit="m/s", low=0.0)
    gradients_permil: tuple[float, ...] = parameter(
        (0.0,), "steepest falls, negative downhill", unit="permil"
    )
    braking_mps2: float = parameter(
        0.5, "braking the code counts on", unit="m/s^2", low=0.05, high=5.0
    )
    clear_level_db: float = parameter(
        0.0, "level at the receiving end while the circuit is clear", unit="dB"
    )
    timeout_s: float = parameter(
        2.0, "wall time after which an occupancy is given up", unit="s", low=0.05, high=3600.0
    )


class TrackCodeTransmitterNode(Equipment):
    """A track circuit as a managed node."""

    def __init__(
        self,
        name: str = "track_code",
        *,
        namespace: str = "/wayside/tc1",
        context: Any = None,
        parameters: Mapping[str, Any] | None = None,
        services: bool = True,
    ) -> None:
        super().__init__(name, namespace, context=context, parameters=parameters, services=services)
        self._p = p = declare(self, TrackCodeTransmitterParameters)
        self._check_parameters()
        self._circuit = namespace.rpartition("/")[2]
        profile = load_profile(p.profile)
        self._profile = profile
        self._tick_ns = round(p.tick_s * NANOSECONDS)
        self._samples = round(p.sample_rate_hz * p.tick_s)
        self._transmitter = FmTransmitter(profile, p.carrier_hz, p.sample_rate_hz)
        self._logic = CodeLogic(
            [
                Block(*row)
                for row in zip(p.lengths_m, p.limits_mps, p.gradients_permil, strict=True)
            ],
            braking_mps2=p.braking_mps2,
        )
        row = (self._circuit,)
        self._send = self.stream_out(CIRCUIT_TX, circuit=self._circuit)
        self._tell = self.publisher(CODE_SENT, circuit=self._circuit).publish
        self._tell_table = TableWriter(row, CODE_SENT.columns)
        self._sense = self.publisher(OCCUPANCY, circuit=self._circuit).publish
        self._sense_table = TableWriter(row, OCCUPANCY.columns)
        self._inbox: TickInbox[bool | None] = TickInbox([_CLOCK_PORT, *p.ahead])
        for circuit in p.ahead:
            self._inbox.put(0, circuit, None)
            self.stream_in(
                OCCUPANCY,
                lambda raw, circuit=circuit: self._on_occupancy(circuit, raw),
                circuit=circuit,
            )
        owners = {c: OCCUPANCY.owner(circuit=c) for c in p.ahead}
        self._watch = TickWatch(self, self._inbox, owners, self._p.timeout_s, self._advance)
        self.stream_in(CIRCUIT_RX, self._on_block, circuit=self._circuit)
        self.stream_in(CLOCK, self._on_clock)
        self.announce_when_connected()

    def _check_parameters(self) -> None:
        p, name = self._p, self.get_name()
        if p.profile not in profile_names():
            raise ParameterError(
                f"{name}: profile: {p.profile}: is none of {', '.join(profile_names())}"
            )
        counts = {len(p.lengths_m), len(p.limits_mps), len(p.gradients_permil), 1 + len(p.ahead)}
        if len(counts) != 1:
            raise ParameterError(
                f"{name}: ahead: {p.ahead}: each needs a length, a limit and a gradient"
            )

    def _on_clock(self, raw: bytes) -> None:
        self._inbox.put(clock_from_cdr(raw), _CLOCK_PORT, None)
        self._watch.begin()
        self._advance()

    def _on_occupancy(self, circuit: str, raw: bytes) -> None:
        stamp_ns, figures = figures_from_cdr(raw, 1, len(OCCUPANCY.columns))
        self._inbox.put(stamp_ns + self._tick_ns, circuit, bool(figures[0, 0]))
        self._advance()

    def _advance(self) -> None:
        while self._inbox.complete:
            self._watch.end()
            self._transmit(*self._inbox.take())

    def _transmit(self, stamp_ns: int, items: dict[str, bool | None]) -> None:
        if not self.switched_on:
            self._send(silence(stamp_ns, self._p.sample_rate_hz, 0.0, 0).to_cdr())
            self._tell(self._tell_table.write(stamp_ns, np.full((1, 5), np.nan)))
            return
        fields = self._logic.fields([items.get(circuit) for circuit in self._p.ahead])
        bits = encode(self._profile, fields)
        samples = self._transmitter.block(bits, self._samples)
        rate_hz = self._p.sample_rate_hz
        self._send(
            Waveform(stamp_ns, rate_hz, 0.0, 0, samples[None].astype(np.complex128)).to_cdr()
        )
        figures = [float(as_number(bits)), *(fields[name] for name in CODE_SENT.columns[1:])]
        self._tell(self._tell_table.write(stamp_ns, np.array([figures], dtype=np.float64)))

    def _on_block(self, raw: bytes) -> None:
        stamp_ns = silent_stamp_ns(raw)
        level_db = -math.inf
        if stamp_ns is None:
            block = Waveform.from_cdr(raw)
            stamp_ns = block.stamp_ns
            (level_db,) = band_levels_db(
                block.row.real, (self._p.carrier_hz,), self._p.sample_rate_hz
            )
        occupied = not level_db > self._p.clear_level_db - OCCUPIED_BELOW_DB
        self._sense(
            self._sense_table.write(stamp_ns, np.array([[float(occupied), max(level_db, -300.0)]]))
        )
        self.report(
            DiagnosticStatus.OK,
            "occupancy",
            "occupied" if occupied else "clear",
            stamp_ns=stamp_ns,
        )


def main() -> None:
    """Run a track circuit on its own."""
    run_node(TrackCodeTransmitterNode)


if __name__ == "__main__":
    main()

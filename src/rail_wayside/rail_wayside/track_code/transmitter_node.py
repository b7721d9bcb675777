"""One track circuit: senses whether it is occupied, and sends a code for the train in it.

Topics in: ``/clock``, ``relay_end``, ``occupancy`` of the circuit behind and of those ahead. Topics
out: ``feed_end``, ``message``, ``occupancy``.

What a circuit has sensed in one tick reaches its neighbours in the next; until it does, and
wherever it does not, they take it to be occupied. Switched on it knows nothing: it is occupied
until its own code has been recognised for `PICK_UP_S`, and holds no train.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus

from rail_msgs_py.decoders import block, table_row
from rail_msgs_py.parameters import ParameterError, parameter
from rail_msgs_py.quantities import GIVE_UP, TICK
from rail_msgs_py.stamps import NANOSECONDS
from rail_msgs_py.tick_node import EquipmentNode
from rail_msgs_py.topics.track_code import CIRCUIT_RX, CIRCUIT_TX, CODE_SENT, OCCUPANCY
from rail_msgs_py.track_code import quantities
from rail_msgs_py.waveform import Waveform, silence
from rail_signals.arrays import FloatArray
from rail_signals.track_code.profile import load_profile, profile_names
from rail_signals.track_code.scales import CodeScales
from rail_signals.track_code.signal import FmTransmitter
from rail_signals.track_code.word import as_number, encode

from .code_logic import Block, CodeLogic
from .detector import TrackDetector
from .sequence import CircuitState, SequenceHold

#: Level that stands for none [dB].
_NO_LEVEL_DB = -300.0
#: What is said of a circuit that is switched off: occupied, and nothing else.
_OFF = [1.0 if name in ("occupied", "detected") else 0.0 for name in OCCUPANCY.columns]
_OFF[OCCUPANCY.index["level_db"]] = math.nan
_FLAGS = ("occupied", "detected", "holds", "shunted", "missing", "found")


@dataclass(frozen=True)
class TrackCodeTransmitterParameters:
    """Parameters of a track circuit; arrays: the circuit itself, then those ahead of it."""

    profile: str = quantities.PROFILE.parameter()
    carrier_hz: float = quantities.CARRIER.parameter()
    sample_rate_hz: float = quantities.SAMPLE_RATE.parameter()
    tick_s: float = TICK.parameter()
    ahead: tuple[str, ...] = parameter((), "circuits ahead, the nearest first")
    behind: str = parameter("", "circuit behind; empty = none")
    leaves: bool = parameter(False, "whether trains can leave the line in the circuit")
    identity: int = quantities.IDENTITY.parameter()
    speeds_kmh: tuple[float, ...] = quantities.SPEEDS.parameter()
    lengths_m: tuple[float, ...] = quantities.LENGTHS.parameter()
    limits_mps: tuple[float, ...] = parameter((20.0,), "speed limits", unit="m/s", low=0.0)
    gradients_permil: tuple[float, ...] = parameter(
        (0.0,), "steepest falls, negative downhill", unit="permil"
    )
    braking_mps2: float = quantities.BRAKING.parameter()
    clear_level_db: float = parameter(
        0.0, "level at the receiving end while the circuit is clear", unit="dB"
    )
    timeout_s: float = GIVE_UP.parameter()


class TrackCodeTransmitterNode(
    EquipmentNode[TrackCodeTransmitterParameters], name="track_code", namespace="/wayside/tc1"
):
    """A track circuit as a managed node."""

    def setup(self) -> None:
        """Open the ports of the circuit itself, and of those ahead."""
        p, circuit = self._p, self.place
        self._check_parameters()
        self._profile = load_profile(p.profile)
        self._samples = round(p.sample_rate_hz * p.tick_s)
        blocks = zip(p.lengths_m, p.limits_mps, p.gradients_permil, strict=True)
        self._logic = CodeLogic(
            [Block(*row) for row in blocks],
            braking_mps2=p.braking_mps2,
            network=p.identity,
            scales=CodeScales(speeds_kmh=p.speeds_kmh),
        )
        self._send = self.stream_out(CIRCUIT_TX, circuit=circuit)
        self._report_code = self.table_out(CODE_SENT, (circuit,), circuit=circuit)
        self._sense = self.table_out(OCCUPANCY, (circuit,), circuit=circuit)
        tick_ns = round(p.tick_s * NANOSECONDS)
        self._ahead = [
            self.inputs.port(OCCUPANCY, table_row(OCCUPANCY), delay_ns=tick_ns, circuit=ahead)
            for ahead in p.ahead
        ]
        self._behind = (
            self.inputs.port(OCCUPANCY, table_row(OCCUPANCY), delay_ns=tick_ns, circuit=p.behind)
            if p.behind
            else ""
        )
        self.blocks_in(CIRCUIT_RX, block, self._on_block, circuit=circuit)
        self.inputs.clock()

    def start_over(self) -> None:
        """Begin the code anew, occupied until the circuit is proven clear."""
        p = self._p
        self._transmitter = FmTransmitter(self._profile, p.carrier_hz, p.sample_rate_hz)
        self._detector = TrackDetector(p.clear_level_db, p.carrier_hz, p.sample_rate_hz, p.tick_s)
        self._hold = SequenceHold(p.tick_s, leaves=p.leaves, first=not p.behind)
        # Stamp and samples of the last block fed in; what was said of the neighbours then.
        self._sent: tuple[int, FloatArray] | None = None
        self._neighbours: tuple[CircuitState | None, Sequence[CircuitState | None]] = (
            None,
            [None] * len(p.ahead),
        )

    def _check_parameters(self) -> None:
        p = self._p
        if p.profile not in profile_names():
            raise ParameterError(
                f"profile: {p.profile}: is not one of {', '.join(profile_names())}"
            )
        counts = {len(p.lengths_m), len(p.limits_mps), len(p.gradients_permil), 1 + len(p.ahead)}
        if len(counts) != 1:
            raise ParameterError(f"ahead: {p.ahead}: each needs a length, a limit and a gradient")

    def on_tick(self, stamp_ns: int, items: dict[str, Any]) -> None:
        """Send the code for what is ahead."""
        rate_hz = self._p.sample_rate_hz
        ahead = [_state(items.get(port)) for port in self._ahead]
        self._neighbours = _state(items.get(self._behind)), ahead
        if not self.switched_on:
            self._sent = None
            self._send(silence(stamp_ns, rate_hz, 0.0, 0))
            self._report_code(stamp_ns, np.full((1, 5), np.nan))
            return
        fields = self._logic.fields([None if each is None else each.occupied for each in ahead])
        bits = encode(self._profile, fields)
        samples = self._transmitter.block(bits, self._samples)
        self._sent = stamp_ns, samples
        self._send(Waveform(stamp_ns, rate_hz, 0.0, 0, samples[None].astype(np.complex128)))
        values = [float(as_number(bits)), *(fields[name] for name in CODE_SENT.columns[1:])]
        self._report_code(stamp_ns, np.array([values], dtype=np.float64))

    def _on_block(self, stamp_ns: int, received: Waveform | None) -> None:
        sent = None
        if self._sent is not None and self._sent[0] == stamp_ns:
            sent = self._sent[1]
        arrived = None if received is None else np.ascontiguousarray(received.row.real)
        detection = self._detector.update(sent, arrived)
        behind, ahead = self._neighbours
        state = self._hold.update(
            detected=detection.occupied,
            shunted=detection.shunted,
            behind=behind,
            ahead=ahead,
        )
        row = [
            float(state.occupied),
            max(detection.level_db, _NO_LEVEL_DB),
            float(state.detected),
            float(state.holds),
            detection.coherence,
            float(state.shunted),
            float(state.missing),
            float(state.found),
        ]
        if not self.switched_on:
            row = _OFF
        self._sense(stamp_ns, np.array([row]))
        self.report(
            DiagnosticStatus.OK,
            "occupancy",
            "occupied" if state.detected else "holds a train" if state.holds else "clear",
            stamp_ns=stamp_ns,
        )


def _state(row: Any) -> CircuitState | None:
    """What a circuit said of itself; None if nothing was received, or it is switched off."""
    if row is None or np.isnan(row[OCCUPANCY.index["level_db"]]):
        return None
    return CircuitState(**{name: bool(row[OCCUPANCY.index[name]]) for name in _FLAGS})


if __name__ == "__main__":
    TrackCodeTransmitterNode.main()

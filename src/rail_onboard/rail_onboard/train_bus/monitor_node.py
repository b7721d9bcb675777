"""Monitor of the train bus: a reflectometer at the head, and what it makes of the echoes.

Topics in: ``/clock``, ``rx``. Topics out: ``tx``, ``state``, ``trace``, ``verdicts``, ``trend``.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import nan
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from numpy.typing import NDArray

from rail_msgs_py.decoders import samples
from rail_msgs_py.parameters import ParameterError, parameter
from rail_msgs_py.quantities import GIVE_UP, TICK
from rail_msgs_py.stamps import NANOSECONDS
from rail_msgs_py.table import Table
from rail_msgs_py.tick_node import EquipmentNode
from rail_msgs_py.topics.train_bus import (
    BUS_STATE,
    BUS_TRACE,
    BUS_TREND,
    BUS_VERDICTS,
    REFLECTOMETER_RX,
    REFLECTOMETER_TX,
)
from rail_msgs_py.train_bus import quantities
from rail_msgs_py.waveform import Waveform, silence
from rail_signals.arrays import ComplexArray
from rail_signals.train_bus.faults import KINDS
from rail_signals.train_bus.tdr.interpretation import Interpretation, interpret
from rail_signals.train_bus.tdr.measured_trace import step_edge
from rail_signals.train_bus.tdr.reflectometer import Reflectogram, Reflectometer
from rail_signals.train_bus.tdr.verdict import RunMeasurement, judge, judge_train
from rail_signals.train_bus.train import train_consist, train_profiles

from .cable_watch import BusWatch, TraceReading

_LEVELS = (DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR)


@dataclass(frozen=True)
class TrainBusMonitorParameters:
    """Parameters of a monitor."""

    cars: tuple[str, ...] = quantities.CARS.parameter()
    period_s: float = quantities.PERIOD.parameter()
    offset_s: float = parameter(0.0, "time of the first", unit="s", low=0.0, high=1e6)
    traces: int = quantities.TRACES.parameter()
    rise_time_s: float = quantities.REFLECTOMETER_RISE.parameter()
    noise_rms: float = quantities.REFLECTOMETER_NOISE.parameter()
    false_alarm_rate: float = parameter(
        1e-6, "fraction of healthy measurements that may look faulty", low=1e-12, high=0.1
    )
    medium: str = parameter("/world/bus_medium", "full name of the node that carries the edges")
    tick_s: float = TICK.parameter()
    timeout_s: float = GIVE_UP.parameter()


class TrainBusMonitorNode(
    EquipmentNode[TrainBusMonitorParameters], name="train_bus_monitor", namespace="/train_1"
):
    """A monitor as a managed node; switched off it does not measure."""

    def setup(self) -> None:
        """Draw the bus as built, choose the edge, and open the ports of the head."""
        p, train = self._p, self.place
        try:
            self._profiles = list(train_profiles(p.cars))
            self._consist = train_consist(p.cars)
        except ValueError as error:
            raise ParameterError(f"cars: {error}") from None
        self._instrument = Reflectometer(
            reference_ohm=self._consist.termination.resistance_ohm,
            rise_time_s=p.rise_time_s,
            sample_period_s=p.rise_time_s / 4.0,
            noise_rms=p.noise_rms,
        )
        length = self._instrument.samples_for(self._consist.bus_line().delay_s)
        self._time_s = self._instrument.grid(length).time_s
        edge = step_edge(self._time_s, p.rise_time_s)
        self._edges = np.tile(edge, (p.traces, 1)).astype(np.complex128)
        self._tick_ns = round(p.tick_s * NANOSECONDS)
        # What was seen in a tick decides on measuring in the next.
        self._is_seen = self.inputs.internal_port("bus", p.medium, delay_ns=self._tick_ns)
        self._send = self.stream_out(REFLECTOMETER_TX, train=train)
        self._state = self.table_out(BUS_STATE, (train,), train=train)
        self._trace = self.publisher(BUS_TRACE, train=train)
        self._verdicts = self.publisher(BUS_VERDICTS, train=train)
        self._trend = self.publisher(BUS_TREND, train=train)
        self.blocks_in(REFLECTOMETER_RX, samples, self._on_block, train=train)
        self.inputs.clock()

    def start_over(self) -> None:
        """Have measured nothing."""
        self._watch_over = BusWatch(self._read)
        self._level = 0
        self._due_ns = round(self._p.offset_s * NANOSECONDS)

    def _read(self, traces: Reflectogram) -> TraceReading:
        rate = self._p.false_alarm_rate
        return interpret(traces, self._consist, self._instrument, rate)

    # Measuring ----------------------------------------------------------------------------

    def on_tick(self, stamp_ns: int, items: dict[str, Any]) -> None:
        """Send edges if it is time to, or if what was seen last is in doubt."""
        due = stamp_ns >= self._due_ns
        if due:
            period_ns = max(round(self._p.period_s * NANOSECONDS), self._tick_ns)
            self._due_ns += period_ns * (1 + (stamp_ns - self._due_ns) // period_ns)
        rate_hz = 1.0 / self._instrument.sample_period_s
        if self.switched_on and (due or self._watch_over.is_in_doubt):
            block = Waveform(stamp_ns, rate_hz, 0.0, 0, self._edges)
        else:
            block = silence(stamp_ns, rate_hz, 0.0, 0)
        self._send(block)

    # Understanding ------------------------------------------------------------------------

    def _on_block(self, stamp_ns: int, received: ComplexArray | None) -> None:
        if self.switched_on and received is not None:
            self._understand(stamp_ns, np.ascontiguousarray(received.real))
        self._state(stamp_ns, self._values())
        self._is_seen(stamp_ns, None)

    def _understand(self, stamp_ns: int, rows: NDArray[np.float64]) -> None:
        watch = self._watch_over
        try:
            traces = Reflectogram(self._time_s, rows)
        except ValueError as error:
            self.report(DiagnosticStatus.WARN, "measurement", str(error), stamp_ns=stamp_ns)
            return
        self.report(DiagnosticStatus.OK, "measurement", "usable", stamp_ns=stamp_ns)
        is_read = watch.take(stamp_ns * 1e-9, traces)
        rate_hz = 1.0 / self._instrument.sample_period_s
        mean = rows.mean(axis=0, keepdims=True).astype(np.complex128)
        self._trace.publish(Waveform(stamp_ns, rate_hz, 0.0, 0, mean).to_msg())
        if is_read:
            self._report_cable(stamp_ns)

    def _report_cable(self, stamp_ns: int) -> None:
        """Say what has been understood anew."""
        watch = self._watch_over
        reading, held = watch.reading, watch.held
        if watch.is_in_doubt or not isinstance(reading, Interpretation):
            return
        verdicts = judge_train(reading, self._consist, self._profiles)
        rows = tuple(f"car_{number}" for number in range(1, len(verdicts) + 1))
        values = [[*_values_of(v.measurement), v.status == "pass"] for v in verdicts]
        table = Table(stamp_ns, rows, BUS_VERDICTS.columns, np.array(values, dtype=np.float64))
        self._verdicts.publish(table.to_msg())
        # A fault that can be measured is not yet one that the criteria forbid.
        failed = [
            f"car {number} {reason}"
            for number, (verdict, profile) in enumerate(
                zip(verdicts, self._profiles, strict=True), start=1
            )
            for reason in judge(verdict.measurement, profile).reasons
        ]
        self._level = 2 if failed else 0 if held is None else 1
        text = "the bus is as drawn" if held is None else held.words()
        if failed:
            text += f"; {failed[0]}"
        cells = [] if held is None else [("growth_per_s", f"{watch.growth_per_s():.3g}")]
        self.report(_LEVELS[self._level], "bus cable", text, cells, stamp_ns=stamp_ns)
        if held is not None:
            self._publish_trend(stamp_ns)

    def _publish_trend(self, stamp_ns: int) -> None:
        """What was found from the first time on."""
        trend = self._watch_over.trend
        rows = tuple(f"found_{number}" for number in range(1, len(trend) + 1))
        values = [
            [seen.time_s, 1.0 + KINDS.index(seen.kind), seen.place_m, seen.size] for seen in trend
        ]
        table = Table(stamp_ns, rows, BUS_TREND.columns, np.array(values, dtype=np.float64))
        self._trend.publish(table.to_msg())

    def _values(self) -> NDArray[np.float64]:
        """State as `BUS_STATE.columns`."""
        watch, held = self._watch_over, self._watch_over.held
        fault = (0.0, nan, nan, nan)
        if held is not None:
            kind = 1.0 + KINDS.index(held.kind)
            fault = (kind, held.place_m, held.place_std_m, held.size)
        counts = (watch.measurements, watch.interpretations, self._level)
        return np.array([[*counts, *fault, watch.growth_per_s()]], dtype=np.float64)


def _values_of(measurement: RunMeasurement) -> tuple[float, float, float]:
    """Length, impedance and attenuation, NaN where no wave came back from."""
    values = (measurement.length_m, measurement.impedance_ohm, measurement.attenuation_db)
    length_m, impedance_ohm, attenuation_db = (nan if x is None else x for x in values)
    return length_m, impedance_ohm, attenuation_db


if __name__ == "__main__":
    TrainBusMonitorNode.main()

"""The evaluator: counts the axles in every section, and says which sections are free.

Topics in: ``/clock``, every detection point's ``passages``, ``reset``. Topics out: ``sections``,
``~/done``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus

from axle_counter import quantities
from axle_counter.signals.axle_detector import Passages
from axle_counter.signals.section_counter import Occupancy, Reset, Section, SectionCounter
from axle_counter.topics import PASSAGES, RESET, SECTIONS
from rail_msgs_py.decoders import table_row
from rail_msgs_py.headers import header_to_cdr
from rail_msgs_py.parameters import ParameterError, parameter
from rail_msgs_py.quantities import GIVE_UP
from rail_msgs_py.tick_node import EquipmentNode
from rail_msgs_py.topics.tick import DONE


@dataclass(frozen=True)
class EvaluatorParameters:
    """Parameters of an evaluator; arrays of `border_*` go together, and those of `reset_*`."""

    sections: tuple[str, ...] = parameter((), "sections, as the report lists them")
    border_sections: tuple[str, ...] = parameter((), "section of each border")
    border_points: tuple[str, ...] = parameter((), "detection point at each border")
    border_inward: tuple[int, ...] = parameter(
        (), "+1 where axles pass the point forward to enter, else -1", low=-1, high=1
    )
    reset: str = quantities.RESET.parameter()
    reset_sections: tuple[str, ...] = parameter((), "sections that are reset at a known time")
    reset_times_s: tuple[float, ...] = parameter((), "when each of them is", unit="s", low=0.0)
    empty_at_start: tuple[str, ...] = parameter(
        (), "sections seen to be empty when the run begins; in service in its first tick"
    )
    timeout_s: float = GIVE_UP.parameter()


class AxleEvaluatorNode(
    EquipmentNode[EvaluatorParameters], name="axle_counter", namespace="/wayside"
):
    """The evaluator as a managed node."""

    def setup(self) -> None:
        """Open the ports of all points."""
        p = self._p
        self._sections = self._read_sections()
        points = sorted(set(p.border_points))
        self._ports = {
            point: self.inputs.port(PASSAGES, table_row(PASSAGES), point=point) for point in points
        }
        self.inputs.clock()
        self._asked: list[str] = []
        self.listen(RESET, lambda message: self._asked.append(message.data))
        self._publish = self.table_out(SECTIONS, p.sections)
        self._done = self.stream_out(DONE, node=self.get_fully_qualified_name())
        self._now_s = -1.0

    def _read_sections(self) -> list[Section]:
        p = self._p
        for group in ("border_points", "border_inward"):
            if len(getattr(p, group)) != len(p.border_sections):
                raise ParameterError(f"{group}: does not go with border_sections")
        if len(p.reset_times_s) != len(p.reset_sections):
            raise ParameterError("reset_times_s: does not go with reset_sections")
        for group in ("border_sections", "reset_sections", "empty_at_start"):
            for name in getattr(p, group):
                if name not in p.sections:
                    raise ParameterError(f"{group}: {name}: there is no such section")
        rows = list(zip(p.border_sections, p.border_points, p.border_inward, strict=True))
        return [
            Section(name, {point: inward for section, point, inward in rows if section == name})
            for name in p.sections
        ]

    def start_over(self) -> None:
        """Know nothing of any section."""
        self._counters = {each.name: SectionCounter(each) for each in self._sections}
        self._asked.clear()

    def on_tick(self, stamp_ns: int, items: dict[str, Any]) -> None:
        """Count what has passed, and tell what is free."""
        before_s, self._now_s = self._now_s, 1e-9 * stamp_ns
        counters = self._counters.values()
        if self.switched_on:
            seen = {
                point: _passages(items[port])
                for point, port in self._ports.items()
                if items.get(port) is not None
            }
            for counter in counters:
                counter.update(seen)
            self._reset(before_s, stamp_ns)
            values = [(float(each.occupancy), float(each.axles)) for each in counters]
        else:
            values = [(float(Occupancy.NOT_KNOWN), np.nan)] * len(counters)
        self._publish(stamp_ns, np.array(values, dtype=np.float64).reshape(-1, 2))
        self._done(header_to_cdr(stamp_ns))

    def _reset(self, before_s: float, stamp_ns: int) -> None:
        """Carry out the resets that fall into this tick."""
        p = self._p
        if stamp_ns == 0:
            for name in p.empty_at_start:
                self._counters[name].reset(Reset.CONDITIONAL)
        due = [
            name
            for name, at_s in zip(p.reset_sections, p.reset_times_s, strict=True)
            if before_s < at_s <= self._now_s
        ]
        for name in (*due, *self._asked):
            counter = self._counters.get(name)
            accepted = counter is not None and counter.reset(Reset(p.reset))
            self.report(
                DiagnosticStatus.OK if accepted else DiagnosticStatus.WARN,
                f"reset of {name}",
                f"{'accepted' if accepted else 'refused'} at {self._now_s:.1f} s",
                stamp_ns=stamp_ns,
            )
        self._asked.clear()


def _passages(row: list[float]) -> Passages:
    forward, backward, unclear, busy, valid = row
    return Passages(int(forward), int(backward), int(unclear), busy=busy > 0, valid=valid > 0)


if __name__ == "__main__":
    AxleEvaluatorNode.main()

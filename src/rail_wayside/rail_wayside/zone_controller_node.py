"""Zone controller: turns the ranges of all stations into positions of all trains.

With base stations it also gives movement authorities, from reports and ranges (`AuthorityDesk`).

Topics in: ``/clock``, every ``range``, every base station's ``telegrams`` or, with ``backbone``,
its ``uplink_telegrams``. Topics out: ``~/<train>/position``, ``~/<train>/reports``,
``~/<train>/authority``, ``~/<base>/telegrams``, ``~/done``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from operator import attrgetter
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus

from rail_msgs_py.failures import TickWatch
from rail_msgs_py.headers import header_to_cdr
from rail_msgs_py.inbox import TickInbox
from rail_msgs_py.node import CorridorNode
from rail_msgs_py.parameters import ParameterError, declare, parameter
from rail_msgs_py.position import Position, PositionWriter
from rail_msgs_py.ranging.range_reading import range_from_cdr
from rail_msgs_py.stamps import clock_from_cdr
from rail_msgs_py.standalone import run_node
from rail_msgs_py.table import TableWriter
from rail_msgs_py.topics.ranging import POSITION, RANGE
from rail_msgs_py.topics.tick import CLOCK, DONE
from rail_msgs_py.topics.train_radio import (
    AUTHORITY,
    BACKBONE,
    BACKBONE_UP,
    DOWN_TELEGRAMS,
    REPORTS,
    UP_TELEGRAMS,
)
from rail_msgs_py.train_radio.telegrams import Telegrams, telegrams
from rail_wayside.ranging.train_tracker import NOT_HEARD, Fix, Reading, ZoneTracker
from rail_wayside.ranging.zone_map import Zone, ZoneMap
from rail_wayside.train_radio.authority_issuer import Taken
from rail_wayside.train_radio.parameters import AuthorityParameters, desk_of

_CLOCK_PORT = "clock"
_fields = attrgetter(*REPORTS.columns[1:])


@dataclass(frozen=True)
class ZoneControllerParameters(AuthorityParameters):
    """Parameters of the zone controller; arrays over the zones unless said otherwise."""

    zones: tuple[str, ...] = parameter((), "names of the zones")
    sites: tuple[str, ...] = parameter((), "station that looks into each zone")
    tracks: tuple[str, ...] = parameter((), "track of each zone")
    starts_m: tuple[float, ...] = parameter((), "chainage of each zone's start", unit="m")
    ends_m: tuple[float, ...] = parameter((), "chainage of each zone's end", unit="m")
    follows_from: tuple[str, ...] = parameter((), "zones at whose end another begins, by pair")
    follows_to: tuple[str, ...] = parameter((), "zones that begin there, by pair")
    table_sizes: tuple[int, ...] = parameter((), "points of each zone's table", low=2)
    table_chainage_m: tuple[float, ...] = parameter(
        (), "chainages of the tables, one zone after the other", unit="m"
    )
    table_distance_m: tuple[float, ...] = parameter(
        (), "distances from mast to train antenna at these chainages", unit="m"
    )
    trains: tuple[str, ...] = parameter((), "trains, in the order they enter the line")
    entry_zones: tuple[str, ...] = parameter((), "zone where each train is first seen")
    timeout_s: float = parameter(
        3.0, "wall time after which a reading is given up", unit="s", low=0.05, high=3600.0
    )


def zone_map_of(p: ZoneControllerParameters) -> ZoneMap:
    """Zones and their order from the flat parameters.

    Raises
    ------
    ParameterError
        If the arrays do not fit together.
    """
    count = len(p.zones)
    for name in ("sites", "tracks", "starts_m", "ends_m", "table_sizes"):
        if len(getattr(p, name)) != count:
            raise ParameterError(f"{name}: {len(getattr(p, name))} entries for {count} zones")
    total = sum(p.table_sizes)
    if not len(p.table_chainage_m) == len(p.table_distance_m) == total:
        raise ParameterError(f"table_chainage_m: {len(p.table_chainage_m)} points, not {total}")
    following: dict[str, list[str]] = {}
    for before, after in zip(p.follows_from, p.follows_to, strict=True):
        following.setdefault(before, []).append(after)
    cuts = np.cumsum(p.table_sizes)[:-1]
    chainages = np.split(np.asarray(p.table_chainage_m), cuts)
    distances = np.split(np.asarray(p.table_distance_m), cuts)
    zones = [
        Zone(*row)
        for row in zip(
            p.zones, p.sites, p.tracks, p.starts_m, p.ends_m, chainages, distances, strict=True
        )
    ]
    return ZoneMap(zones, following)


class ZoneControllerNode(CorridorNode):
    """The zone controller as a node."""

    def __init__(
        self,
        *,
        namespace: str = "/wayside",
        context: Any = None,
        parameters: Mapping[str, Any] | None = None,
        services: bool = True,
    ) -> None:
        super().__init__(
            "zone_controller", namespace, context=context, parameters=parameters, services=services
        )
        self._p = declare(self, ZoneControllerParameters)
        zone_map = zone_map_of(self._p)
        trains = list(zip(self._p.trains, self._p.entry_zones, strict=True))
        self._tracker = ZoneTracker(zone_map, trains)
        self._positions = {
            name: self.publisher(POSITION, train=name).publish for name in self._p.trains
        }
        self._writers: dict[tuple[str, str], PositionWriter] = {}
        owners = {zone.name: f"/wayside/{zone.site}" for zone in zone_map.zones.values()}
        owners |= self._open_desk()
        # The clock is a port like the others: a tick ends though no station answers.
        self._inbox: TickInbox[Any] = TickInbox([*owners, _CLOCK_PORT])
        self._watch = TickWatch(self, self._inbox, owners, self._p.timeout_s, self._advance)
        for zone in zone_map.zones.values():
            self.stream_in(
                RANGE,
                lambda raw, zone=zone.name: self._on_range(zone, raw),
                site=zone.site,
                zone=zone.name,
            )
        self.stream_in(CLOCK, self._on_clock)
        self._done = self.stream_out(DONE, node=self.get_fully_qualified_name())
        self.announce_when_connected()

    def _open_desk(self) -> dict[str, str]:
        """Begin to speak with trains; ports of the base stations and who sends there."""
        p = self._p
        self._desk = desk_of(p)
        self._segments = {name: number for number, name in enumerate(p.segments)}
        # Without a desk there are no numbers.
        self._numbers = dict(zip(p.trains, p.train_numbers, strict=False))
        self._told = {
            train: self.publisher(AUTHORITY, train=train).publish
            for train in (p.trains if self._desk else ())
        }
        self._told_tables = {
            train: TableWriter((train,), AUTHORITY.columns) for train in self._told
        }
        self._taken = {train: self.publisher(REPORTS, train=train).publish for train in self._told}
        self._down = {base: self.stream_out(DOWN_TELEGRAMS, base=base) for base in p.bases}
        heard = BACKBONE_UP if p.backbone else UP_TELEGRAMS
        for base in p.bases:
            self.stream_in(heard, lambda raw, base=base: self._on_telegrams(base, raw), base=base)
        return {
            _port(base): BACKBONE if p.backbone else UP_TELEGRAMS.owner(base=base)
            for base in p.bases
        }

    def _on_telegrams(self, base: str, raw: bytes) -> None:
        heard = Telegrams.from_cdr(raw)
        self._inbox.put(heard.stamp_ns, _port(base), heard)
        self._advance()

    def _on_clock(self, raw: bytes) -> None:
        self._inbox.put(clock_from_cdr(raw), _CLOCK_PORT, None)
        self._watch.begin()
        self._advance()

    def _on_range(self, zone: str, raw: bytes) -> None:
        stamp_ns, range_m, variance_m2 = range_from_cdr(raw)
        heard = range_m != math.inf
        self._inbox.put(stamp_ns, zone, Reading(range_m, variance_m2) if heard else NOT_HEARD)
        self._advance()

    def _advance(self) -> None:
        while self._inbox.complete:
            self._tick_over()

    def _tick_over(self) -> None:
        stamp_ns, readings = self._inbox.take()
        self._watch.end()
        fixes = self._tracker.update(
            stamp_ns * 1e-9,
            {zone: reading for zone, reading in readings.items() if isinstance(reading, Reading)},
        )
        for fix in fixes:
            self._publish(stamp_ns, fix)
        self._authorise(stamp_ns, fixes, readings)
        self._report_zones(stamp_ns)
        self._done(header_to_cdr(stamp_ns))

    def _authorise(
        self, stamp_ns: int, fixes: Iterable[Fix], heard: Mapping[str, Telegrams | Reading | None]
    ) -> None:
        """Take the trains' reports of a tick, and give authorities for the next one."""
        desk, p = self._desk, self._p
        if desk is None:
            return
        taken: dict[int, list[Taken]] = {}
        for base in p.bases:
            batch = heard.get(_port(base))
            for slot, frame in batch.frames if isinstance(batch, Telegrams) else ():
                if (report := desk.receive(base, slot, frame, stamp_ns)) is not None:
                    taken.setdefault(slot, []).append(report)
        numbers = self._numbers
        for train, tell in self._taken.items():
            tell(_reports(stamp_ns, taken.get(numbers[train], ())))
        for fix in fixes:
            segment = self._segments.get(fix.track)
            if segment is not None:
                place = (segment, fix.chainage_m, fix.variance_m2)
                desk.ranged(numbers[fix.train], stamp_ns * 1e-9, *place)
        for base, frames in desk.telegrams(stamp_ns).items():
            self._down[base](telegrams(stamp_ns, frames))
        for train, publish in self._told.items():
            figures = np.array([desk.given(numbers[train], stamp_ns)], dtype=np.float64)
            publish(self._told_tables[train].write(stamp_ns, figures))
            trouble = desk.troubles(numbers[train])
            self.report(
                DiagnosticStatus.WARN if trouble else DiagnosticStatus.OK,
                f"{train} authority",
                trouble or "as it should be",
                stamp_ns=stamp_ns,
            )

    def _publish(self, stamp_ns: int, fix: Fix) -> None:
        key = (fix.train, fix.track)
        if key not in self._writers:
            self._writers[key] = PositionWriter(*key)
        position = Position(
            stamp_ns,
            fix.train,
            fix.track,
            fix.chainage_m,
            fix.variance_m2,
            fix.speed_mps,
            fix.speed_variance_m2ps2,
        )
        self._positions[fix.train](self._writers[key].write(position))
        level = DiagnosticStatus.WARN if fix.reason else DiagnosticStatus.OK
        self.report(level, fix.train, fix.reason or "position known", stamp_ns=stamp_ns)

    def _report_zones(self, stamp_ns: int) -> None:
        unknown = ", ".join(self._tracker.unidentified)
        self.report(
            DiagnosticStatus.WARN if unknown else DiagnosticStatus.OK,
            "train describer",
            f"unidentified train in {unknown}" if unknown else "every train is identified",
            stamp_ns=stamp_ns,
        )


@cache
def _reports_table(count: int) -> TableWriter:
    rows = tuple(str(row) for row in range(1, count + 1))
    return TableWriter(rows, REPORTS.columns)


def _reports(stamp_ns: int, taken: Sequence[Taken]) -> bytes:
    """Table of the reports taken from a train in a tick."""
    figures = [(sealed_s, *_fields(report)) for sealed_s, report in taken]
    values = np.array(figures, dtype=np.float64).reshape(len(taken), len(REPORTS.columns))
    return _reports_table(len(taken)).write(stamp_ns, values)


def _port(base: str) -> str:
    """Port of what a base station has received; zones are ports too."""
    return f"{base}/telegrams"


def main() -> None:
    """Run the zone controller on its own."""
    run_node(ZoneControllerNode)


if __name__ == "__main__":
    main()

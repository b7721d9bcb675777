"""Zone controller: turns the ranges of all stations into positions of all trains.

With base stations it also gives movement authorities, from reports and ranges (`AuthorityIssuer`).

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
from typing import Any, Final

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus

from rail_msgs_py.decoders import stamped
from rail_msgs_py.delivery import ViewDecoder
from rail_msgs_py.headers import header_to_cdr
from rail_msgs_py.parameters import ParameterError, parameter
from rail_msgs_py.position import Position, PositionWriter
from rail_msgs_py.quantities import GIVE_UP
from rail_msgs_py.ranging.range_reading import RangeView, range_from_cdr
from rail_msgs_py.table import TableWriter
from rail_msgs_py.tick_node import EquipmentNode
from rail_msgs_py.topics.ranging import POSITION, RANGE
from rail_msgs_py.topics.tick import DONE
from rail_msgs_py.topics.train_radio import (
    AUTHORITY,
    BACKBONE_UP,
    DOWN_TELEGRAMS,
    REPORTS,
    UP_TELEGRAMS,
)
from rail_msgs_py.train_radio.telegrams import Telegrams, telegrams
from rail_wayside.ranging.train_tracker import (
    NO_READING,
    Reported,
    TrainFix,
    ZoneReading,
    ZoneTracker,
)
from rail_wayside.ranging.zone_map import MappedZone, ZoneMap
from rail_wayside.train_radio.authority_issuer import AcceptedReport
from rail_wayside.train_radio.parameters import AuthorityParameters, authority_issuer_of

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
    timeout_s: float = GIVE_UP.but(default=3.0).parameter()


def zone_map_of(p: ZoneControllerParameters) -> ZoneMap:
    """Zones and their order from the flat parameters.

    Raises
    ------
    ParameterError
        If the arrays do not fit together.
    """
    count = len(p.zones)
    if count == 0:
        raise ParameterError("zones: (): at least one is needed")
    for name in ("sites", "tracks", "starts_m", "ends_m", "table_sizes"):
        if len(getattr(p, name)) != count:
            raise ParameterError(f"{name}: {len(getattr(p, name))} entries for {count} zones")
    for name, other in (("follows_to", "follows_from"), ("entry_zones", "trains")):
        if len(getattr(p, name)) != len(getattr(p, other)):
            raise ParameterError(f"{name}: {getattr(p, name)}: does not go with {other}")
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
        MappedZone(*row)
        for row in zip(
            p.zones, p.sites, p.tracks, p.starts_m, p.ends_m, chainages, distances, strict=True
        )
    ]
    return ZoneMap(zones, following)


class ZoneControllerNode(
    EquipmentNode[ZoneControllerParameters], name="zone_controller", namespace="/wayside"
):
    """The zone controller as a managed node; switched off it knows no train and says nothing."""

    def setup(self) -> None:
        """Open the ports of all stations and base stations."""
        p = self._p
        self._map = zone_map = zone_map_of(p)
        self._positions = {name: self.publisher(POSITION, train=name).send for name in p.trains}
        self._writers: dict[tuple[str, str], PositionWriter] = {}
        # In the order of their names, so that sums over them are repeatable.
        self._zone_ports = {
            name: self.inputs.port(RANGE, _READING, site=zone.site, zone=name)
            for name, zone in sorted(zone_map.zones.items())
        }
        self._open_radio()
        # The clock is a port like the others: a tick ends though no station answers.
        self.inputs.clock()
        self._done = self.stream_out(DONE, node=self.get_fully_qualified_name())

    def start_over(self) -> None:
        """Have seen no train, and have spoken with none."""
        p = self._p
        self._tracker = ZoneTracker(self._map, list(zip(p.trains, p.entry_zones, strict=True)))
        self._issuer = authority_issuer_of(p)

    def _open_radio(self) -> None:
        """Open the ports of all base stations."""
        p = self._p
        self._segments = {name: number for number, name in enumerate(p.segments)}
        # Without a desk there are no numbers.
        self._numbers = dict(zip(p.trains, p.train_numbers, strict=False))
        trains = p.trains if p.bases else ()
        self._authorities = {
            train: self.table_out(AUTHORITY, (train,), train=train) for train in trains
        }
        self._reports = {train: self.publisher(REPORTS, train=train).publish for train in trains}
        self._down = {base: self.stream_out(DOWN_TELEGRAMS, base=base) for base in p.bases}
        topic = BACKBONE_UP if p.backbone else UP_TELEGRAMS
        self._base_ports = {
            base: self.inputs.port(topic, stamped(Telegrams.from_cdr), base=base)
            for base in p.bases
        }

    def on_tick(self, stamp_ns: int, items: dict[str, Any]) -> None:
        """Locate the trains, and give them authorities."""
        if not self.switched_on:
            self._keep_silent(stamp_ns)
            return
        readings = {zone: items[port] for zone, port in self._zone_ports.items() if port in items}
        time_s, issuer = stamp_ns * 1e-9, self._issuer
        fixes = self._tracker.update(time_s, readings, self._reported(time_s))
        if issuer is not None and self._tracker.restarted:
            issuer.sweep(time_s, self._clear(readings))
        for fix in fixes:
            self._publish(stamp_ns, fix)
        self._authorise(stamp_ns, fixes, items)
        self._report_zones(stamp_ns)
        self._done(header_to_cdr(stamp_ns))

    def _reported(self, time_s: float) -> dict[str, Reported]:
        """Where trains are by radio, for a tracker that knows no train."""
        if self._issuer is None:
            return {}
        names = {number: train for train, number in self._numbers.items()}
        return {
            names[number]: Reported(self._p.segments[segment], low_m, high_m)
            for number, (segment, low_m, high_m) in self._issuer.whereabouts(time_s).items()
        }

    def _clear(self, readings: Mapping[str, ZoneReading]) -> dict[int, bool]:
        """For each track whether all its zones were read, and every reading is a train's."""
        doubtful = {*self._tracker.unidentified, *self._tracker.disturbed}
        return {
            number: all(
                name in readings and name not in doubtful
                for name, zone in self._map.zones.items()
                if zone.track == track
            )
            for track, number in self._segments.items()
        }

    def _keep_silent(self, stamp_ns: int) -> None:
        """Answer a tick in which it is switched off."""
        zones = self._map.zones
        for train, zone in zip(self._p.trains, self._p.entry_zones, strict=True):
            track, start_m = zones[zone].track, zones[zone].start_m
            unknown = (track, start_m, math.inf, 0.0, math.inf, "switched off")
            self._publish(stamp_ns, TrainFix(train, zone, *unknown))
        for publish_reports in self._reports.values():
            publish_reports(_reports(stamp_ns, ()))
        for send in self._down.values():
            send(telegrams(stamp_ns))
        for publish in self._authorities.values():
            publish(stamp_ns, np.full((1, len(AUTHORITY.columns)), math.nan))
        self._done(header_to_cdr(stamp_ns))

    def _authorise(
        self, stamp_ns: int, fixes: Iterable[TrainFix], items: Mapping[str, Any]
    ) -> None:
        """Take the trains' reports of a tick, and give authorities for the next one."""
        issuer = self._issuer
        if issuer is None:
            return
        accepted: dict[int, list[AcceptedReport]] = {}
        for base, port in self._base_ports.items():
            for slot, frame in items[port].frames if port in items else ():
                if (report := issuer.receive(base, slot, frame, stamp_ns)) is not None:
                    accepted.setdefault(slot, []).append(report)
        numbers = self._numbers
        for train, publish_reports in self._reports.items():
            publish_reports(_reports(stamp_ns, accepted.get(numbers[train], ())))
        for fix in fixes:
            segment = self._segments.get(fix.track)
            if segment is not None:
                place = (segment, fix.chainage_m, fix.variance_m2)
                issuer.ranged(numbers[fix.train], stamp_ns * 1e-9, *place)
        for train, number in numbers.items():
            if number in issuer.gone:
                self._tracker.leave(train)
        for base, frames in issuer.telegrams(stamp_ns).items():
            self._down[base](telegrams(stamp_ns, frames))
        for train, publish in self._authorities.items():
            values = np.array([issuer.authority_state(numbers[train], stamp_ns)], dtype=np.float64)
            publish(stamp_ns, values)
            waits = issuer.waits_for(numbers[train], stamp_ns * 1e-9)
            trouble = waits or issuer.troubles(numbers[train])
            self.report(
                DiagnosticStatus.WARN if trouble else DiagnosticStatus.OK,
                f"{train} authority",
                trouble or "as it should be",
                stamp_ns=stamp_ns,
            )

    def _publish(self, stamp_ns: int, fix: TrainFix) -> None:
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


def _reports(stamp_ns: int, accepted: Sequence[AcceptedReport]) -> bytes:
    """Table of the reports taken from a train in a tick."""
    rows = [(sealed_s, *_fields(report)) for sealed_s, report in accepted]
    values = np.array(rows, dtype=np.float64).reshape(len(accepted), len(REPORTS.columns))
    return _reports_table(len(accepted)).write(stamp_ns, values)


def _reading(raw: bytes) -> tuple[int, ZoneReading]:
    stamp_ns, range_m, variance_m2 = range_from_cdr(raw)
    return stamp_ns, NO_READING if range_m == math.inf else ZoneReading(range_m, variance_m2)


def _reading_of_view(view: RangeView) -> tuple[int, ZoneReading]:
    stamp_ns, range_m, variance_m2, _ = view
    return stamp_ns, NO_READING if range_m == math.inf else ZoneReading(range_m, variance_m2)


_READING: Final = ViewDecoder(_reading, _reading_of_view)


if __name__ == "__main__":
    ZoneControllerNode.main()

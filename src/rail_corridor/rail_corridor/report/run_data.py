"""What a run said and what was true, tick by tick, as arrays."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

POSITION_COLUMNS = ("track_index", "chainage_m", "variance_m2", "speed_mps")
_FIRST_TICKS = 1024


class Record:
    """One table per tick, [tick, train or circuit, column]; NaN where nothing was received."""

    def __init__(self, rows: int, columns: int) -> None:
        self._values = np.full((_FIRST_TICKS, rows, columns), np.nan)
        self.columns = columns
        self.ticks = 0

    def put(self, tick: int, train: int | slice, values: FloatArray) -> None:
        """Store the row of one train, or the table of all of them."""
        while tick >= len(self._values):
            more = np.full_like(self._values, np.nan)
            self._values = np.concatenate((self._values, more))
        self._values[tick, train] = values
        self.ticks = max(self.ticks, tick + 1)

    def upto(self, ticks: int) -> FloatArray:
        """The first ticks, [tick, train, column]."""
        while ticks > len(self._values):
            self._values = np.concatenate((self._values, np.full_like(self._values, np.nan)))
        return self._values[:ticks]


class ReportsTaken:
    """Location reports that were taken from each train: any number in a tick."""

    def __init__(self, trains: int) -> None:
        self._rows: list[dict[int, FloatArray]] = [{} for _ in range(trains)]

    def put(self, tick: int, train: int, rows: FloatArray) -> None:
        """Store the reports [report, column] of one tick."""
        self._rows[train][tick] = rows

    def of(self, train: int, ticks: int) -> Iterator[tuple[int, FloatArray]]:
        """Tick and columns of each report of a train in the first ticks, as they were taken."""
        for tick, rows in sorted(self._rows[train].items()):
            for row in rows if tick < ticks else ():
                yield tick, row

    def have(self, tick: int) -> bool:
        """Whether those of a tick are here, of every train."""
        return all(tick in ticks for ticks in self._rows)


class Recording:
    """Truth, links, channels and positions of all trains.

    Parameters
    ----------
    trains, tracks : tuple of str
        Names, in the order of the scenario.
    channels : int
        Number of downlink channels.
    circuits : tuple of str
        Names of the track circuits, in the order of the scenario; with any, trains obey codes.
    cbtc : bool
        Whether trains obey authorities received by radio.
    threatened : bool
        Whether a backbone with threats carries their telegrams.
    references, localizer : bool
        Whether trains find their place by Doppler shifts, and from all sensors.
    buses : tuple of str
        Trains that have a train bus.
    """

    def __init__(
        self,
        trains: tuple[str, ...],
        tracks: tuple[str, ...],
        channels: int,
        circuits: tuple[str, ...] = (),
        *,
        cbtc: bool = False,
        threatened: bool = False,
        references: bool = False,
        localizer: bool = False,
        buses: tuple[str, ...] = (),
    ) -> None:
        from rail_msgs_py.topics.doppler import DOPPLER_FIX
        from rail_msgs_py.topics.localizer import LOCALIZER_STATE
        from rail_msgs_py.topics.ranging import LINKS
        from rail_msgs_py.topics.track_code import CODE_RECEIVED, CODE_SENT
        from rail_msgs_py.topics.train_bus import BUS_LINK, BUS_LINKS, BUS_STATE
        from rail_msgs_py.topics.train_radio import (
            ATP_STATE,
            AUTHORITY,
            CBTC_LINKS,
            RADIO_LINK,
            STRIKES,
        )
        from rail_msgs_py.topics.world import COMMAND, STATE

        self.trains = trains
        self.tracks = tracks
        self.circuits = circuits
        self.sent = Record(len(circuits), len(CODE_SENT.columns))
        self.received = Record(len(trains), len(CODE_RECEIVED.columns))
        self.command = Record(len(trains), len(COMMAND.columns))
        self.cbtc = cbtc
        self.atp = Record(len(trains), len(ATP_STATE.columns))
        self.authority = Record(len(trains), len(AUTHORITY.columns))
        self.radio = Record(len(trains), len(RADIO_LINK.columns))
        self.reports = ReportsTaken(len(trains) if cbtc else 0)
        self.threatened = threatened
        self.strikes = Record(1, len(STRIKES.columns))
        self.cbtc_links = Record(len(trains), len(CBTC_LINKS.columns))
        self.references, self.localizer = references, localizer
        self.doppler = Record(len(trains), len(DOPPLER_FIX.columns))
        self.located = Record(len(trains), len(LOCALIZER_STATE.columns))
        self.buses = buses
        self.bus_head = Record(len(buses), len(BUS_LINK.columns))
        self.bus_tail = Record(len(buses), len(BUS_LINK.columns))
        self.bus_state = Record(len(buses), len(BUS_STATE.columns))
        self.bus_links = Record(len(buses), len(BUS_LINKS.columns))
        self.state = Record(len(trains), len(STATE.columns))
        self.links = Record(len(trains), len(LINKS.columns))
        self.channel = Record(len(trains), 2 + channels)
        self.position = Record(len(trains), len(POSITION_COLUMNS))
        self._most_ticks: int | None = None

    @property
    def ticks(self) -> int:
        """Ticks whose truth has been received."""
        if self._most_ticks is None:
            return self.state.ticks
        return min(self.state.ticks, self._most_ticks)

    def end_at(self, ticks: int) -> None:
        """Leave out what came after so many ticks: a run that was stopped was amid a tick."""
        self._most_ticks = ticks

    @property
    def estimates(self) -> tuple[Record, ...]:
        """What the equipment on the trains and for them has made out."""
        records = [self.position, self.channel]
        if self.cbtc:
            records += [self.radio, self.atp, self.authority, self.command]
        elif self.circuits:
            records += [self.received, self.command]
        if self.references:
            records.append(self.doppler)
        if self.localizer:
            records.append(self.located)
        if self.buses:
            records += [self.bus_head, self.bus_tail, self.bus_state]
        return tuple(records)

    @property
    def missing_ticks(self) -> int:
        """Ticks of which any figure has not arrived; 0 when nothing is lost."""
        parts = [self.state, self.links, *self.estimates]
        parts += [self.strikes] if self.threatened else []
        if not self.trains:
            return 0
        gaps = [np.isnan(part.upto(self.ticks)[:, :, 0]).any(axis=1) for part in parts]
        gaps.append(np.array([not self.reports.have(tick) for tick in range(self.ticks)], bool))
        return int(np.count_nonzero(np.logical_or.reduce(gaps)))

    def digest(self) -> str:
        """SHA-256 of everything the equipment estimated, to the last bit."""
        total = hashlib.sha256()
        for record in self.estimates:
            values = np.ascontiguousarray(record.upto(self.ticks), dtype="<f8")
            # One bit pattern for every NaN.
            total.update(np.where(np.isnan(values), np.nan, values).tobytes())
        return total.hexdigest()

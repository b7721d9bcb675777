"""Runs made up tick by tick, and the report that the project makes of them.

A verdict is shown to count by a run in which it must say no. Such runs are built here and nowhere
else: what a test gives is the truth and what the equipment claimed, in metres and seconds; how a
recording keeps it, and which functions judge it, is known to this module alone. Every figure may
be one number for the whole run or an array over its ticks. What is not given is as it is in a
good run: a train that stands on its track, an authority far ahead, a position that is right.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rail_corridor.equipment.ranging.report import POSITION_COLUMNS
from rail_corridor.equipment.track_code.placement import circuits_of
from rail_corridor.equipment.train_bus.world import bus_trains
from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.plan import Plan, make_plan, run_data_of
from rail_corridor.report.report import make_report
from rail_corridor.run_data import Record, RunData
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.topics.doppler import DOPPLER_FIX
from rail_msgs_py.topics.localizer import LOCALIZER_STATE
from rail_msgs_py.topics.ranging import LINKS, POSITION, VRS_CHANNEL
from rail_msgs_py.topics.track_code import CODE_RECEIVED, CODE_SENT, OCCUPANCY
from rail_msgs_py.topics.train_bus import BUS_LINK, BUS_LINKS, BUS_STATE
from rail_msgs_py.topics.train_radio import ATP_STATE, AUTHORITY, CBTC_LINKS, RADIO_LINK, REPORTS
from rail_msgs_py.topics.world import COMMAND, STATE

#: Nothing of a good run comes near it [m].
FAR_M = 1e5


@cache
def built_in(name: str) -> Scenario:
    """Return a built-in scenario; it is not to be changed."""
    return load_scenario(name)


@cache
def _plan(name: str) -> Plan:
    with tempfile.TemporaryDirectory() as directory:
        return make_plan(built_in(name), Path(directory))


class RunBuilder:
    """A run of a built-in scenario.

    Parameters
    ----------
    name : str
        Of the scenario, which says what equipment there is.
    ticks : int
    """

    def __init__(self, name: str, ticks: int) -> None:
        self.scenario = scenario = built_in(name)
        self.plan = _plan(name)
        self.ticks, self.tick_s = ticks, scenario.tick_s
        self.trains = tuple(train.name for train in scenario.trains)
        self.tracks = tuple(scenario.tracks)
        self.circuits = tuple(circuit.name for circuit in circuits_of(scenario))
        self.buses = bus_trains(scenario)
        self._recording = run_data_of(scenario)
        self._channels = self._recording[VRS_CHANNEL].upto(1).shape[2] - 2
        self._good_run()

    # What a train does -------------------------------------------------------------------

    def moves(
        self,
        train: str,
        chainage_m: ArrayLike,
        speed_mps: ArrayLike = 0.0,
        *,
        track: str | None = None,
        path_m: ArrayLike | None = None,
        on_line: ArrayLike = 1.0,
    ) -> RunBuilder:
        """Where the front of a train truly is; on its first track along which path and chainage
        are the same unless told otherwise."""
        place = self.tracks.index(track or self._train(train).route[0])
        pose = self.scenario.network.tracks[self.tracks[place]].pose(
            np.broadcast_to(np.asarray(chainage_m, dtype=float), self.ticks)
        )
        self._put(
            self._recording[STATE],
            self.trains.index(train),
            STATE.columns,
            path_m=chainage_m if path_m is None else path_m,
            x_m=pose.x_m,
            y_m=pose.y_m,
            z_m=pose.z_m,
            heading_rad=pose.heading_rad,
            speed_mps=speed_mps,
            acceleration_mps2=0.0,
            track_index=float(place),
            chainage_m=chainage_m,
            on_line=on_line,
        )
        return self

    def commanded(
        self,
        train: str,
        permitted_mps: ArrayLike = math.inf,
        service_brake: ArrayLike = 0.0,
        emergency_brake: ArrayLike = 0.0,
    ) -> RunBuilder:
        """What supervision on board permitted and demanded."""
        self._put(
            self._recording[COMMAND],
            self.trains.index(train),
            COMMAND.columns,
            permitted_mps=permitted_mps,
            warning=0.0,
            service_brake=service_brake,
            emergency_brake=emergency_brake,
            traction_cut_off=0.0,
            on_sight=0.0,
        )
        return self

    # What is claimed of its place --------------------------------------------------------

    def ranged(
        self,
        train: str,
        chainage_m: ArrayLike,
        sigma_m: ArrayLike = 0.2,
        *,
        track: str | None = None,
        channel: ArrayLike = 1.0,
    ) -> RunBuilder:
        """Position by phase ranging; an infinite sigma makes it unknown, an unknown track -1."""
        name = track or self._train(train).route[0]
        place = self.tracks.index(name) if name in self.tracks else -1
        index = self.trains.index(train)
        variance_m2 = np.square(np.asarray(sigma_m, dtype=float))
        self._put(
            self._recording[POSITION],
            index,
            POSITION_COLUMNS,
            track_index=float(place),
            chainage_m=chainage_m,
            variance_m2=variance_m2,
            speed_mps=0.0,
        )
        columns = ("downlink", "uplink", *(f"level_{n}" for n in range(self._channels)))
        values = dict.fromkeys(columns, 0.0) | {"downlink": channel}
        self._put(self._recording[VRS_CHANNEL], index, columns, **values)
        return self

    def fixed(
        self, train: str, chainage_m: ArrayLike, sigma_m: ArrayLike = 0.5, reason: ArrayLike = 0.0
    ) -> RunBuilder:
        """Position by Doppler shifts; a reason other than 0 is why there is none."""
        self._put(
            self._recording[DOPPLER_FIX],
            self.trains.index(train),
            DOPPLER_FIX.columns,
            reason=reason,
            chainage_m=chainage_m,
            speed_mps=0.0,
            chainage_m2=np.square(np.asarray(sigma_m, dtype=float)),
            chainage_speed_m2ps=0.0,
            speed_m2ps2=0.01,
            tones=2.0,
            offset_hz=0.0,
        )
        return self

    def located(
        self,
        train: str,
        low_m: ArrayLike,
        high_m: ArrayLike,
        front_m: ArrayLike | None = None,
        status: ArrayLike = 2.0,
        excluded: ArrayLike = 0.0,
    ) -> RunBuilder:
        """Interval by all sensors; status 2 is protected, 1 unmonitored, 0 unavailable."""
        middle_m = 0.5 * (np.asarray(low_m) + np.asarray(high_m)) if front_m is None else front_m
        self._put(
            self._recording[LOCALIZER_STATE],
            self.trains.index(train),
            LOCALIZER_STATE.columns,
            status=status,
            reason=0.0,
            found=0.0,
            excluded=excluded,
            front_m=middle_m,
            low_m=low_m,
            high_m=high_m,
            speed_mps=0.0,
            speed_low_mps=-1.0,
            speed_high_mps=1.0,
            fastest_mps=1.0,
            wheels_doubted=0.0,
            sigma_m=0.5,
        )
        return self

    def believed(
        self,
        train: str,
        front_m: ArrayLike,
        half_m: ArrayLike = 1.0,
        *,
        end_m: ArrayLike = FAR_M,
        age_s: ArrayLike = 0.0,
        accepted: ArrayLike = 0.0,
        lost: ArrayLike = 0.0,
        rejected: ArrayLike = 0.0,
    ) -> RunBuilder:
        """What protection on board believed of its place and held as its authority."""
        self._put(
            self._recording[ATP_STATE],
            self.trains.index(train),
            ATP_STATE.columns,
            accepted=accepted,
            lost=lost,
            rejected=rejected,
            front_m=front_m,
            uncertainty_m=half_m,
            end_of_authority_m=end_m,
            authority_age_s=age_s,
            mode=0.0,
            odometer_doubted=0.0,
        )
        return self

    def silent_protection(self, train: str, from_tick: int) -> RunBuilder:
        """Protection on board has died: nothing is heard of it from a tick on."""
        silent = np.full(len(ATP_STATE.columns), np.nan)
        for tick in range(from_tick, self.ticks):
            self._recording[ATP_STATE].put(tick, self.trains.index(train), silent)
        return self

    # What is given and told --------------------------------------------------------------

    def given(self, train: str, end_m: ArrayLike = FAR_M) -> RunBuilder:
        """The authority that the zone controller gave to a train."""
        self._put(
            self._recording[AUTHORITY],
            self.trains.index(train),
            AUTHORITY.columns,
            **dict.fromkeys(AUTHORITY.columns, 0.0) | {"end_of_authority_m": end_m},
        )
        return self

    def rear_taken(self, train: str, rear_m: ArrayLike) -> RunBuilder:
        """Where the zone controller takes the rear of a train to be at the worst."""
        columns = dict.fromkeys(AUTHORITY.columns, 0.0)
        columns |= {"end_of_authority_m": FAR_M, "worst_rear_m": rear_m}
        self._put(
            self._recording[AUTHORITY], self.trains.index(train), AUTHORITY.columns, **columns
        )
        return self

    def reported(self, train: str, tick: int, **rows: float) -> RunBuilder:
        """A location report that the zone controller took: genuine but for the figures given."""
        index = self.trains.index(train)
        believed = self._recording[ATP_STATE].upto(self.ticks)[tick, index]
        row = dict.fromkeys(REPORTS.columns, 0.0)
        row |= {
            "sealed_s": tick * self.tick_s,
            "train": index + 1.0,
            "segment": float(self.tracks.index(self._train(train).route[0])),
            "offset_m": float(believed[ATP_STATE.index["front_m"]]),
            "direction": 1.0,
            "uncertainty_m": float(believed[ATP_STATE.index["uncertainty_m"]]),
            "length_m": self._train(train).vehicle.length_m,
            "integrity_confirmed": 1.0,
            "position_valid": 1.0,
        }
        values = np.array([list((row | rows).values())])
        self._recording.events(REPORTS).put(tick, index, values)
        return self

    def sent(self, circuit: str, word: ArrayLike, speed: ArrayLike = 0xFF) -> RunBuilder:
        """The word that a track circuit sends, and the speeds in it."""
        columns = dict.fromkeys(CODE_SENT.columns, 0.0) | {"word": word, "speed": speed}
        number = self.circuits.index(circuit)
        self._put(self._recording[CODE_SENT], number, CODE_SENT.columns, **columns)
        return self

    def sensed(self, circuit: str, occupied: ArrayLike) -> RunBuilder:
        """Whether a track circuit says that it is occupied."""
        columns = dict.fromkeys(OCCUPANCY.columns, 0.0) | {"occupied": occupied}
        number = self.circuits.index(circuit)
        self._put(self._recording[OCCUPANCY], number, OCCUPANCY.columns, **columns)
        return self

    def understood(self, train: str, word: ArrayLike, valid: ArrayLike = 1.0) -> RunBuilder:
        """The word that a train understood."""
        columns = dict.fromkeys(CODE_RECEIVED.columns, 0.0) | {"word": word, "valid": valid}
        index = self.trains.index(train)
        self._put(self._recording[CODE_RECEIVED], index, CODE_RECEIVED.columns, **columns)
        return self

    # The train bus -----------------------------------------------------------------------

    def bus(
        self,
        train: str,
        *,
        kind: ArrayLike = 0.0,
        place_m: ArrayLike = math.nan,
        lost: ArrayLike = 0.0,
        bit_errors: ArrayLike = 0.0,
    ) -> RunBuilder:
        """Frames lost at both ends, and the fault that the monitor holds to be there."""
        index = self.buses.index(train)
        link = dict.fromkeys(BUS_LINK.columns, 0.0) | {
            "lost": lost,
            "bit_errors": bit_errors,
            "bits": 100.0 * np.arange(1.0, self.ticks + 1.0),
            "other_end": 1.0,
        }
        for record in (self._recording[BUS_LINK, "head"], self._recording[BUS_LINK, "tail"]):
            self._put(record, index, BUS_LINK.columns, **link)
        level = np.where(np.asarray(kind) > 0.0, 1.0, 0.0)
        state = dict.fromkeys(BUS_STATE.columns, 0.0) | {
            "kind": kind,
            "level": level,
            "place_m": place_m,
        }
        self._put(self._recording[BUS_STATE], index, BUS_STATE.columns, **state)
        links = dict.fromkeys(BUS_LINKS.columns, 20.0)
        self._put(self._recording[BUS_LINKS], index, BUS_LINKS.columns, **links)
        return self

    # What the project makes of it --------------------------------------------------------

    @property
    def data(self) -> RunData:
        """Truth and claims of the run, for those who judge it."""
        return self._recording

    def report(self) -> dict[str, Any]:
        """The report of the run, as `rail run` makes it."""
        intake: Any = SimpleNamespace(
            recording=self._recording, first_tick_s=0.0, last_tick_s=1.0, failures=[], events=[]
        )
        return make_report(
            self.scenario, self.plan, intake, nodes=1, processes=1, interrupted=False
        )

    def train(self, train: str) -> dict[str, Any]:
        """The section of one train in the report."""
        section: dict[str, Any] = self.report()["trains"][train]
        return section

    # How a recording keeps it ------------------------------------------------------------

    def _train(self, name: str) -> Any:
        return self.scenario.trains[self.trains.index(name)]

    def _good_run(self) -> None:
        """Every train stands where it starts, and all that is claimed is true."""
        for index, train in enumerate(self.scenario.trains):
            at_m, name = train.start_m, train.name
            self.moves(name, at_m).ranged(name, at_m)
            if COMMAND in self._recording:
                self.commanded(name)
            if DOPPLER_FIX in self._recording:
                self.fixed(name, at_m)
            if LOCALIZER_STATE in self._recording:
                self.located(name, at_m - 1.0, at_m + 1.0)
            if self.circuits:
                self.understood(name, 0.0, valid=0.0)
            if ATP_STATE in self._recording:
                self.believed(name, at_m).given(name)
                radio = dict.fromkeys(RADIO_LINK.columns, 1.0)
                self._put(self._recording[RADIO_LINK], index, RADIO_LINK.columns, **radio)
                links = dict.fromkeys(CBTC_LINKS.columns, 100.0)
                self._put(self._recording[CBTC_LINKS], index, CBTC_LINKS.columns, **links)
            links = dict.fromkeys(LINKS.columns, 1000.0)
            self._put(self._recording[LINKS], index, LINKS.columns, **links)
        for number, circuit in enumerate(self.circuits):
            self.sent(circuit, 100.0 + number).sensed(circuit, 1.0)
        for name in self.buses:
            self.bus(name)

    def _put(self, record: Record, row: int, columns: Sequence[str], **rows: ArrayLike) -> None:
        """Put one row of every tick; each column has a figure, or an array over the ticks."""
        for tick, values in enumerate(self._rows(columns, rows)):
            record.put(tick, row, values)

    def _rows(self, columns: Sequence[str], values: dict[str, ArrayLike]) -> Iterator[Any]:
        table = [np.broadcast_to(np.asarray(values[name], float), self.ticks) for name in columns]
        yield from np.stack(table, axis=1)

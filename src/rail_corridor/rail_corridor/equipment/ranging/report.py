"""From a run to values: ranging against truth and bound, handovers; their table."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from rail_corridor.equipment.tables import metres, new_table, percent
from rail_corridor.run_data import RunData
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.topics.ranging import LINKS, POSITION, VRS_CHANNEL
from rail_msgs_py.topics.world import STATE
from rail_signals.arrays import FloatArray
from rail_signals.ranging.bounds import two_way_range_variance_bound

from .layout import Layout, Zone, layout_of
from .section import SIGNAL

#: Columns of a recorded position.
POSITION_COLUMNS = ("track_index", "chainage_m", "variance_m2", "speed_mps")
#: A handover must be done when the train is this far past the station, plus one tick of travel.
HANDOVER_DEPTH_M = 20.0
_MIN_SLOPE = 0.05
#: A position is misleading when it is off by more than so many sigma and one metre.
_MISLEADING_SIGMAS = 6.0
_MISLEADING_M = 1.0


@dataclass(frozen=True)
class _TrainRun:
    """The columns of one train, arrays over the ticks."""

    path_m: FloatArray
    track: FloatArray
    chainage_m: FloatArray
    speed_mps: FloatArray
    on_line: NDArray[np.bool_]


def train_metrics(scenario: Scenario, recording: RunData, index: int) -> dict[str, Any]:
    """Report section of one train."""
    run = _run_of(recording, index)
    zones, along_m = _places_of(layout_of(scenario), recording.tracks, run)
    channel = recording[VRS_CHANNEL].upto(recording.ticks)[:, index, 0]
    errors = _position_errors(scenario, recording, index, run, zones, along_m, channel)
    travelled_m = float(np.nansum(np.abs(np.diff(run.path_m)))) if run.path_m.size else 0.0
    return {
        "distance_m": travelled_m,
        "handovers": handovers(scenario, along_m, run.speed_mps, zones, channel),
        "phase_ranging": _ranging(recording, index, errors),
    }


@dataclass(frozen=True)
class PositionErrors:
    """Positions by phase ranging of one train, arrays over the ticks.

    ``error_m`` and ``bound_m2`` are NaN or infinite where there are none. Of the positions that are
    claimed to be ``known`` some are on a ``wrong_track``; ``usable`` ones are numbers, and on the
    train's own.
    """

    path_m: FloatArray
    on_line: NDArray[np.bool_]
    known: NDArray[np.bool_]
    wrong_track: NDArray[np.bool_]
    usable: NDArray[np.bool_]
    error_m: FloatArray
    bound_m2: FloatArray


def position_errors(scenario: Scenario, recording: RunData, index: int) -> PositionErrors:
    """Errors of the positions of one train, and what the links allow."""
    run = _run_of(recording, index)
    zones, along_m = _places_of(layout_of(scenario), recording.tracks, run)
    channel = recording[VRS_CHANNEL].upto(recording.ticks)[:, index, 0]
    return _position_errors(scenario, recording, index, run, zones, along_m, channel)


def _run_of(recording: RunData, index: int) -> _TrainRun:
    state = recording[STATE].upto(recording.ticks)[:, index]
    return _TrainRun(
        state[:, STATE.index["path_m"]],
        state[:, STATE.index["track_index"]],
        state[:, STATE.index["chainage_m"]],
        state[:, STATE.index["speed_mps"]],
        state[:, STATE.index["on_line"]] > 0.0,
    )


def _places_of(
    layout: Layout, tracks: tuple[str, ...], run: _TrainRun
) -> tuple[list[Zone | None], FloatArray]:
    """Zone that the train is in at each tick, and the chainage [tick] along that zone's track.

    There is none while the train is not on the line.
    """
    zones: list[Zone | None] = []
    along_m = np.full(run.chainage_m.size, np.nan)
    last: Zone | None = None
    for tick, chainage_m in enumerate(run.chainage_m):
        if not run.on_line[tick]:
            zones.append(None)
            continue
        name = tracks[int(run.track[tick])]
        along_m[tick] = chainage_m
        if last is None or last.track != name or not last.start_m <= chainage_m < last.end_m:
            last, along_m[tick] = layout.place_at(name, float(chainage_m))
        zones.append(last)
    return zones, along_m


def handovers(
    scenario: Scenario,
    chainage_m: FloatArray,
    speed_mps: FloatArray,
    zones: list[Zone | None],
    channel: FloatArray,
) -> dict[str, Any]:
    """Count handovers of one train.

    ``chainage_m`` [tick] is along the track of the zone the train is in.

    One is *expected* when the train has left a zone for another for good: when it is
    `HANDOVER_DEPTH_M` and one tick of travel inside. It is *made* if the transponder is on the
    channel of that zone by then, else *missed*. A change to a channel that belongs to no zone
    this close is *wrong*. ``furthest_m`` is the longest distance from the station between two zones
    at which the channel changed from one to the other, None if it never did.
    """
    expected = made = wrong = 0
    furthest_m: float | None = None
    confirmed: Zone | None = None
    before = 0.0
    for tick, zone in enumerate(zones):
        if zone is None:
            continue
        depth_m = HANDOVER_DEPTH_M + abs(speed_mps[tick]) * scenario.tick_s
        here = chainage_m[tick]
        in_force = channel[tick]
        if confirmed is None:
            confirmed = zone
        elif zone is not confirmed and zone.downlink_channel != confirmed.downlink_channel:
            inside_m = here - zone.start_m
            if zone.track == confirmed.track:
                inside_m = min(inside_m, zone.end_m - here)
            elif confirmed.previous == zone.name:  # back from the branch
                inside_m = zone.end_m - here
            if inside_m >= depth_m:
                expected += 1
                made += int(in_force == zone.downlink_channel)
                confirmed = zone
        elif zone is not confirmed:
            confirmed = zone
        if in_force > 0.0 and before > 0.0 and in_force != before:
            near = _zones_near(layout_of(scenario), zone, here, depth_m)
            wrong += int(in_force not in {z.downlink_channel for z in near})
            away_m = min(here - zone.start_m, zone.end_m - here)
            furthest_m = max(away_m, furthest_m or 0.0)
        if in_force > 0.0:
            before = in_force
    return {
        "expected": expected,
        "made": made,
        "missed": expected - made,
        "wrong": wrong,
        "furthest_m": _finite_or_none(furthest_m) if furthest_m is not None else None,
    }


def _zones_near(layout: Layout, zone: Zone, chainage_m: float, depth_m: float) -> list[Zone]:
    near = [zone]
    if chainage_m - zone.start_m < depth_m and zone.previous is not None:
        near.append(layout.zone(zone.previous))
    if zone.end_m - chainage_m < depth_m:
        near.extend(layout.zone(name) for name in zone.next)
    return near


def _position_errors(
    scenario: Scenario,
    recording: RunData,
    index: int,
    run: _TrainRun,
    zones: list[Zone | None],
    along_m: FloatArray,
    channel: FloatArray,
) -> PositionErrors:
    position = recording[POSITION].upto(recording.ticks)[:, index]
    links = recording[LINKS].upto(recording.ticks)[:, index]
    known = run.on_line & np.isfinite(position[:, 2])
    route = scenario.network.route(
        list(scenario.trains[index].route), scenario.trains[index].direction
    )
    offsets = np.full(len(recording.tracks), np.nan)
    for leg in route.legs:
        offsets[recording.tracks.index(leg.track.name)] = leg.path_start_m
    track = np.where(known, position[:, 0], 0.0).astype(int)
    error_m = offsets[track] + position[:, 1] - run.path_m
    # A track that nobody knows is -1.
    wrong_track = known & ((track < 0) | np.isnan(offsets[track]))
    numbers = known & np.isfinite(position[:, 1])
    for tick in np.flatnonzero(numbers & ~wrong_track & (track != run.track)):
        name = recording.tracks[track[tick]]
        claimed, true = layout_of(scenario).zone_at(name, float(position[tick, 1])), zones[tick]
        assert true is not None
        depth_m = HANDOVER_DEPTH_M + abs(run.speed_mps[tick]) * scenario.tick_s
        wrong_track[tick] = claimed.track != true.track and not _meet(
            claimed, true, along_m[tick] - true.start_m < depth_m
        )
    bound_m2 = _bound_m2(scenario, recording, index, run, zones, channel, links)
    usable = numbers & ~wrong_track
    return PositionErrors(run.path_m, run.on_line, known, wrong_track, usable, error_m, bound_m2)


def _ranging(recording: RunData, index: int, errors: PositionErrors) -> dict[str, Any]:
    """Position by phase ranging against the truth and against what the links allow."""
    variance_m2 = recording[POSITION].upto(recording.ticks)[:, index, 2]
    error_m, usable, known = errors.error_m, errors.usable, errors.known
    with np.errstate(invalid="ignore"):
        bounded = usable & np.isfinite(errors.bound_m2)
        normalised = error_m[usable] ** 2 / variance_m2[usable]
        allowed_m = _MISLEADING_M + _MISLEADING_SIGMAS * np.sqrt(variance_m2)
        misleading = known & ~(usable & (np.abs(error_m) <= allowed_m))
    return {
        "availability": _ratio(int(np.count_nonzero(known)), int(np.count_nonzero(errors.on_line))),
        "rmse_m": _rms(error_m[usable]),
        "bound_m": _root_mean(errors.bound_m2[bounded]),
        "p95_m": _finite_or_none(np.quantile(np.abs(error_m[usable]), 0.95))
        if usable.any()
        else None,
        "max_m": _finite_or_none(np.max(np.abs(error_m[usable]))) if usable.any() else None,
        "normalised_error": _root_mean(normalised),
        "wrong_track_ticks": int(np.count_nonzero(errors.wrong_track)),
        "misleading_ticks": int(np.count_nonzero(misleading)),
    }


def _meet(claimed: Zone, true: Zone, at_station: bool) -> bool:
    """Whether a place in one zone may be told as one in another without being on a wrong track.

    One begins where the other ends; or both begin at the station of a junction, and the train
    may not have changed to its own yet.
    """
    if claimed.name in true.next or true.name in claimed.next:
        return True
    return at_station and claimed.station == true.station


def _bound_m2(
    scenario: Scenario,
    recording: RunData,
    index: int,
    run: _TrainRun,
    zones: list[Zone | None],
    channel: FloatArray,
    links: FloatArray,
) -> FloatArray:
    """Cramér-Rao bound of the chainage at each tick: that of the range over its slope."""
    signal = SIGNAL.of(scenario).signal
    down, up = links[:, LINKS.index["snr_down"]], links[:, LINKS.index["snr_up"]]
    received = (down > 0.0) & (up > 0.0)
    bound = np.full(len(down), np.inf)
    bound[received] = two_way_range_variance_bound(
        down[received], up[received], signal.samples, signal.indices[0], signal.tones_hz[0]
    )
    slope = np.full(len(down), np.nan)
    state = recording[STATE].upto(recording.ticks)[:, index]
    columns = [STATE.index[name] for name in ("x_m", "y_m", "z_m", "heading_rad")]
    where = state[:, columns]
    ranged = [
        _ranging_zone(layout_of(scenario), zone, c) for zone, c in zip(zones, channel, strict=True)
    ]
    for zone in {z.name: z for z in ranged if z is not None}.values():
        ticks = np.array([tick for tick, z in enumerate(ranged) if z is not None and z is zone])
        line = where[ticks, :3] - np.array(layout_of(scenario).station(zone.station).position_m)
        ahead = line[:, 0] * np.cos(where[ticks, 3]) + line[:, 1] * np.sin(where[ticks, 3])
        slope[ticks] = ahead / np.sqrt(np.einsum("nk,nk->n", line, line))
    with np.errstate(invalid="ignore"):
        bound = np.asarray(bound / np.maximum(np.abs(slope), _MIN_SLOPE) ** 2)
    bound[np.isnan(slope)] = np.inf
    return bound


def _ranging_zone(layout: Layout, zone: Zone | None, channel: float) -> Zone | None:
    """Return the zone whose station ranges the train: its own, or one it is still tuned to."""
    if zone is None:
        return None
    around = [zone]
    if zone.previous is not None:
        around.append(layout.zone(zone.previous))
    around.extend(layout.zone(name) for name in zone.next)
    return next((z for z in around if z.downlink_channel == channel), None)


def _rms(values: FloatArray) -> float | None:
    return _finite_or_none(math.sqrt(float(np.mean(values**2)))) if values.size else None


def _root_mean(values: FloatArray) -> float | None:
    return _finite_or_none(math.sqrt(float(np.mean(values)))) if values.size else None


def _ratio(part: int, whole: int) -> float | None:
    return part / whole if whole else None


def _finite_or_none(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def ranging_table(report: Mapping[str, Any]) -> Table:
    """Handovers and errors of every train."""
    state = "" if report["complete"] else " (stopped early)"
    title = f"{report['scenario']}, seed {report['seed']}{state}: position by phase ranging"
    table = new_table(
        title, "train", "km", "handovers", "known", "RMSE m", "bound m", "95 % m", "max m"
    )
    for name, train in report["trains"].items():
        ranging, changes = train["phase_ranging"], train["handovers"]
        problems = [f"{changes[key]} {key}" for key in ("missed", "wrong") if changes[key]]
        table.add_row(
            name,
            f"{train['distance_m'] / 1000.0:.2f}",
            f"{changes['made']} of {changes['expected']}" + "".join(f", {p}" for p in problems),
            percent(ranging["availability"]),
            *(metres(ranging[key]) for key in ("rmse_m", "bound_m", "p95_m", "max_m")),
        )
    return table

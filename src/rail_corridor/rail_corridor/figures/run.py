"""Figures of a run: where trains were, how well that was known, what they were allowed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from rail_corridor.equipment.doppler.report import doppler_bound_m
from rail_corridor.equipment.ranging.layout import layout_of
from rail_corridor.equipment.ranging.report import position_errors
from rail_corridor.plotting import COLOURS, Picture
from rail_corridor.report.from_recording import RecordedRun
from rail_msgs_py.topics.doppler import DOPPLER_FIX
from rail_msgs_py.topics.localizer import LOCALIZER_STATE
from rail_msgs_py.topics.ranging import VRS_CHANNEL
from rail_msgs_py.topics.track_code import CODE_SENT
from rail_msgs_py.topics.train_radio import ATP_STATE
from rail_msgs_py.topics.world import COMMAND, STATE
from rail_signals.arrays import FloatArray

from .ranging import pair_colour

_LEAST_M: Final = 1e-3
_MOST_TRAINS: Final = 4
_DASHES: Final = ("-", "--", "-.", ":")


class RunPicture(NamedTuple):
    """What draws a figure of a run, what to see, and whether there is anything to draw."""

    draw: Callable[[Figure, RecordedRun], None]
    caption: str
    applies: Callable[[RecordedRun], bool]


def _states(run: RecordedRun, index: int) -> FloatArray:
    """State of a train [tick, column], NaN while it is not on the line."""
    recording = run.intake.recording
    state: FloatArray = recording[STATE].upto(recording.ticks)[:, index].copy()
    state[~(state[:, STATE.index["on_line"]] > 0.0)] = np.nan
    return state


def _times_s(run: RecordedRun) -> FloatArray:
    ticks = np.arange(1, run.intake.recording.ticks + 1, dtype=np.float64)
    return ticks * run.scenario.tick_s


def furthest(run: RecordedRun) -> int:
    """Index of the train that travelled furthest: the one shown where only one is."""
    ways = [
        float(np.nansum(np.abs(np.diff(_states(run, index)[:, STATE.index["path_m"]]))))
        for index in range(len(run.intake.recording.trains))
    ]
    return int(np.argmax(ways))


def _time_distance(figure: Figure, run: RecordedRun) -> None:
    figure.set_size_inches(8.5, 4.8)
    axes = figure.subplots()
    recording, time_s = run.intake.recording, _times_s(run)
    for index, name in enumerate(recording.trains):
        colour, dashes = COLOURS[index % 7], _DASHES[index // 7 % 4]
        front_m = _states(run, index)[:, STATE.index["path_m"]]
        length_m = run.scenario.trains[index].vehicle.length_m
        axes.fill_between(time_s, front_m - length_m, front_m, color=colour, alpha=0.25, lw=0)
        axes.plot(time_s, front_m, dashes, color=colour, label=name)
        if ATP_STATE in recording:
            end_m = recording[ATP_STATE].upto(recording.ticks)[
                :, index, ATP_STATE.index["end_of_authority_m"]
            ]
            axes.plot(time_s, end_m, color=colour, lw=1.3, ls=":")
    axes.set(
        title=f"{run.scenario.name}: where the trains were",
        xlabel="time [s]",
        ylabel="way along the route [m]",
        xlim=(0.0, time_s[-1]),
    )
    handles, labels = axes.get_legend_handles_labels()
    if ATP_STATE in recording:
        (dotted,) = axes.plot([], [], color="black", lw=1.3, ls=":")
        handles, labels = [*handles, dotted], [*labels, "end of authority\non board"]
    axes.legend(handles, labels, loc="center left", bbox_to_anchor=(1.0, 0.5))


def _position_error(figure: Figure, run: RecordedRun) -> None:
    recording, index = run.intake.recording, furthest(run)
    panels: list[Callable[[Any, RecordedRun, int], None]] = [_ranging_error]
    panels += [_doppler_error] if (DOPPLER_FIX in recording) else []
    panels += [_localizer_error] if (LOCALIZER_STATE in recording) else []
    figure.set_size_inches(9.5, 2.2 + 1.9 * len(panels))
    rows = np.atleast_1d(np.asarray(figure.subplots(len(panels), 1, sharex=True)))
    for axes, panel in zip(rows, panels, strict=True):
        panel(axes, run, index)
        axes.set(yscale="log", ylabel="error [m]")
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    name = recording.trains[index]
    rows[0].set_title(f"{run.scenario.name}: how wrong the positions of {name} were")
    rows[-1].set_xlabel("way along the route [m]")


def _points(axes: Any, way_m: FloatArray, error_m: FloatArray, label: str) -> None:
    size_m = np.maximum(np.abs(error_m), _LEAST_M)
    axes.plot(way_m, size_m, ".", ms=3.5, color=COLOURS[0], label=label)


def _ranging_error(axes: Any, run: RecordedRun, index: int) -> None:
    found = position_errors(run.scenario, run.intake.recording, index)
    error_m = np.where(found.usable, found.error_m, np.nan)
    bound_m = np.sqrt(np.where(np.isfinite(found.bound_m2) & found.usable, found.bound_m2, np.nan))
    _points(axes, found.path_m, error_m, "by ranges,\ntold by wayside")
    axes.plot(found.path_m, bound_m, color="black", lw=1.2, label="Cramér-Rao bound")


def _doppler_error(axes: Any, run: RecordedRun, index: int) -> None:
    recording, state = run.intake.recording, _states(run, index)
    bound_m = doppler_bound_m(run.scenario, recording, index)
    told_m = recording[DOPPLER_FIX].upto(recording.ticks)[:, index, DOPPLER_FIX.index["chainage_m"]]
    error_m = np.where(np.isnan(bound_m), np.nan, told_m - state[:, STATE.index["chainage_m"]])
    _points(axes, state[:, STATE.index["path_m"]], error_m, "by Doppler shifts,\non board")
    bound_m = np.maximum(bound_m, _LEAST_M)
    axes.plot(
        state[:, STATE.index["path_m"]], bound_m, color="black", lw=1.2, label="Cramér-Rao bound"
    )


def _localizer_error(axes: Any, run: RecordedRun, index: int) -> None:
    recording, state = run.intake.recording, _states(run, index)
    located = recording[LOCALIZER_STATE].upto(recording.ticks)[:, index]
    there = located[:, LOCALIZER_STATE.index["status"]] > 0.0
    front_m = state[:, STATE.index["chainage_m"]]
    error_m = np.where(there, located[:, LOCALIZER_STATE.index["front_m"]] - front_m, np.nan)
    level_m = 0.5 * (
        located[:, LOCALIZER_STATE.index["high_m"]] - located[:, LOCALIZER_STATE.index["low_m"]]
    )
    level_m = np.where(there, level_m, np.nan)
    _points(axes, state[:, STATE.index["path_m"]], error_m, "from all sensors,\non board")
    way_m = state[:, STATE.index["path_m"]]
    axes.plot(way_m, level_m, color=COLOURS[1], lw=1.2, label="protection level")


def _handovers(figure: Figure, run: RecordedRun) -> None:
    figure.set_size_inches(9.5, 4.5)
    recording, index = run.intake.recording, furthest(run)
    axes = figure.subplots()
    state, route = _states(run, index), run.scenario.trains[index]
    way_m, channel = (
        state[:, STATE.index["path_m"]],
        recording[VRS_CHANNEL].upto(recording.ticks)[:, index, 0],
    )
    path = run.scenario.network.route(list(route.route), route.direction)
    starts_m = {leg.track.name: leg.path_start_m for leg in path.legs}
    low_m, high_m = np.nanmin(way_m), np.nanmax(way_m)
    for zone in layout_of(run.scenario).zones:
        if zone.track not in starts_m:
            continue
        begin_m = starts_m[zone.track] + zone.start_m
        end_m = starts_m[zone.track] + zone.end_m
        if min(end_m, high_m) <= max(begin_m, low_m):
            continue
        axes.axvspan(
            max(begin_m, low_m), min(end_m, high_m), color=pair_colour(zone), alpha=0.18, lw=0
        )
        axes.plot([begin_m, end_m], [zone.downlink_channel] * 2, color=pair_colour(zone), lw=7.0)
        if begin_m > low_m:
            axes.axvline(begin_m, color="black", ls=":", lw=0.9)
            axes.annotate(
                zone.station.upper(),
                (begin_m, 1.0),
                (0, 3),
                xycoords=("data", "axes fraction"),
                textcoords="offset points",
                ha="center",
                fontsize=9,
            )
    tuned = np.where(channel > 0.0, channel, np.nan)
    axes.plot(way_m, tuned, color="black", lw=1.6, drawstyle="steps-post")
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    top = np.nanmax(tuned) if np.isfinite(tuned).any() else 1.0
    axes.set(
        xlabel="way along the route [m]",
        ylabel="channel received",
        xlim=(low_m, high_m),
        ylim=(0.5, top + 0.8),
    )
    axes.grid(visible=False)
    axes.set_title(
        f"{run.scenario.name}: channel of {recording.trains[index]} (black), channels of the zones",
        pad=20,
    )


def _speeds(figure: Figure, run: RecordedRun) -> None:
    recording = run.intake.recording
    names = recording.trains[:_MOST_TRAINS]
    figure.set_size_inches(9.5, 1.6 + 1.7 * len(names))
    rows = np.atleast_1d(np.asarray(figure.subplots(len(names), 1, sharex=True, sharey=True)))
    for index, (axes, name) in enumerate(zip(rows, names, strict=True)):
        state = _states(run, index)
        command = recording[COMMAND].upto(recording.ticks)[:, index]
        way_m = state[:, STATE.index["path_m"]]
        limit = np.full(len(way_m), np.nan)
        for track, track_name in enumerate(recording.tracks):
            here = state[:, STATE.index["track_index"]] == track
            chainage_m = state[here, STATE.index["chainage_m"]]
            limit[here] = run.scenario.network.tracks[track_name].limit_mps(chainage_m)
        permitted = 3.6 * command[:, COMMAND.index["permitted_mps"]]
        axes.plot(way_m, 3.6 * limit, color="black", lw=1.0, ls="--", label="limit of the line")
        axes.plot(way_m, permitted, color=COLOURS[4], lw=4.0, label="permitted")
        speed = np.abs(3.6 * state[:, STATE.index["speed_mps"]])
        axes.plot(way_m, speed, color=COLOURS[0], label="speed")
        brakes = (command[:, COMMAND.index["service_brake"]] > 0.0) | (
            command[:, COMMAND.index["emergency_brake"]] > 0.0
        )
        braked = brakes & (speed > 0.0)
        axes.plot(way_m[braked], speed[braked], ".", color=COLOURS[1], ms=5, label="braked")
        axes.set(ylabel=f"{name}\n[km/h]")
    rows[0].set_ylim(0.0, 1.1 * rows[0].get_ylim()[1])
    rows[0].legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    rows[0].set_title(f"{run.scenario.name}: what the trains were permitted, and ran")
    rows[-1].set_xlabel("way along the route [m]")


def _has_trains(run: RecordedRun) -> bool:
    recording = run.intake.recording
    return bool(recording.trains) and recording.ticks > 1


def _is_supervised(run: RecordedRun) -> bool:
    recording = run.intake.recording
    return _has_trains(run) and ((ATP_STATE in recording) or CODE_SENT in recording)


FIGURES: Final[dict[str, RunPicture]] = {
    "run_time_distance": RunPicture(
        _time_distance,
        "Time-distance chart: fronts of the trains as lines, their length as a band, and with "
        "train control by radio the end of the authority on board (dotted). No band may touch "
        "another on the same track.",
        _has_trains,
    ),
    "run_position_error": RunPicture(
        _position_error,
        "Errors of the positions of the train that ran furthest, along its way, against the "
        "Cramér-Rao bound of the links and of geometry; the protection level of the localizer "
        "has to lie above every error.",
        _has_trains,
    ),
    "run_handovers": RunPicture(
        _handovers,
        "Channel that the transponder received on (black) over the channels of the zones "
        "(coloured): it has to change where a zone ends.",
        _has_trains,
    ),
    "run_speeds": RunPicture(
        _speeds,
        "Speed of the trains (four at most) below what their authority or track code permits and "
        "the limit of the line; dots mark where supervision braked.",
        _is_supervised,
    ),
}


def pictures_of(run: RecordedRun) -> dict[str, Picture]:
    """Figures that a run has something for, by name."""

    def picture(one: RunPicture) -> Picture:
        return Picture(lambda figure: one.draw(figure, run), one.caption)

    return {name: picture(one) for name, one in FIGURES.items() if one.applies(run)}

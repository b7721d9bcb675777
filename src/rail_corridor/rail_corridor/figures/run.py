"""Figures of a run: where trains were, how well that was known, what they were allowed."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from rail_corridor.equipment.registry import subsystems
from rail_corridor.equipment.run_figures import ErrorPanel, FigureData, RunFigure
from rail_corridor.plotting import COLOURS, FigureSpec
from rail_corridor.report.from_recording import RecordedRun
from rail_msgs_py.topics.world import COMMAND, STATE
from rail_signals.arrays import FloatArray

_LEAST_M: Final = 1e-3
_MOST_TRAINS: Final = 4
_DASHES: Final = ("-", "--", "-.", ":")
_ADDED: Final = tuple(subsystem.run_figures() for subsystem in subsystems())


def _time_distance(figure: Figure, run: FigureData) -> None:
    figure.set_size_inches(8.5, 4.8)
    axes = figure.subplots()
    limits = [errors for each in _ADDED if (errors := each.path_limits(run)) is not None]
    for index, name in enumerate(run.data.trains):
        colour, dashes = COLOURS[index % 7], _DASHES[index // 7 % 4]
        front_m = run.state(index, "path_m")
        length_m = run.scenario.trains[index].vehicle.length_m
        axes.fill_between(run.times_s, front_m - length_m, front_m, color=colour, alpha=0.25, lw=0)
        axes.plot(run.times_s, front_m, dashes, color=colour, label=name)
        for _, ends_m in limits:
            axes.plot(run.times_s, ends_m[:, index], color=colour, lw=1.3, ls=":")
    axes.set(
        title=f"{run.scenario.name}: where the trains were",
        xlabel="time [s]",
        ylabel="way along the route [m]",
        xlim=(0.0, run.times_s[-1]),
    )
    handles, labels = axes.get_legend_handles_labels()
    for label, _ in limits:
        (dotted,) = axes.plot([], [], color="black", lw=1.3, ls=":")
        handles, labels = [*handles, dotted], [*labels, label]
    axes.legend(handles, labels, loc="center left", bbox_to_anchor=(1.0, 0.5))


def _position_error(figure: Figure, run: FigureData) -> None:
    train = run.furthest
    panels = [p for each in _ADDED if (p := each.error_panel(run, train)) is not None]
    figure.set_size_inches(9.5, 2.2 + 1.9 * len(panels))
    rows = np.atleast_1d(np.asarray(figure.subplots(len(panels), 1, sharex=True)))
    for axes, panel in zip(rows, panels, strict=True):
        _error_panel(axes, panel)
    rows[0].set_title(
        f"{run.scenario.name}: how wrong the positions of {run.data.trains[train]} were"
    )
    rows[-1].set_xlabel("way along the route [m]")


def _error_panel(axes: Any, panel: ErrorPanel) -> None:
    size_m = np.maximum(np.abs(panel.error_m), _LEAST_M)
    axes.plot(panel.path_m, size_m, ".", ms=3.5, color=COLOURS[0], label=panel.label)
    colour = COLOURS[1] if panel.claimed else "black"
    axes.plot(panel.path_m, panel.bound_m, color=colour, lw=1.2, label=panel.bound_label)
    axes.set(yscale="log", ylabel="error [m]")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))


def _speeds(figure: Figure, run: FigureData) -> None:
    names = run.data.trains[:_MOST_TRAINS]
    figure.set_size_inches(9.5, 1.6 + 1.7 * len(names))
    rows = np.atleast_1d(np.asarray(figure.subplots(len(names), 1, sharex=True, sharey=True)))
    for index, (axes, name) in enumerate(zip(rows, names, strict=True)):
        command = run.data[COMMAND].upto(run.data.ticks)[:, index]
        path_m = run.state(index, "path_m")
        limit_kmh = 3.6 * _line_limits_mps(run, index)
        permitted_kmh = 3.6 * command[:, COMMAND.index["permitted_mps"]]
        axes.plot(path_m, limit_kmh, color="black", lw=1.0, ls="--", label="limit of the line")
        axes.plot(path_m, permitted_kmh, color=COLOURS[4], lw=4.0, label="permitted")
        speed_kmh = np.abs(3.6 * run.state(index, "speed_mps"))
        axes.plot(path_m, speed_kmh, color=COLOURS[0], label="speed")
        brakes = (command[:, COMMAND.index["service_brake"]] > 0.0) | (
            command[:, COMMAND.index["emergency_brake"]] > 0.0
        )
        braked = brakes & (speed_kmh > 0.0)
        axes.plot(path_m[braked], speed_kmh[braked], ".", color=COLOURS[1], ms=5, label="braked")
        axes.set(ylabel=f"{name}\n[km/h]")
    rows[0].set_ylim(0.0, 1.1 * rows[0].get_ylim()[1])
    rows[0].legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    rows[0].set_title(f"{run.scenario.name}: what the trains were permitted, and ran")
    rows[-1].set_xlabel("way along the route [m]")


def _line_limits_mps(run: FigureData, train: int) -> FloatArray:
    """Speed limit where a train was, by tick."""
    state = run.states(train)
    limit_mps = np.full(len(state), np.nan)
    for index, name in enumerate(run.data.tracks):
        here = state[:, STATE.index["track_index"]] == index
        chainage_m = state[here, STATE.index["chainage_m"]]
        limit_mps[here] = run.scenario.network.tracks[name].limit_mps(chainage_m)
    return limit_mps


def _has_trains(run: FigureData) -> bool:
    return bool(run.data.trains) and run.data.ticks > 1


def _is_supervised(run: FigureData) -> bool:
    return COMMAND in run.data


FIGURES: Final[dict[str, RunFigure]] = {
    "run_time_distance": RunFigure(
        _time_distance,
        "Time-distance chart: fronts of the trains as lines, their length as a band, and where "
        "trains hold authorities the end of them (dotted). No band may touch another on the same "
        "track.",
        _has_trains,
    ),
    "run_position_error": RunFigure(
        _position_error,
        "Errors of the positions of the train that ran furthest, along its way, against the "
        "Cramér-Rao bound of the links and of geometry; a protection level has to lie above every "
        "error.",
        _has_trains,
    ),
    **{name: figure for added in _ADDED for name, figure in added.figures.items()},
    "run_speeds": RunFigure(
        _speeds,
        "Speed of the trains (four at most) below what their authority or track code permits and "
        "the limit of the line; dots mark where supervision braked.",
        _is_supervised,
    ),
}


def figure_specs_of(run: RecordedRun) -> dict[str, FigureSpec]:
    """Figures that a run has something for, by name."""
    data = FigureData(run.scenario, run.intake.recording)

    def spec(one: RunFigure) -> FigureSpec:
        return FigureSpec(lambda figure: one.draw(figure, data), one.caption)

    applying = {n: one for n, one in FIGURES.items() if _has_trains(data) and one.applies(data)}
    return {name: spec(one) for name, one in applying.items()}

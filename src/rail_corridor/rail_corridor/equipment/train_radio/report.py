"""From a run to values: the train radio, its authorities, and what came of them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from rail_corridor.equipment.supervision_report import supervision_metrics
from rail_corridor.equipment.tables import new_table
from rail_corridor.equipment.true_events import events_of
from rail_corridor.run_data import RunData
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.topics.train_radio import ATP_STATE, AUTHORITY, CBTC_LINKS, RADIO_LINK
from rail_msgs_py.topics.world import STATE
from rail_signals.arrays import FloatArray
from rail_signals.track_code.scales import GRAVITY_MPS2, LEAST_BRAKING_MPS2
from rail_world.trains.vehicle import Vehicle

from .nodes import steepest_fall_permil
from .section import CBTC
from .threat_metrics import forged_authorities, report_metrics

#: Fractions of its first track at which the passing of a train's front is timed.
PASSED_AT: Final = tuple(tenth / 10.0 for tenth in range(1, 10))


def cbtc_metrics(scenario: Scenario, recording: RunData, index: int) -> dict[str, Any]:
    """Sections ``cbtc`` and ``atp`` of one train."""
    ticks = recording.ticks
    mine = recording[STATE].upto(ticks)[:, index]
    on_line = mine[:, STATE.index["on_line"]] > 0.0
    atp = recording[ATP_STATE].upto(ticks)[:, index]
    issued = recording[AUTHORITY].upto(ticks)[:, index]
    radio = recording[RADIO_LINK].upto(ticks)[:, index]
    links = recording[CBTC_LINKS].upto(ticks)[:, index]
    front_m = mine[:, STATE.index["chainage_m"]]
    end_m = _held(
        atp[:, ATP_STATE.index["end_of_authority_m"]], atp[:, ATP_STATE.index["accepted"]]
    )
    speed_mps = np.abs(mine[:, STATE.index["speed_mps"]])
    passed, withdrawn = _passed(scenario, index, on_line, front_m, speed_mps, end_m)
    mislocated = _mislocated(on_line, front_m, atp)
    return {
        "cbtc": _link(scenario, on_line, atp, issued, radio, links)
        | report_metrics(scenario, recording, index)
        | _location(on_line, front_m, atp)
        | {"mislocated": int(np.count_nonzero(mislocated))}
        | {"passed_s": _passed_s(scenario, index, mine, on_line)},
        "atp": supervision_metrics(scenario, recording, index, on_line)
        | {
            "passed_authority": int(np.count_nonzero(passed)),
            "authority_withdrawn": withdrawn,
        },
    }


def cbtc_events(scenario: Scenario, recording: RunData) -> Iterator[dict[str, Any]]:
    """An event for each end of authority passed, and for each place believed in wrongly."""
    state = recording[STATE].upto(recording.ticks)
    for index in range(len(scenario.trains)):
        mine = state[:, index]
        atp = recording[ATP_STATE].upto(recording.ticks)[:, index]
        on_line = mine[:, STATE.index["on_line"]] > 0.0
        front_m = mine[:, STATE.index["chainage_m"]]
        end_m = _held(
            atp[:, ATP_STATE.index["end_of_authority_m"]], atp[:, ATP_STATE.index["accepted"]]
        )
        speed_mps = np.abs(mine[:, STATE.index["speed_mps"]])
        passed, _ = _passed(scenario, index, on_line, front_m, speed_mps, end_m)
        mislocated = _mislocated(on_line, front_m, atp)
        run = scenario, recording, index
        yield from events_of("end of authority passed", "passed its end of authority", passed, *run)
        yield from events_of("position wrong", "is not where it claims to be", mislocated, *run)


def _passed(
    scenario: Scenario,
    index: int,
    on_line: NDArray[np.bool_],
    front_m: FloatArray,
    speed_mps: FloatArray,
    end_m: FloatArray,
) -> tuple[NDArray[np.bool_], int]:
    """Ticks [tick] in which a moving train was past its end, and authorities withdrawn.

    One is withdrawn if it is cut to where no brake can stop the train any more, as when the wayside
    finds reports and ranges in disagreement. So it is where protection holds none (NaN) any more,
    as when it was switched on anew; that is not counted as withdrawn. The train brakes, and until
    it stands it is not counted as past its end, if it is no further than braking may take it.
    """
    plan, delay_s = CBTC.of(scenario), 3.0 * scenario.tick_s
    assert plan is not None
    none = np.isnan(end_m)
    end_m = np.where(none, -math.inf, end_m)
    passed = np.zeros(len(on_line), dtype=bool)
    withdrawn = 0
    excused = False
    stands_by_m = -math.inf
    for tick in np.flatnonzero(on_line).tolist():
        v = speed_mps[tick]
        stopping_m = v * delay_s + 0.5 * v * v / plan.emergency_mps2
        appears = tick == 0 or not on_line[tick - 1]
        cut = none[tick] if appears else end_m[tick] < end_m[tick - 1] - 1.0
        if cut and end_m[tick] < front_m[tick] + stopping_m:
            if not excused:
                withdrawn += not none[tick]
                stands_by_m = front_m[tick] + _braking_way_m(scenario, index, v)
            excused = True
        elif v == 0.0 or front_m[tick] <= end_m[tick] - stopping_m:
            excused = False
        braking = excused and front_m[tick] <= stands_by_m
        passed[tick] = v > 0.0 and front_m[tick] > end_m[tick] and not braking
    return passed, withdrawn


def _braking_way_m(scenario: Scenario, index: int, speed_mps: float) -> float:
    """Longest way to a stand: motors pull for the dead time, then the service brake of the plan.

    Both are worse by the steepest fall of the track.
    """
    plan, train = CBTC.of(scenario), scenario.trains[index]
    assert plan is not None
    fall_mps2 = 1e-3 * GRAVITY_MPS2 * steepest_fall_permil(scenario.network.tracks[train.route[0]])
    gathered_mps2 = Vehicle(train.vehicle).traction_mps2(0.0) + fall_mps2
    delay_s = 3.0 * scenario.tick_s
    fastest_mps = speed_mps + gathered_mps2 * delay_s
    braked_mps2 = max(plan.braking_mps2 - fall_mps2, LEAST_BRAKING_MPS2)
    stopping_m = (speed_mps + 0.5 * gathered_mps2 * delay_s) * delay_s
    return stopping_m + 0.5 * fastest_mps * fastest_mps / braked_mps2


def _held(end_m: FloatArray, accepted: FloatArray) -> FloatArray:
    """End of authority, the last one where the protection has fallen silent."""
    silent = np.isnan(accepted)
    last = np.maximum.accumulate(np.where(silent, 0, np.arange(len(end_m))))
    return np.where(silent, end_m[last], end_m)


def _link(
    scenario: Scenario,
    on_line: NDArray[np.bool_],
    atp: FloatArray,
    issued: FloatArray,
    radio: FloatArray,
    links: FloatArray,
) -> dict[str, Any]:
    """Frames both ways, and how old the authority on board was."""
    age_s = atp[on_line, ATP_STATE.index["authority_age_s"]]
    age_s = age_s[np.isfinite(age_s)]
    accepted = _last(atp, ATP_STATE.index["accepted"]) + _last(issued, AUTHORITY.index["accepted"])
    lost = _last(atp, ATP_STATE.index["lost"]) + _last(issued, AUTHORITY.index["lost"])
    rejected = _last(atp, ATP_STATE.index["rejected"]) + _last(issued, AUTHORITY.index["rejected"])
    channel = radio[:, RADIO_LINK.index["channel"]]
    changes = (channel[1:] != channel[:-1]) & (channel[:-1] > 0)
    snr = links[on_line, CBTC_LINKS.index["snr_down"]]
    snr = snr[snr > 0.0]
    plan = CBTC.of(scenario)
    lost_s = 0 if plan is None else np.count_nonzero(age_s > plan.timeout_s)
    return {
        "frames": int(accepted + lost),
        "lost": int(lost),
        "rejected": int(rejected),
        "forged_accepted": forged_authorities(scenario.tick_s, atp, issued),
        "age_median_s": float(np.median(age_s)) if age_s.size else None,
        "age_p95_s": float(np.quantile(age_s, 0.95)) if age_s.size else None,
        "without_authority_s": float(lost_s * scenario.tick_s),
        "handovers": int(np.count_nonzero(changes & on_line[1:])),
        "snr_db": float(10.0 * np.log10(np.mean(snr))) if snr.size else None,
    }


def _passed_s(
    scenario: Scenario, index: int, mine: FloatArray, on_line: NDArray[np.bool_]
) -> list[float | None]:
    """Time at which the front passed each of `PASSED_AT` [s], None if it did not."""
    name = scenario.trains[index].route[0]
    there = on_line & (mine[:, STATE.index["track_index"]] == list(scenario.tracks).index(name))
    times_s = (np.flatnonzero(there) + 1) * scenario.tick_s
    front_m = mine[there, STATE.index["chainage_m"]]
    length_m = scenario.network.tracks[name].length_m
    passed: list[float | None] = []
    for fraction in PASSED_AT:
        beyond = np.flatnonzero(front_m >= fraction * length_m)
        if not beyond.size or beyond[0] == 0:  # it never came there, or was put there
            passed.append(None)
            continue
        after = int(beyond[0])
        pair = slice(after - 1, after + 1)
        passed.append(float(np.interp(fraction * length_m, front_m[pair], times_s[pair])))
    return passed


def _last(table: FloatArray, column: int) -> float:
    """The last figure of a running count."""
    counts = table[:, column]
    counts = counts[~np.isnan(counts)]
    return float(counts[-1]) if counts.size else 0.0


def _location(
    on_line: NDArray[np.bool_], front_m: FloatArray, atp: FloatArray
) -> dict[str, float | int | None]:
    """Where the train believed to be, against the truth; an infinite uncertainty claims nothing."""
    error_m = np.abs(atp[:, ATP_STATE.index["front_m"]] - front_m)
    half_m = atp[:, ATP_STATE.index["uncertainty_m"]]
    heard = ~np.isnan(atp[:, ATP_STATE.index["accepted"]])
    claimed = on_line & heard & (half_m != math.inf)
    known = claimed & np.isfinite(error_m) & np.isfinite(half_m)
    if not known.any():
        return {"located": 0.0, "location_rmse_m": None, "uncertainty_m": None}
    return {
        "located": float(np.count_nonzero(known) / np.count_nonzero(on_line)),
        "location_rmse_m": float(math.sqrt(np.mean(error_m[known] ** 2))),
        "uncertainty_m": float(np.median(half_m[known])),
    }


def _mislocated(
    on_line: NDArray[np.bool_], front_m: FloatArray, atp: FloatArray
) -> NDArray[np.bool_]:
    """Ticks [tick] in which the truth is outside of the claim; no number is a false claim."""
    error_m = np.abs(atp[:, ATP_STATE.index["front_m"]] - front_m)
    half_m = atp[:, ATP_STATE.index["uncertainty_m"]]
    heard = ~np.isnan(atp[:, ATP_STATE.index["accepted"]])
    false: NDArray[np.bool_] = on_line & heard & (half_m != math.inf) & ~(error_m <= half_m)
    return false


def authority_table(trains: Mapping[str, Any]) -> Table | None:
    """What the train radio brought, and what supervision did; None without it."""
    obeying = {name: train for name, train in trains.items() if "cbtc" in train}
    if not obeying:
        return None
    table = new_table(
        "movement authorities by radio, and supervision",
        *("train", "frames", "lost", "age 95 % s", "braked", "emerg.", "passed", "gap m"),
    )
    for name, train in obeying.items():
        link, atp = train["cbtc"], train["atp"]
        margin_m, age_s = atp["margin_min_m"], link["age_p95_s"]
        table.add_row(
            name,
            str(link["frames"]),
            f"{100.0 * link['lost'] / link['frames']:.1f} %" if link["frames"] else "-",
            "-" if age_s is None else f"{age_s:.2f}",
            str(atp["interventions"]),
            str(atp["emergency_brakes"]),
            str(atp["passed_authority"]),
            "-" if margin_m is None else f"{margin_m:.0f}",
        )
    return table

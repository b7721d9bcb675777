"""What goes wrong in a run of the study of safety: one fault, two at once, or three."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, get_args

import numpy as np

from rail_corridor.equipment.ranging.layout import layout_of
from rail_corridor.equipment.train_radio.placement import bases_of
from rail_corridor.run.kills import Kill
from rail_corridor.scenario.model import Scenario
from rail_corridor.studies.kills import equipment_of

FaultKind = Literal[
    "equipment_off",
    "kill",
    "wheel_slip",
    "reduced_braking",
    "clock",
    "train_stop",
    "dead_station",
    "dead_base_station",
    "speed_restriction",
]
#: Restarts and slides are what was found to harm, so that they come most often.
_WEIGHTS: Final[Mapping[FaultKind, float]] = {
    "equipment_off": 5.0,
    "kill": 0.5,
    "wheel_slip": 3.0,
    "reduced_braking": 1.5,
    "clock": 1.0,
    "train_stop": 1.5,
    "dead_station": 1.5,
    "dead_base_station": 1.5,
    "speed_restriction": 1.0,
}
FAULT_KINDS: Final[tuple[FaultKind, ...]] = get_args(FaultKind)
#: Equipment is drawn by its kind first: protection and controller as often as all else together.
_OFTEN: Final = ("atp", "zone_controller")
#: Of the equipment of a localizer.
LOCALIZER_KINDS: Final = ("localizer", "doppler_positioner")
#: How many faults a run has, and how often.
_COUNTS: Final = {0: 0.04, 1: 0.44, 2: 0.44, 3: 0.08}
#: Two faults are at once, or one begins up to so long after the other.
_BESIDE_S: Final = 8.0

#: When faults begin, and when the last one is over at the latest [s].
EARLIEST_S: Final = 4.0
LATEST_BEGIN_S: Final = 26.0
LATEST_END_S: Final = 38.0


@dataclass(frozen=True)
class DrawnFaults:
    """Faults of a run.

    Parameters
    ----------
    faults : tuple of dict
        As of a scenario's file.
    kills : tuple of Kill
    """

    faults: tuple[dict[str, Any], ...] = ()
    kills: tuple[Kill, ...] = ()

    @property
    def kinds(self) -> tuple[str, ...]:
        """Their kinds, in the order in which they were drawn."""
        return (*("kill" for _ in self.kills), *(fault["kind"] for fault in self.faults))

    @property
    def last_end_s(self) -> float:
        """When the last one is over [s], 0 if there is none, without those that never are."""
        return max((fault["to_s"] for fault in self.faults if "to_s" in fault), default=0.0)

    def __str__(self) -> str:
        return "; ".join(
            [
                *(f"kill {kill.node}@{kill.time_s:g}" for kill in self.kills),
                *(" ".join(f"{value}" for value in fault.values()) for fault in self.faults),
            ]
        )


def draw_faults(
    scenario: Scenario, kinds: Sequence[FaultKind], rng: np.random.Generator
) -> DrawnFaults:
    """Faults for a scenario that has none.

    Parameters
    ----------
    scenario : Scenario
        With train control by radio.
    kinds : sequence of str
        Those that are drawn.
    rng : numpy.random.Generator
    """
    count = int(rng.choice(list(_COUNTS), p=list(_COUNTS.values())))
    weights = np.array([_WEIGHTS[kind] for kind in kinds])
    weights /= weights.sum()
    found: list[dict[str, Any]] = []
    kills: list[Kill] = []
    begin_s = float(rng.uniform(EARLIEST_S, LATEST_BEGIN_S))
    for _ in range(count):
        kind = kinds[int(rng.choice(len(kinds), p=weights))]
        if kind == "kill":
            kills.append(Kill(_node(scenario, rng), round(begin_s, 2)))
        else:
            end_s = min(begin_s + _lasts_s(rng), LATEST_END_S)
            times = {"from_s": round(begin_s, 2), "to_s": round(end_s, 2)}
            found.append({"kind": kind, **_DRAWS[kind](scenario, rng, times)})
        begin_s = min(begin_s + float(rng.choice([0.0, 1.0])) * rng.uniform(0.0, _BESIDE_S), 30.0)
    return DrawnFaults(tuple(_without_repeats(found)), tuple(_each_once(kills)))


def _each_once(kills: Sequence[Kill]) -> list[Kill]:
    return list({kill.node: kill for kill in kills}.values())


def _without_repeats(faults: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """One of a kind at a subject: a train slides once at a time."""
    return list({tuple(fault.values())[:2]: fault for fault in faults}.values())


def _lasts_s(rng: np.random.Generator) -> float:
    """Duration: from a moment to a third of a minute, as many short ones as long ones."""
    return float(np.exp(rng.uniform(np.log(0.6), np.log(20.0))))


def _node(scenario: Scenario, rng: np.random.Generator) -> str:
    equipment = equipment_of(scenario)
    weights = np.array([3.0 if kind in _OFTEN else 1.0 for kind in equipment])
    kind = str(rng.choice(list(equipment), p=weights / weights.sum()))
    return str(rng.choice(equipment[kind]))


def _train(scenario: Scenario, rng: np.random.Generator) -> str:
    return str(rng.choice([train.name for train in scenario.trains]))


def _off(scenario: Scenario, rng: np.random.Generator, times: dict[str, float]) -> dict[str, Any]:
    return {"node": _node(scenario, rng), **times}


def _slip(scenario: Scenario, rng: np.random.Generator, times: dict[str, float]) -> dict[str, Any]:
    # Two of three slide, from locked wheels on; the others spin.
    slides = rng.random() < 2.0 / 3.0
    ratio = rng.uniform(0.0, 0.98) if slides else rng.uniform(1.02, 2.0)
    return {"train": _train(scenario, rng), "ratio": round(float(ratio), 3), **times}


def _weak(scenario: Scenario, rng: np.random.Generator, times: dict[str, float]) -> dict[str, Any]:
    """Brakes no weaker than guaranteed."""
    plan: Any = getattr(scenario, "cbtc")  # noqa: B009 - a field that equipment adds
    train = scenario.trains[int(rng.integers(len(scenario.trains)))]
    least = {
        "service": plan.braking_mps2 / train.vehicle.max_service_brake_mps2,
        "emergency": plan.emergency_mps2 / train.vehicle.emergency_brake_mps2,
    }
    part = float(rng.choice([0.0, rng.random()]))  # half of them just what is guaranteed
    factors = {
        name: float(np.ceil(1e4 * (low + part * (1.0 - low))) / 1e4) for name, low in least.items()
    }
    return {"train": train.name, **factors, **times}


def _clock(scenario: Scenario, rng: np.random.Generator, _: dict[str, float]) -> dict[str, Any]:
    equipment = equipment_of(scenario)
    kind = str(rng.choice(["atp", "zone_controller"]))
    offset_s = float(rng.choice([-1.0, 1.0])) * float(np.exp(rng.uniform(np.log(1e-3), 0.0)))
    return {
        "node": str(rng.choice(equipment[kind])),
        "offset_s": round(offset_s, 4),
        "drift_ppm": round(float(rng.uniform(-50.0, 50.0)), 1),
    }


def _stop(scenario: Scenario, rng: np.random.Generator, times: dict[str, float]) -> dict[str, Any]:
    return {"train": _train(scenario, rng), **times}


def _wrs(scenario: Scenario, rng: np.random.Generator, times: dict[str, float]) -> dict[str, Any]:
    names = [station.name for station in layout_of(scenario).stations]
    return {"station": str(rng.choice(names)), **times}


def _base(scenario: Scenario, rng: np.random.Generator, times: dict[str, float]) -> dict[str, Any]:
    return {"base": str(rng.choice([base.name for base in bases_of(scenario)])), **times}


def _slow(scenario: Scenario, rng: np.random.Generator, times: dict[str, float]) -> dict[str, Any]:
    name, track = next(iter(scenario.network.tracks.items()))
    from_m = float(rng.uniform(0.1, 0.8)) * track.length_m
    to_m = min(from_m + float(rng.uniform(50.0, 400.0)), track.length_m)
    place = {"track": name, "from_m": round(from_m, 1), "to_m": round(to_m, 1)}
    return {**place, "speed_kmh": float(rng.choice([15.0, 25.0, 40.0])), **times}


_Draw = Callable[[Scenario, np.random.Generator, dict[str, float]], dict[str, Any]]
_DRAWS: Final[Mapping[FaultKind, _Draw]] = {
    "equipment_off": _off,
    "wheel_slip": _slip,
    "reduced_braking": _weak,
    "clock": _clock,
    "train_stop": _stop,
    "dead_station": _wrs,
    "dead_base_station": _base,
    "speed_restriction": _slow,
}

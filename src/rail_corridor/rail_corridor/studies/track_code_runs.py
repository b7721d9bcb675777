"""Random runs with track codes: faults of rails, circuits and wheels, and whether trains are safe.

Two or three trains of random length follow each other on a line of 3 to 5 km. What is drawn: the
length of its circuits, gradients to 25 per mille, limits, the tick, drivers that keep to the codes
or do not, noise 8 to 30 dB below the transmitter, lines of the traction current in the bands of
both carriers, joints, and one to three faults that all end `FAULTS_END_S` after the start at the
latest. Poor shunting befalls the first train only once it is on its way: a circuit holds a train
that came in sequence.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from pydantic import Field

from rail_corridor.study.sources import Drawn
from rail_corridor.study.strict import Strict

#: Kinds of faults; slides count twice.
KINDS: Final = (
    *("slide", "slide", "spin", "dead_transmitter", "failed_joint"),
    *("poor_shunt", "wet_ballast", "sanding", "restart"),
)
EARLIEST_S: Final = 15.0
FAULTS_END_S: Final = 120.0
TICKS_S: Final = (0.1, 0.25, 0.5, 1.0)
#: A train that stands longer than this with a free line ahead, faults being over, is stuck.
STUCK_S: Final = 60.0

#: Part of the runs with traction current on both carriers, 8 dB below the transmitter.
STRONG_LINES: Final = 0.1

ZONE_M: Final = 350.0

_TRAINS: Final = ("first", "second", "third")
_CARRIERS_HZ: Final = (1700.0, 2300.0)
_FUNDAMENTAL_HZ: Final = 50.0
_STREAM: Final = 93


class TrackCodeRunParameters(Strict):
    """What the drawn scenarios have in common."""

    duration_s: float = Field(300.0, ge=FAULTS_END_S + STUCK_S, le=3600.0)
    restarts: bool = Field(
        True, description="whether equipment is switched off and on, as equipment_off does"
    )


def draw_track_codes(parameters: TrackCodeRunParameters, seed: int) -> Drawn:
    """A line with track circuits, trains that obey their codes, and what goes wrong.

    Parameters
    ----------
    parameters : TrackCodeRunParameters
    seed : int
        Of everything: the scenario, its noise, and the faults.
    """
    rng = np.random.default_rng([seed, _STREAM])
    tick_s = float(rng.choice(TICKS_S))
    length_m = float(rng.choice([100.0, 150.0, 200.0, 300.0, 500.0, 800.0]))
    trains = _trains(rng, length_m)
    line_m = trains[0]["start_m"] + float(rng.uniform(1500.0, 3000.0))
    count = int(np.ceil(line_m / length_m))
    data: dict[str, Any] = {
        "name": "track_code_runs",
        "description": "One random run with track codes",
        "seed": seed,
        "tick_s": tick_s,
        "duration_s": parameters.duration_s,
        "tracks": {"main": _track(rng, line_m)},
        "stations": {"zone_length_m": ZONE_M},
        "track_circuits": {
            "length_m": length_m,
            "cab_signals": bool(rng.random() < 0.5),
            "snr_db": round(float(rng.uniform(8.0, 30.0)), 1),
            "joint_db": round(float(rng.uniform(15.0, 40.0)), 1),
            "harmonics": _harmonics(rng),
        },
        "trains": trains,
    }
    kinds = [kind for kind in KINDS if parameters.restarts or kind != "restart"]
    drawn = rng.choice(kinds, size=int(rng.integers(1, 4)))
    names = [train["name"] for train in trains]
    data["faults"] = [_fault(rng, str(kind), names, count, line_m) for kind in drawn]
    if rng.random() < STRONG_LINES:
        # Two lines on the carriers, as strong as makes a receiver that knows no wave say "clear".
        data["track_circuits"] |= {"cab_signals": True, "harmonics": [[34, -8.0], [46, -8.0]]}
    facts = {
        "strong_lines": float(data["track_circuits"]["harmonics"] == [[34, -8.0], [46, -8.0]]),
        "kinds": "+".join(sorted(str(kind) for kind in drawn)),
        "tick_s": tick_s,
        "circuit_m": length_m,
        "snr_db": data["track_circuits"]["snr_db"],
        "last_fault_s": max(fault["to_s"] for fault in data["faults"]),
    }
    return Drawn(data, (), facts)


def look_at_track_codes(drawn: Drawn, report: Mapping[str, Any]) -> dict[str, float | None]:
    """Whether a train stands for ever, and whether the corridor went on to the end of the run."""
    ticks = round(drawn.data["duration_s"] / drawn.data["tick_s"])
    since_s = drawn.data["duration_s"] - drawn.facts["last_fault_s"]
    stands_s = [train["track_code"]["stands_free_s"] for train in report["trains"].values()]
    return {
        "stuck": float(sum(s > min(STUCK_S, since_s) for s in stands_s)),
        "went_on": float(report["complete"] and report["ticks"] == ticks),
    }


def _trains(rng: np.random.Generator, circuit_m: float) -> list[dict[str, Any]]:
    """Trains from the first one back, a free circuit and more between them."""
    trains: list[dict[str, Any]] = []
    rear_m = 20.0
    for name in reversed(_TRAINS[: int(rng.integers(2, 4))]):
        length_m = round(float(rng.uniform(20.0, 400.0)), 1)
        front_m = round(rear_m + length_m + float(rng.uniform(1.0, 60.0)), 1)
        preset = str(rng.choice(["metro", "regional"]))
        trains.append(
            {
                "name": name,
                "route": ["main"],
                "start_m": front_m,
                "vehicle": {"preset": preset, "length_m": length_m},
            }
        )
        # No two in one zone of the stations: they could not be told apart.
        rear_m = front_m + max(2.0 * circuit_m, 2.0 * ZONE_M)
    return trains[::-1]


def _track(rng: np.random.Generator, line_m: float) -> dict[str, Any]:
    corners_m = np.sort(rng.uniform(0.1, 0.9, size=4)) * line_m
    limits = rng.choice([20.0, 40.0, 45.0, 60.0, 80.0, 100.0], size=2)
    return {
        "elements": [{"straight_m": round(line_m, 1)}],
        "gradients": [
            [0, 0],
            [round(float(corners_m[0]), 1), round(float(rng.uniform(-25.0, 25.0)), 1)],
            [round(float(corners_m[2]), 1), round(float(rng.uniform(-25.0, 25.0)), 1)],
        ],
        "speed_limits": [
            [0, 80],
            [round(float(corners_m[1]), 1), float(limits[0])],
            [round(float(corners_m[3]), 1), float(limits[1])],
        ],
    }


def _harmonics(rng: np.random.Generator) -> list[list[float]]:
    """Lines near each of the carriers, of which the decoders bear the usual ones."""
    lines: dict[int, float] = {}
    for carrier_hz in _CARRIERS_HZ:
        middle = round(carrier_hz / _FUNDAMENTAL_HZ)
        order = int(middle + rng.integers(-2, 3))
        lines[order] = round(float(rng.uniform(-40.0, -12.0)), 1)
    return [[order, level_db] for order, level_db in sorted(lines.items())]


def _fault(
    rng: np.random.Generator, kind: str, trains: list[str], circuits: int, line_m: float
) -> dict[str, Any]:
    earliest_s = 60.0 if kind == "poor_shunt" else EARLIEST_S
    from_s = round(float(rng.uniform(earliest_s, 90.0)), 1)
    to_s = round(min(FAULTS_END_S, from_s + float(rng.uniform(5.0, 60.0))), 1)
    fault: dict[str, Any] = {"kind": kind, "from_s": from_s, "to_s": to_s}
    train = str(rng.choice(trains))
    circuit = f"tc{int(rng.integers(1, circuits + 1))}"
    place_m = float(rng.uniform(0.0, 0.8)) * line_m
    value = float(rng.random())
    match kind:
        case "slide":
            ratio = 0.0 if value < 0.1 else round(value, 2)
            return fault | {"kind": "wheel_slip", "train": train, "ratio": min(ratio, 0.95)}
        case "spin":
            return fault | {"kind": "wheel_slip", "train": train, "ratio": round(1.05 + value, 2)}
        case "failed_joint":
            return fault | {"circuit": circuit, "loss_db": round(20.0 * value, 1)}
        case "poor_shunt":
            return fault | {"train": trains[0], "shunt_ohm": round(10.0 ** (2.0 * value), 2)}
        case "wet_ballast":
            to_m = round(place_m + 200.0 + 1000.0 * value, 1)
            return fault | {
                "track": "main",
                "from_m": round(place_m, 1),
                "to_m": to_m,
                "ballast_ohm_km": round(0.5 + 8.0 * float(rng.random()), 1),
            }
        case "sanding":
            return fault | {"train": train, "loss_db": round(60.0 * value, 1)}
        case "restart":
            units = (
                f"/wayside/{circuit}/track_code",
                f"/{train}/track_code",
                f"/{train}/code_supervision",
            )
            return fault | {"kind": "equipment_off", "node": units[int(3.0 * value)]}
        case _:
            return fault | {"circuit": circuit}

"""Simulated seconds per second of the whole corridor, and how it grows with stations and trains.

The peer is real time. The bound is the rate at which transport alone and arithmetic alone would go
one after the other in one process: the floors of `rail profile`, of the same run.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rail_corridor.loading.loader import load_scenario, scenario_from_data
from rail_corridor.scenario.model import Scenario

#: Stations and trains of the rows `corridor.scale_*`.
SCALES = ((10, 5), (30, 5), (114, 1), (114, 5), (114, 10), (114, 20))
#: Trains of the rows `corridor.located`: ranging, train radio, Doppler and localizer, 114 stations.
LOCATED_TRAINS = (5, 20, 50, 100)
ZONE_M = 200.0


def rows(names: tuple[str, ...] = ()) -> Iterator[dict[str, Any]]:
    """Measure, and yield one row per figure."""
    cases: list[tuple[str, Scenario]] = [("corridor.demo", load_scenario("demo"))]
    for stations, trains in SCALES:
        cases.append(
            (f"corridor.scale_{stations}_stations_{trains}_trains", line(stations, trains))
        )
    for trains in LOCATED_TRAINS:
        cases.append((f"corridor.located_{trains}_trains", line(114, trains, located=True)))
    for name, scenario in cases:
        if not names or any(name == n or name.startswith(n) for n in names):
            yield _row(name, scenario)


def line(stations: int, trains: int, *, located: bool = False, seconds: float = 30.0) -> Scenario:
    """A straight line with trains spread over it, all running: nobody enters or leaves.

    With ``located`` the trains go by moving block, each with four ways to know where it is.
    """
    length_m = stations * ZONE_M
    radio = {"base_spacing_m": 1000.0, "symbol_rate_hz": 200e3}
    equipment = {"cbtc": radio, "references": {"spacing_m": 600.0}, "localizer": {}}
    return scenario_from_data(
        {
            **(equipment if located else {}),
            "name": "scale",
            "seed": 3,
            "duration_s": seconds,
            "tick_s": 0.25,
            "tracks": {"main": {"elements": [{"straight_m": length_m}], "speed_limits": [[0, 80]]}},
            "stations": {"zone_length_m": ZONE_M},
            "trains": [
                {
                    "name": f"train{i}",
                    "route": ["main"],
                    "start_m": 50.0 + i * length_m / trains,
                    "speed_kmh": 60.0,
                }
                for i in range(trains)
            ],
        },
        directory=Path.cwd(),
    )


def _row(name: str, scenario: Scenario) -> dict[str, Any]:
    found = _profile(scenario)
    tick_ms = scenario.tick_s * 1e3
    transport_ms, arithmetic_ms = found["transport_floor_ms"], found["arithmetic_floor_ms"]
    return {
        "name": name,
        "unit": "x real time",
        "ours": tick_ms / found["wall_tick_ms"],
        "peer_name": "real time",
        "peer": 1.0,
        "ratio": tick_ms / found["wall_tick_ms"],
        "bound": tick_ms / (transport_ms + arithmetic_ms),
        "ms_per_tick": found["tick_ms"],
        "transport_ms_per_tick": transport_ms,
        "arithmetic_ms_per_tick": arithmetic_ms,
    }


def _profile(scenario: Scenario) -> dict[str, Any]:
    """Profile of a run of its own, in one process."""
    with tempfile.TemporaryDirectory() as folder:
        path, figures = Path(folder) / "scenario.yaml", Path(folder) / "figures.json"
        path.write_text(scenario.to_json())  # JSON is YAML
        command = [sys.executable, "-m", "rail_corridor.cli.main", "profile", str(path)]
        subprocess.run(
            [*command, "--json", str(figures), "--flame", str(Path(folder) / "flame.html")],
            check=True,
            stdout=subprocess.DEVNULL,
            timeout=1800,
        )
        return dict(json.loads(figures.read_text()))


if __name__ == "__main__":
    for row in rows(tuple(sys.argv[1:])):
        print(json.dumps(row))

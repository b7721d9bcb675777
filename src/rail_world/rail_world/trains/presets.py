"""Figures of typical train sets, each of which a description may override.

``metro`` and ``regional`` take mass, tractive effort, power, resistance and speed from the train
library of TTOBench (Kouzoupis et al., 2023: Beijing subway; Stadler FLIRT), in N and m/s instead
of kN and km/h; the FLIRT's effort is held to the 1.1 m/s^2 stated there. Brakes and their build-up,
wheels, lengths and, for
the metro, the rotating masses (which the library neglects) are usual values assumed here.
``high_speed`` is no train in service but an assumed set with the power to hold 500 km/h on level
track (about 16.4 MW at the wheels).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

PRESETS: Final[Mapping[str, Mapping[str, Any]]] = {
    "metro": {
        "mass_kg": 278e3,
        "rotating_mass_factor": 1.06,
        "davis": {"a_n": 3947.6, "b_n_per_mps": 0.0, "c_n_per_mps2": 2.2294 * 3.6**2},
        "max_traction_n": 310e3,
        "max_power_w": 3.1e6,
        "max_service_brake_mps2": 1.0,
        "emergency_brake_mps2": 1.3,
        "brake_build_up_s": 0.8,
        "max_speed_kmh": 80.0,
        "wheel_diameter_m": 0.84,
        "odometer_pulses": 200,
        "length_m": 118.0,
    },
    "regional": {
        "mass_kg": 122e3,
        "rotating_mass_factor": 1.10,
        "davis": {
            "a_n": 2378.88,
            "b_n_per_mps": 16.98165 * 3.6,
            "c_n_per_mps2": 0.93264 * 3.6**2,
        },
        "max_traction_n": 148e3,
        "max_power_w": 2.6e6,
        "max_service_brake_mps2": 0.9,
        "emergency_brake_mps2": 1.2,
        "brake_build_up_s": 1.0,
        "max_speed_kmh": 160.0,
        "wheel_diameter_m": 0.87,
        "odometer_pulses": 200,
        "length_m": 74.0,
    },
    "high_speed": {
        "mass_kg": 400e3,
        "rotating_mass_factor": 1.05,
        "davis": {"a_n": 3500.0, "b_n_per_mps": 60.0, "c_n_per_mps2": 5.5},
        "max_traction_n": 300e3,
        "max_power_w": 20e6,
        "max_service_brake_mps2": 0.6,
        "emergency_brake_mps2": 1.0,
        "brake_build_up_s": 1.5,
        "max_speed_kmh": 500.0,
        "wheel_diameter_m": 0.92,
        "odometer_pulses": 200,
        "length_m": 200.0,
    },
}

"""The rails as the world has them."""

from __future__ import annotations

import math

from rail_corridor.scenario.model import Scenario
from rail_world.track_code.description import Harmonic, RailDescription, RailFault, TrackCircuit

from .placement import circuits_of
from .section import RAIL_FAULTS, TRACK_CIRCUITS


def rails_of(scenario: Scenario) -> RailDescription | None:
    """The rails and their circuits, None where there are none."""
    plan = TRACK_CIRCUITS.of(scenario)
    if plan is None:
        return None
    # A wave of amplitude 1 over the noise in 300 Hz.
    noise_v = math.sqrt(0.5 * plan.sample_rate_hz / 600.0) * 10.0 ** (-plan.snr_db / 20.0)
    faults = [f for f in scenario.faults if isinstance(f, RAIL_FAULTS)]
    return RailDescription(
        circuits=tuple(
            TrackCircuit(
                name=c.name,
                track=c.track,
                start_m=c.start_m,
                end_m=c.end_m,
                carrier_hz=c.carrier_hz,
            )
            for c in circuits_of(scenario)
        ),
        trains=tuple(train.name for train in scenario.trains),
        tracks=tuple(scenario.tracks),
        sample_rate_hz=plan.sample_rate_hz,
        attenuation_db_per_km=plan.attenuation_db_per_km,
        joint_attenuation_db=plan.joint_db,
        white_noise_v=noise_v,
        impulse_rate_per_s=plan.impulses_per_s,
        impulse_amplitude_v=1.0 if plan.impulses_per_s else 0.0,
        harmonics=tuple(
            Harmonic(order=order, amplitude_v=10.0 ** (level_db / 20.0))
            for order, level_db in plan.harmonics
        ),
        faults=tuple(RailFault(**fault.model_dump()) for fault in faults),
    )

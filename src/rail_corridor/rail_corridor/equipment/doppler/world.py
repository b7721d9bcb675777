"""The medium of the reference tones as the world has it."""

from __future__ import annotations

from rail_corridor.scenario.model import Scenario
from rail_world.doppler.description import ReferenceDescription, ReferenceFault, ReferenceStation

from .placement import references_of
from .section import REFERENCES, DeadReference, DetunedReference


def reference_description(scenario: Scenario) -> ReferenceDescription | None:
    """The medium of the reference tones, None where there is none."""
    plan = REFERENCES.of(scenario)
    if plan is None:
        return None
    faults = [f for f in scenario.faults if isinstance(f, DeadReference | DetunedReference)]
    return ReferenceDescription(
        stations=tuple(
            ReferenceStation(
                name=station.name,
                track=station.track,
                chainage_m=station.chainage_m,
                position_m=station.position_m,
            )
            for station in references_of(scenario)
        ),
        trains=tuple(train.name for train in scenario.trains),
        tracks=tuple(scenario.tracks),
        carrier_hz=plan.carrier_hz,
        sample_rate_hz=plan.sample_rate_hz,
        samples=plan.samples,
        noise_figure_db=plan.noise_figure_db,
        path_loss_exponent=plan.path_loss_exponent,
        extra_loss_db=plan.extra_loss_db,
        coverage_range_m=plan.coverage_range_m,
        receiver_ppm=plan.receiver_ppm,
        station_ppb=plan.station_ppb,
        faults=tuple(ReferenceFault(**fault.model_dump()) for fault in faults),
    )

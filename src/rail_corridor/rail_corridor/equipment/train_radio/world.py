"""The train radio as the world has it: links, losses, faults, and threats to the backbone."""

from __future__ import annotations

from typing import Final

from rail_corridor.scenario.model import Scenario
from rail_signals.train_radio.space_time_block import scheme
from rail_world.train_radio.description import BaseStation, CbtcDescription, CbtcFault, LossSection
from rail_world.train_radio.threat_description import ThreatPeriod, ThreatsDescription

from .placement import bases_of
from .section import CBTC, DeadBaseStation, NetworkThreats

#: Base stations are heard this many of their spacings away; channels come again after more.
_COVERAGE_SPACINGS: Final = 1.4


def cbtc_description(scenario: Scenario) -> CbtcDescription | None:
    """What the medium of the train radio knows, None without train control by radio."""
    plan = CBTC.of(scenario)
    if plan is None:
        return None
    antennas = scheme(plan.scheme)
    sections = [
        LossSection(
            kind=loss.kind,
            track=loss.track,
            from_m=loss.from_m,
            to_m=loss.to_m,
            wall_loss_db=loss.entry_db if loss.kind == "cutting" else None,
            entry_loss_db=loss.entry_db if loss.kind == "tunnel" else None,
            loss_db_per_m=loss.db_per_km / 1000.0 if loss.kind == "tunnel" else None,
        )
        for loss in plan.losses
    ]
    faults = [
        CbtcFault(
            kind="dead_base_station",
            base_station=fault.base,
            from_s=fault.from_s,
            to_s=fault.to_s,
        )
        for fault in scenario.faults
        if isinstance(fault, DeadBaseStation)
    ]
    return CbtcDescription(
        base_stations=tuple(
            BaseStation(
                name=base.name,
                track=base.track,
                chainage_m=base.chainage_m,
                position_m=base.position_m,
                channel=base.channel,
            )
            for base in bases_of(scenario)
        ),
        trains=tuple(train.name for train in scenario.trains),
        tracks=tuple(scenario.tracks),
        downlink_hz=plan.downlinks_hz,
        uplink_hz=plan.uplinks_hz,
        sample_rate_hz=plan.symbol_rate_hz * plan.samples_per_symbol,
        # The code is the same both ways.
        base_antennas=max(antennas.transmit, antennas.receive),
        train_antennas=max(antennas.transmit, antennas.receive),
        base_power_dbm=plan.base_power_dbm,
        train_power_dbm=plan.train_power_dbm,
        noise_figure_db=plan.noise_figure_db,
        path_loss_exponent=plan.path_loss_exponent,
        coverage_range_m=_COVERAGE_SPACINGS * plan.base_spacing_m,
        rician_factor=plan.rician_factor,
        snr_offset_db=-plan.extra_loss_db,
        sections=tuple(sections),
        faults=tuple(faults),
    )


def threats_of(scenario: Scenario) -> ThreatsDescription:
    """What an intruder does to the frames on the backbone; without any there is no backbone."""
    periods = (
        ThreatPeriod(**fault.model_dump(exclude={"kind"}))
        for fault in scenario.faults
        if isinstance(fault, NetworkThreats)
    )
    return ThreatsDescription(periods=tuple(periods))

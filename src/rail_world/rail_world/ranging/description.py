"""The validated description of the radio: antennas, channels, powers, faults."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from rail_world.line.description_base import Description

Vector = tuple[float, float, float]
Channel = Annotated[int, Field(ge=1, le=99)]


class AntennaPattern(Description):
    """Directional antenna with a parabolic main lobe and a flat back (3GPP TR 36.942 form)."""

    gain_dbi: float = Field(12.0, ge=-20.0, le=40.0, description="on the axis")
    beamwidth_deg: float = Field(60.0, ge=5.0, le=180.0, description="between the -3 dB points")
    front_to_back_db: float = Field(30.0, ge=0.0, le=60.0, description="axis to back")


class StationAntenna(Description):
    """One antenna of a wayside station, looking into one zone."""

    site: str
    zone: str
    position_m: Vector
    boresight: Vector
    downlink_channel: Channel
    uplink_channel: Channel
    reach_m: float = Field(gt=0.0, description="distance past which nothing is heard")


class Fault(Description):
    """Something that goes wrong in the radio, from and to a simulated time."""

    kind: Literal["dead_station", "jam"]
    from_s: float = Field(0.0, ge=0.0)
    to_s: float = Field(1e9, ge=0.0)
    station: str | None = None
    channel: Channel | None = None
    power_dbm: float = Field(0.0, ge=-150.0, le=60.0, description="of the jammer")
    position_m: Vector = (0.0, 0.0, 0.0)


class RadioDescription(Description):
    """Everything the radio medium knows besides where the trains are."""

    sample_rate_hz: float = Field(gt=0.0)
    samples: int = Field(gt=0)
    carriers_hz: dict[Channel, float]
    stations: tuple[StationAntenna, ...]
    trains: tuple[str, ...]
    station_pattern: AntennaPattern = AntennaPattern()
    train_pattern: AntennaPattern = AntennaPattern(gain_dbi=6.0)
    path_loss_exponent: float = Field(2.0, ge=1.5, le=6.0)
    noise_figure_db: float = Field(8.0, ge=0.0, le=30.0)
    oscillator_ppm: float = Field(0.1, ge=0.0, le=1.0, description="1 sigma of each unit")
    sensitivity_db: float = Field(
        -20.0, ge=-60.0, le=60.0, description="links weaker than this over noise are not computed"
    )
    faults: tuple[Fault, ...] = ()

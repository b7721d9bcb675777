"""The validated description of the radio: antennas, channels, powers, faults."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from rail_msgs_py.quantities import FAULT_BEGIN, FAULT_END
from rail_msgs_py.ranging import quantities
from rail_world.line.description_base import Description, range_of

Vector = tuple[float, float, float]
Channel = Annotated[int, range_of(quantities.CHANNEL)]


class AntennaPattern(Description):
    """Directional antenna with a parabolic main lobe and a flat back (3GPP TR 36.942 form)."""

    gain_dbi: Annotated[float, range_of(quantities.GAIN)]
    beamwidth_deg: Annotated[float, range_of(quantities.BEAMWIDTH)]
    front_to_back_db: Annotated[float, range_of(quantities.FRONT_TO_BACK)]


class StationAntenna(Description):
    """One antenna of a wayside station, looking into one zone."""

    site: str
    zone: str
    position_m: Vector
    boresight: Vector
    downlink_channel: Channel
    uplink_channel: Channel
    coverage_range_m: float = Field(gt=0.0, description="distance beyond which nothing is received")


class RadioFault(Description):
    """Something that goes wrong in the radio, from and to a simulated time."""

    kind: Literal["dead_station", "jam"]
    from_s: Annotated[float, range_of(FAULT_BEGIN)]
    to_s: Annotated[float, range_of(FAULT_END)]
    station: str | None = None
    channel: Channel | None = None
    power_dbm: Annotated[float, range_of(quantities.JAMMER_POWER)] | None = None
    position_m: Vector | None = None

    @model_validator(mode="after")
    def _is_of_its_kind(self) -> RadioFault:
        wanted = {"station": self.kind == "dead_station"}
        wanted["channel"] = wanted["power_dbm"] = wanted["position_m"] = self.kind == "jam"
        for field, want in wanted.items():
            if (getattr(self, field) is not None) != want:
                raise ValueError(f"{field}: does not agree with {self.kind}")
        return self


class RadioDescription(Description):
    """Everything the radio medium knows besides where the trains are."""

    sample_rate_hz: Annotated[float, range_of(quantities.SAMPLE_RATE)]
    samples: Annotated[int, range_of(quantities.SAMPLES)]
    carriers_hz: dict[Channel, float]
    stations: tuple[StationAntenna, ...]
    trains: tuple[str, ...]
    station_pattern: AntennaPattern
    train_pattern: AntennaPattern
    path_loss_exponent: Annotated[float, range_of(quantities.PATH_LOSS_EXPONENT)]
    noise_figure_db: Annotated[float, range_of(quantities.NOISE_FIGURE)]
    oscillator_ppm: Annotated[float, range_of(quantities.OSCILLATOR)]
    sensitivity_db: float = Field(
        -20.0, ge=-60.0, le=60.0, description="links weaker than this over noise are not computed"
    )
    faults: tuple[RadioFault, ...] = ()

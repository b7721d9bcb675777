"""What a zone controller needs to give authorities, as node parameters."""

from __future__ import annotations

from dataclasses import dataclass

from rail_msgs_py.parameters import ParameterError, parameter
from rail_msgs_py.quantities import CLAIM_SIGMAS, PLACED, SEED, TICK
from rail_msgs_py.train_radio import quantities
from rail_msgs_py.train_radio.train_channel import EndSettings, controller_end
from rail_msgs_py.train_radio.unit_clock import ClockParameters, unit_clock_of

from .authority_issuer import AuthorityIssuer, Release
from .moving_block import MovingBlock
from .speed_profile import Segment, SpeedRestriction
from .train_bounds import TrainStart


@dataclass(frozen=True)
class AuthorityParameters(ClockParameters):
    """Parameters of movement authorities; arrays over the trains unless said otherwise."""

    trains: tuple[str, ...] = parameter((), "trains, in the order they enter the line")
    bases: tuple[str, ...] = parameter(
        (), "base stations of the train radio; without any, no authorities are given"
    )
    backbone: bool = parameter(
        False, "whether the backbone brings their telegrams, instead of they themselves"
    )
    segments: tuple[str, ...] = parameter((), "tracks, numbered from 0 in telegrams")
    segment_lengths_m: tuple[float, ...] = parameter((), "length of each track", unit="m")
    limit_counts: tuple[int, ...] = parameter((), "speed limits of each track", low=1)
    limit_from_m: tuple[float, ...] = parameter(
        (), "where each limit begins, one track after the other", unit="m"
    )
    limits_mps: tuple[float, ...] = parameter((), "each limit", unit="m/s", low=0.0)
    train_numbers: tuple[int, ...] = parameter((), "number in telegrams", low=1, high=0xEFFF)
    train_lengths_m: tuple[float, ...] = parameter((), "length", unit="m")
    train_segments: tuple[int, ...] = parameter((), "track", low=0)
    train_starts_m: tuple[float, ...] = parameter((), "front at first", unit="m")
    leaves_at_m: tuple[float, ...] = parameter(
        (), "where it passes to the next control area; 0 = nowhere", unit="m", low=0.0
    )
    released_trains: tuple[int, ...] = parameter(
        (), "numbers of trains that a person releases to run on sight, one for each release"
    )
    released_at_s: tuple[float, ...] = parameter((), "when, simulated time", unit="s", low=0.0)
    released_mps: tuple[float, ...] = parameter(
        (), "speed that each must not exceed on sight", unit="m/s", low=0.0
    )
    placed_m: float = PLACED.parameter()
    margin_m: float = quantities.MARGIN.parameter()
    end_margin_m: float = parameter(
        0.0, "kept before the end of a track", unit="m", low=0.0, high=1e4
    )
    buffer_m: float = quantities.BUFFER.parameter()
    authority_period_s: float = quantities.AUTHORITY_PERIOD.parameter()
    restricted_segments: tuple[int, ...] = parameter(
        (), "track of each temporary speed restriction", low=0
    )
    restricted_from_m: tuple[float, ...] = parameter((), "where each begins", unit="m")
    restricted_to_m: tuple[float, ...] = parameter((), "where each ends", unit="m")
    restricted_mps: tuple[float, ...] = parameter((), "limit of each", unit="m/s", low=0.0)
    restricted_from_s: tuple[float, ...] = parameter((), "since when each holds", unit="s")
    restricted_to_s: tuple[float, ...] = parameter((), "until when each holds", unit="s")
    validity_s: float = quantities.AUTHORITY_TIMEOUT.parameter()
    fix_sigmas: float = CLAIM_SIGMAS.parameter()
    secrets: tuple[str, ...] = parameter((), "key with each train, in hexadecimal digits")
    seed: int = SEED.parameter()
    tick_s: float = TICK.parameter()


def authority_issuer_of(p: AuthorityParameters) -> AuthorityIssuer | None:
    """Desk of the parameters, None without base stations.

    Raises
    ------
    ParameterError
        If they do not fit together.
    """
    if not p.bases:
        return None
    per_train = ("train_numbers", "train_lengths_m", "train_segments", "train_starts_m", "secrets")
    for name in (*per_train, "leaves_at_m"):
        if len(getattr(p, name)) != len(p.trains):
            raise ParameterError(
                f"zone_controller: {name}: {len(getattr(p, name))} entries for"
                f" {len(p.trains)} trains"
            )
    if not len(p.segments) == len(p.segment_lengths_m) == len(p.limit_counts):
        raise ParameterError(
            f"zone_controller: segment_lengths_m: {p.segment_lengths_m}: one, and a count of"
            f" limits, for each of {len(p.segments)} tracks"
        )
    if not len(p.limit_from_m) == len(p.limits_mps) == sum(p.limit_counts):
        raise ParameterError(
            f"zone_controller: limits_mps: {len(p.limits_mps)} for {sum(p.limit_counts)} limits"
        )
    if not len(p.released_trains) == len(p.released_at_s) == len(p.released_mps):
        raise ParameterError(
            f"zone_controller: released_at_s: {p.released_at_s}: one, and a speed, for each of"
            f" {len(p.released_trains)} releases"
        )
    per_restriction = ("from_m", "to_m", "mps", "from_s", "to_s")
    for name in (f"restricted_{each}" for each in per_restriction):
        if len(getattr(p, name)) != len(p.restricted_segments):
            raise ParameterError(
                f"zone_controller: {name}: {len(getattr(p, name))} entries for"
                f" {len(p.restricted_segments)} restrictions"
            )
    try:
        return _authority_issuer(p)
    except ValueError as error:
        raise ParameterError(f"zone_controller: {error}") from None


def _authority_issuer(p: AuthorityParameters) -> AuthorityIssuer:
    limits = list(zip(p.limit_from_m, p.limits_mps, strict=True))
    segments = []
    for number, (name, length_m, count) in enumerate(
        zip(p.segments, p.segment_lengths_m, p.limit_counts, strict=True)
    ):
        segments.append(Segment(number, name, length_m, tuple(limits[:count])))
        limits = limits[count:]
    rows = zip(
        *(p.train_numbers, p.trains, p.train_lengths_m, p.train_segments, p.train_starts_m),
        strict=True,
    )
    starts = [
        TrainStart(number, name, length_m, 1, segment, start_m, p.placed_m)
        for number, name, length_m, segment, start_m in rows
    ]
    leaves = {n: at for n, at in zip(p.train_numbers, p.leaves_at_m, strict=True) if at > 0.0}
    block = MovingBlock(
        segments,
        starts,
        margin_m=p.margin_m,
        end_margin_m=p.end_margin_m,
        buffer_m=p.buffer_m,
        validity_s=p.validity_s,
        restrictions=_restrictions(p),
        leaving=leaves,
    )
    clock = unit_clock_of(p)
    channels = {
        number: controller_end(EndSettings(secret, p.seed, number, p.tick_s, clock))
        for number, secret in zip(p.train_numbers, p.secrets, strict=True)
    }
    releases = map(Release, p.released_trains, p.released_at_s, p.released_mps)
    return AuthorityIssuer(
        block,
        channels,
        p.bases,
        leaves_at_m=leaves,
        fix_sigmas=p.fix_sigmas,
        releases=releases,
        tick_s=p.tick_s,
        period_s=p.authority_period_s,
    )


def _restrictions(p: AuthorityParameters) -> list[SpeedRestriction]:
    rows = zip(
        *(p.restricted_segments, p.restricted_from_m, p.restricted_to_m, p.restricted_mps),
        *(p.restricted_from_s, p.restricted_to_s),
        strict=True,
    )
    return [SpeedRestriction(*row) for row in rows]

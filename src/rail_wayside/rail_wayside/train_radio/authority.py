"""What a zone controller grants to a train, and its telegram."""

from __future__ import annotations

from typing import NamedTuple

from rail_msgs_py.train_radio.movement_authority import FURTHEST_M, LimitStep, MovementAuthority


class IssuedAuthority(NamedTuple):
    """How far a train may go, and why no further.

    Chainage ``end_m`` [m] is not to be passed by the front; ``limit_mps`` holds up to the first
    step; ``cause`` names what is ahead; ``shortened`` says that the one before reached further.
    A step up already lies where the rear has left the lower limit. The danger point is
    ``overlap_m`` beyond the end; ``release`` lets the train come to the end at a release speed.
    """

    train: int
    segment: int
    direction: int
    end_m: float
    limit_mps: float
    steps: tuple[LimitStep, ...]
    validity_s: float
    emergency_stop: bool
    shortened: bool
    cause: str
    overlap_m: float = 0.0
    release: bool = False


def to_telegram(
    authority: IssuedAuthority, located: tuple[float, float] | None = None
) -> MovementAuthority:
    """Telegram of an authority.

    ``located`` is where the front was by phase ranging at the time of the authority, and the
    half-width of that interval [m].
    """
    return MovementAuthority(
        authority.train,
        authority.segment,
        authority.direction,
        min(max(authority.end_m, -FURTHEST_M), FURTHEST_M),
        authority.limit_mps,
        authority.validity_s,
        authority.steps,
        authority.emergency_stop,
        located,
        authority.overlap_m,
        authority.release,
    )

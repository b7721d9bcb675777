"""Errors of the document's chain, and messages that it makes of noise alone."""

from __future__ import annotations

from typing import Final

import numpy as np

from rail_signals.arrays import BoolArray
from rail_signals.track_code.profile import TrackCodeProfile

from .baseband import draw_noise, draw_waves, snr_of
from .error_count import ErrorCount, batches
from .low_rate_chain import low_rate_chain

_MESSAGES: Final = 500
_STREAMS: Final = 50
_DECISIONS: Final = 500


def count_chain_bits(
    profile: TrackCodeProfile, density_db_hz: float, messages: int, rng: np.random.Generator
) -> ErrorCount:
    """Messages in one slot of which a level is on the wrong side of the middle."""
    errors = 0
    for count in batches(messages, _MESSAGES):
        right, _ = _received(profile, density_db_hz, count, rng)
        errors += int(np.count_nonzero(~right))
    return ErrorCount(messages, errors)


def count_chain_lost(
    profile: TrackCodeProfile, density_db_hz: float, messages: int, rng: np.random.Generator
) -> ErrorCount:
    """Messages that are not received as sent by all rules: windows, noise, check, two slots.

    Undetected are those that are received otherwise.
    """
    errors = undetected = 0
    for count in batches(messages, _MESSAGES):
        right, valid = _received(profile, density_db_hz, count, rng)
        errors += int(np.count_nonzero(~(valid & right)))
        undetected += int(np.count_nonzero(valid & ~right))
    return ErrorCount(messages, errors, undetected)


def _received(
    profile: TrackCodeProfile, density_db_hz: float, messages: int, rng: np.random.Generator
) -> tuple[BoolArray, BoolArray]:
    """Whether the bits of the last slot are those sent, and whether they are confirmed."""
    chain = low_rate_chain(profile)
    sent = chain.words.draw(rng, messages)
    wave, _ = draw_waves(profile, sent, chain.samples_for(2), rng)
    wave += draw_noise((messages, wave.shape[1]), snr_of(density_db_hz), rng)
    decided = chain.receive(wave, 2)
    return (decided.bits[:, -1] == sent).all(axis=-1), decided.confirmed[:, -1]


def count_noise_only(
    profile: TrackCodeProfile, decisions: int, rng: np.random.Generator
) -> ErrorCount:
    """Words that are confirmed where there is no carrier, among so many decisions or more.

    Of what density the noise is does not matter: a discriminator knows no level.
    """
    chain = low_rate_chain(profile)
    each = min(decisions, _DECISIONS)
    counted = errors = 0
    # One decision more: the first has none before it that it could confirm.
    samples = chain.samples_for(each + 1)
    for streams in batches(-(-decisions // each), _STREAMS):
        decided = chain.receive(draw_noise((streams, samples), 1.0, rng), each + 1)
        counted += streams * each
        errors += int(np.count_nonzero(decided.confirmed[:, 1:]))
    return ErrorCount(counted, errors, errors)

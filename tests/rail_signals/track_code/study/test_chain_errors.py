"""Errors of the chain are counted as they are, and near the bound where there is no threshold."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import binomtest

from rail_signals.arrays import BoolArray
from rail_signals.track_code.profile import load_profile
from rail_signals.track_code.study import chain_errors
from rail_signals.track_code.study.baseband import Baseband, with_deviations_scaled
from rail_signals.track_code.study.chain_errors import (
    count_chain_bits,
    count_chain_lost,
    count_noise_only,
)
from rail_signals.track_code.study.closed_forms import message_error_rate
from rail_signals.track_code.study.error_count import ErrorCount
from rail_signals.track_code.study.low_rate_chain import Decisions
from rail_signals.track_code.study.words import CheckedWords

PROFILE = load_profile("tones27")


def test_lost_wrong_and_undetected_are_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    sent = np.tile(np.arange(27) % 2 == 0, (9, 1))
    wrong = np.array([0, 0, 0, 0, 1, 1, 1, 0, 0], dtype=np.bool_)
    valid = np.array([1, 1, 1, 0, 1, 0, 0, 0, 0], dtype=np.bool_)
    bits = np.stack([~sent, sent], axis=1)  # the decision before does not count
    bits[wrong, -1, 5] ^= True
    decided = Decisions(bits, np.zeros(bits.shape), np.stack([~valid, valid], axis=1))
    fake = SimpleNamespace(
        words=SimpleNamespace(draw=lambda rng, count: sent),
        samples_for=lambda decisions: 80,
        receive=lambda wave, decisions: decided,
    )
    monkeypatch.setattr(chain_errors, "low_rate_chain", lambda profile: fake)
    rng = np.random.default_rng(1)
    assert count_chain_bits(PROFILE, 30.0, 9, rng) == ErrorCount(9, 3)
    assert count_chain_lost(PROFILE, 30.0, 9, rng) == ErrorCount(9, 6, undetected=1)


def test_every_batch_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    right = count_chain_lost(PROFILE, 45.0, 60, np.random.default_rng(2))
    assert right == ErrorCount(60, 0, undetected=0)
    monkeypatch.setattr(chain_errors, "_MESSAGES", 25)
    assert count_chain_bits(PROFILE, 15.0, 60, np.random.default_rng(2)) == ErrorCount(60, 60)
    assert count_chain_lost(PROFILE, 15.0, 60, np.random.default_rng(2)).errors == 60


def test_with_little_deviation_the_chain_is_near_its_bound() -> None:
    profile, density_db_hz = with_deviations_scaled(PROFILE, 0.25), 34.0
    found = count_chain_bits(profile, density_db_hz, 4000, np.random.default_rng(3))
    interval = binomtest(found.errors, found.messages).proportion_ci(0.999)
    assert interval.high > message_error_rate(profile, density_db_hz)
    assert interval.low < message_error_rate(profile, density_db_hz - 1.2)
    # The same carrier with the whole deviation is far above its own bound, and yet better.
    whole = count_chain_bits(PROFILE, density_db_hz, 4000, np.random.default_rng(3))
    assert whole.errors < found.errors / 4


def test_two_slots_and_all_rules_lose_more_than_bits_alone() -> None:
    bits = count_chain_bits(PROFILE, 31.0, 1500, np.random.default_rng(4))
    lost = count_chain_lost(PROFILE, 31.0, 1500, np.random.default_rng(4))
    assert lost.errors > 2 * bits.errors > 100
    assert lost.undetected == 0


def test_what_noise_confirms_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    shapes = []

    def receive(wave: Baseband, decisions: int) -> Decisions:
        shapes.append((len(wave), decisions))
        bits = np.zeros((len(wave), decisions, 27), dtype=np.bool_)
        confirmed: BoolArray = np.zeros((len(wave), decisions), dtype=np.bool_)
        confirmed[:, [0, 3, decisions - 1]] = True
        return Decisions(bits, np.zeros(bits.shape), confirmed)

    fake = SimpleNamespace(samples_for=lambda decisions: 80, receive=receive)
    monkeypatch.setattr(chain_errors, "low_rate_chain", lambda profile: fake)
    monkeypatch.setattr(chain_errors, "_STREAMS", 2)
    rng = np.random.default_rng(5)
    assert count_noise_only(PROFILE, 1100, rng) == ErrorCount(1500, 6, undetected=6)
    assert shapes == [(2, 501), (1, 501)]
    assert count_noise_only(PROFILE, 40, rng) == ErrorCount(40, 2, undetected=2)


def test_noise_alone_makes_fewer_words_than_the_check_lets_through() -> None:
    found = count_noise_only(PROFILE, 50_000, np.random.default_rng(6))
    assert found.messages == 50_000
    assert (
        binomtest(found.errors, found.messages).proportion_ci(0.999).high
        < CheckedWords(PROFILE).pass_rate
    )

"""Errors of the fits: at the bound where the carrier is strong, and counted slot by slot."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import binomtest

from rail_signals.track_code.ml import MaximumLikelihoodTones
from rail_signals.track_code.profile import load_profile
from rail_signals.track_code.study import fit_errors
from rail_signals.track_code.study.baseband import (
    RATE_HZ,
    Baseband,
    draw_waves,
    slot_samples,
    with_deviations_scaled,
)
from rail_signals.track_code.study.closed_forms import message_error_rate
from rail_signals.track_code.study.error_count import ErrorCount
from rail_signals.track_code.study.fit_errors import (
    count_ml,
    count_near,
    count_tracked,
    true_parameters,
)
from rail_signals.track_code.study.words import CheckedWords

PROFILE = load_profile("tones27")
WORDS = CheckedWords(PROFILE)
SLOT = slot_samples(PROFILE)
DEVIATIONS_HZ = np.array(PROFILE.deviations_hz)


def test_the_true_parameters_are_those_of_the_wave() -> None:
    rng = np.random.default_rng(1)
    sent = WORDS.draw(rng, 5)
    clean, phases_rad = draw_waves(PROFILE, sent, SLOT, rng)
    parameters = true_parameters(PROFILE, sent, clean, phases_rad)
    basis = MaximumLikelihoodTones(PROFILE.tones_hz, SLOT, RATE_HZ).basis
    assert np.abs(np.exp(1j * parameters @ basis) - clean).max() < 1e-3


def test_the_fit_from_the_truth_is_at_the_bound() -> None:
    """With half of the deviation, so that errors are frequent where the fit has no threshold."""
    profile, density_db_hz = with_deviations_scaled(PROFILE, 0.5), 27.0
    found = count_near(profile, density_db_hz, 3000, np.random.default_rng(2))
    bound = message_error_rate(profile, density_db_hz)
    assert found.messages == 3000
    assert found.undetected is None
    assert binomtest(found.errors, found.messages, bound).pvalue > 1e-3
    assert found.errors > 50


def test_the_search_fails_before_the_fit_does() -> None:
    rng = np.random.default_rng(3)
    strong = count_ml(PROFILE, 34.0, 30, rng)
    assert strong == ErrorCount(30, 0)
    weak = count_ml(PROFILE, 21.0, 30, rng)
    near = count_near(PROFILE, 21.0, 300, rng)
    assert weak.errors > 15
    assert near.errors < 60


class Tracker:
    """Reports the words that are sent, but in some slots."""

    def __init__(self, wrong: dict[int, int]) -> None:
        self.wrong, self.starts = wrong, list[float]()

    def __call__(self, fit: Any, hop: int) -> Tracker:
        self.sent = WORDS.draw(np.random.default_rng(4), 2)
        self.hop, self.k = hop, -1
        return self

    def next(self, wave: Baseband) -> SimpleNamespace:
        self.k += 1
        assert wave.shape == (2, SLOT)
        levels = self.sent * DEVIATIONS_HZ
        count = 2 if self.k < 64 else self.wrong.get(self.k, 0)
        levels[:count, 3] = DEVIATIONS_HZ[3] - levels[:count, 3]
        return SimpleNamespace(amplitudes_hz=levels)


def test_slots_of_tracked_words_count_after_a_while_and_do_not_overlap(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tracker = Tracker({64: 1, 65: 2, 76: 2, 77: 2, 78: 1, 116: 1})
    monkeypatch.setattr(fit_errors, "TrackedTones", tracker)
    monkeypatch.setattr(fit_errors, "_searching_fit", lambda _: SimpleNamespace(samples=SLOT))
    found = count_tracked(PROFILE, 25.0, 9, np.random.default_rng(4))
    # 13 hops of an eighth of a second are as long as a slot: 64, 77, 90, 103 and 116 count.
    assert found == ErrorCount(10, 1 + 2 + 1)
    assert tracker.hop / RATE_HZ == 0.125
    assert 13 * tracker.hop == SLOT
    assert tracker.k == 116


def test_words_that_are_tracked_are_found() -> None:
    assert count_tracked(PROFILE, 34.0, 5, np.random.default_rng(5)) == ErrorCount(5, 0)

"""The chain at 640 Hz receives as the document's receiver does at 16 kHz."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import fisher_exact

from rail_signals.arrays import BoolArray, FloatArray
from rail_signals.track_code.decision import Confirmation, Decision, judge_levels
from rail_signals.track_code.profile import load_profile
from rail_signals.track_code.reference_receiver import ReferenceTrackCodeReceiver
from rail_signals.track_code.signal import FmTransmitter
from rail_signals.track_code.study.baseband import RATE_HZ, draw_noise, draw_waves, snr_of
from rail_signals.track_code.study.low_rate_chain import (
    CARRIER_HZ,
    HOP_SAMPLES,
    INPUT_RATE_HZ,
    confirmed,
    low_rate_chain,
)

PROFILE = load_profile("tones27")
CHAIN = low_rate_chain(PROFILE)


def reference_decision(
    word: BoolArray, phases_rad: FloatArray, scale: float, rng: np.random.Generator
) -> Decision:
    """Return the last decision of the receiver at 16 kHz, with noise of that deviation."""
    samples = round(CHAIN.samples_for(2) * INPUT_RATE_HZ / RATE_HZ)
    sender = FmTransmitter(PROFILE, CARRIER_HZ, INPUT_RATE_HZ, phases_rad.tolist())
    wave = sender.block(word, samples) + rng.normal(scale=scale, size=samples)
    receiver = ReferenceTrackCodeReceiver(
        PROFILE, CARRIER_HZ, INPUT_RATE_HZ, hop_samples=HOP_SAMPLES
    )
    return receiver.feed(wave)[-1]


def test_the_same_levels_without_noise() -> None:
    rng = np.random.default_rng(1)
    sent = CHAIN.words.draw(rng, 4)
    wave, phases_rad = draw_waves(PROFILE, sent, CHAIN.samples_for(2), rng)
    decided = CHAIN.receive(wave, 2)
    assert decided.confirmed.tolist() == [[False, True]] * 4
    assert np.array_equal(decided.bits[:, -1], sent)
    for word, phases, levels in zip(sent, phases_rad, decided.levels[:, -1], strict=True):
        decision = reference_decision(word, phases, 0.0, rng)
        assert decision.valid
        assert levels == pytest.approx(decision.levels, abs=2e-4)


@pytest.mark.parametrize(("density_db_hz", "messages"), [(30.4, 60)])
def test_the_same_noise_and_as_many_lost(density_db_hz: float, messages: int) -> None:
    rng = np.random.default_rng(2)
    scale = math.sqrt(INPUT_RATE_HZ / (4 * 10 ** (density_db_hz / 10)))
    sent = CHAIN.words.draw(rng, messages)
    _, phases_rad = draw_waves(PROFILE, sent, 1, rng)
    last = [
        reference_decision(word, phases, scale, rng)
        for word, phases in zip(sent, phases_rad, strict=True)
    ]
    lost = sum(
        not (each.valid and np.array_equal(each.bits, word))
        for each, word in zip(last, sent, strict=True)
    )
    errors = np.array([each.levels for each in last]) - sent

    many = CHAIN.words.draw(rng, 20 * messages)
    wave, _ = draw_waves(PROFILE, many, CHAIN.samples_for(2), rng)
    wave += draw_noise((len(many), wave.shape[1]), snr_of(density_db_hz), rng)
    decided = CHAIN.receive(wave, 2)
    right = decided.confirmed[:, -1] & (decided.bits[:, -1] == many).all(axis=-1)
    table = [[lost, messages - lost], [int((~right).sum()), int(right.sum())]]
    assert fisher_exact(table).pvalue > 1e-3, table

    of_messages = np.mean((decided.levels[:, -1] - many) ** 2, axis=-1)
    # The mean of the few scatters as single messages do, by so many of them.
    scatter = float(of_messages.std()) / math.sqrt(messages)
    assert float(np.mean(errors**2)) == pytest.approx(of_messages.mean(), abs=4 * scatter)


def test_a_slot_is_judged_as_the_receiver_judges_it() -> None:
    rng = np.random.default_rng(3)
    sent = CHAIN.words.draw(rng, 150)
    wave, _ = draw_waves(PROFILE, sent, CHAIN.samples_for(1), rng)
    wave += draw_noise((len(sent), wave.shape[1]), snr_of(31.0), rng)
    slots = CHAIN.demodulated(wave)[:, -PROFILE.slot_samples :]
    bits, levels, valid = CHAIN.judge(slots)
    noise = CHAIN._estimator.noise(slots) / np.array(PROFILE.deviations_hz)
    reasons = set()
    for index in range(len(sent)):
        expected, fields, reason = judge_levels(PROFILE, levels[index], noise[index])
        assert np.array_equal(bits[index], expected)
        assert bool(valid[index]) == (fields is not None)
        reasons.add(reason.partition(" ")[0])
    assert {"", "level", "noise"} <= reasons


def test_confirmed_is_what_the_rule_of_the_receiver_confirms() -> None:
    rng = np.random.default_rng(4)
    bits = rng.integers(0, 2, (30, 40, 1)).astype(np.bool_)
    valid = rng.uniform(size=(30, 40)) < 0.7
    found = confirmed(bits, valid)
    assert 0.1 < found.mean() < 0.4
    for stream in range(30):
        rule = Confirmation(2)
        for k in range(40):
            if not valid[stream, k]:
                rule.reset()
            expected = bool(valid[stream, k]) and rule.confirm(bits[stream, k])
            assert found[stream, k] == expected

"""Message error rate of the track-code receivers over the carrier-to-noise density.

    python benchmarks/track_code_error_rate.py [--json FILE] [--quick] [--threshold]

The 27-tone profile, one long slot, random words at random times of the tones' common period.
Compared are, each with 95 % Clopper-Pearson intervals:

bound       `track_code_bound`: tones of unknown phase, decided one by one, from amplitudes of
            the Cramér-Rao covariance.
ML          `track_code_ml`: fit of the whole slot, searched for from scratch in every slot.
ML, near    the same fit started at the truth: what remains when the search never fails.
ML, tracked the same fit started from the slots before, eight of them a second, 8 s after the
            word began; slots that count do not overlap.
chain bits  the document's chain; a message is wrong if a level is on the wrong side of the
            middle between the windows.
chain lost  the same with all its rules: windows, noise, CRC, two slots; lost is what is not
            received as sent.

The chain is simulated at its own discriminator rate, 640 Hz, where its band-pass is the
impulse response that the band-pass and the analytic filter have there. A check compares
this with `ReferenceTrackCodeReceiver` fed at 16 kHz. Also counted: messages that noise alone makes,
and wrong messages taken for true at the density at which half are lost.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

# Before NumPy is loaded; harmless, and without effect, where it is loaded already.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scipy import fft, signal, stats

from rail_signals.track_code.bound import (
    best_threshold,
    message_error_bound,
    snr_of_message_error,
    tone_sigma_bound,
    undetected_error_probability,
    window_probabilities,
)
from rail_signals.track_code.decision import MOST_NOISE
from rail_signals.track_code.demodulator import DemodulatorChain
from rail_signals.track_code.filters import DEMODULATED_RATE_HZ, dc_rejecter, response
from rail_signals.track_code.ml import MaximumLikelihoodTones
from rail_signals.track_code.ml_tracker import TrackedTones
from rail_signals.track_code.profile import SLOT_RATE_HZ, TrackCodeProfile, load_profile
from rail_signals.track_code.reference_receiver import (
    ReferenceTrackCodeReceiver,
    receiver_estimator,
)
from rail_signals.track_code.signal import FmTransmitter
from rail_signals.track_code.word import crc

CARRIER_HZ = 1700.0
RATE_HZ = 16_000.0
HOP = 8
PERIOD_S = 12.5
"""Common period of the tones: all are multiples of 0.08 Hz."""

BAND_TAPS = 128
BATCH = 500
STREAMS = 100
SLOTS_PER_STREAM = 5
SETTLED_S = 8.0
TARGET = 1e-2
DENSITIES_DB_HZ = (
    20.0,
    21.0,
    22.0,
    23.0,
    24.0,
    25.0,
    26.0,
    27.0,
    28.0,
    29.0,
    30.0,
    31.0,
    32.0,
    33.0,
    34.0,
)
MOST_ML_DB_HZ = 30.0
LEAST_TRACKED_DB_HZ = 22.0
"""Below, words are seldom found at all, and the search for them takes hours."""


@dataclass(frozen=True)
class Count:
    """Events among trials, with the 95 % interval of Clopper and Pearson."""

    events: int
    trials: int

    @property
    def rate(self) -> float:
        """Events per trial."""
        return self.events / self.trials

    @property
    def interval(self) -> tuple[float, float]:
        """Lower and upper end."""
        k, n = self.events, self.trials
        low = float(stats.beta.ppf(0.025, k, n - k + 1)) if k else 0.0
        high = float(stats.beta.ppf(0.975, k + 1, n - k)) if k < n else 1.0
        return low, high

    def __str__(self) -> str:
        low, high = self.interval
        return f"{self.rate:.2e} [{low:.1e}, {high:.1e}]"


class Words:
    """Random words of a profile with a CRC, and their check, as arrays."""

    def __init__(self, profile: TrackCodeProfile) -> None:
        self._degree = profile.crc_polynomial.bit_length() - 1
        columns = [
            crc(profile.crc_polynomial, 1 << (i - self._degree)) if i >= self._degree else 1 << i
            for i in range(profile.tones)
        ]
        self.check = np.array(columns) >> np.arange(self._degree)[:, None] & 1
        self._inversion = profile.crc_inversion >> np.arange(self._degree) & 1

    def draw(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """Words, bool [count, tones]."""
        bits = rng.integers(0, 2, (count, self.check.shape[1]))
        bits[:, : self._degree] = 0
        bits[:, : self._degree] = (bits @ self.check.T + self._inversion) & 1
        return bits.astype(bool)

    def pass_check(self, bits: np.ndarray) -> np.ndarray:
        """Whether words, bool [..., tones], have the right CRC."""
        return np.asarray(((bits @ self.check.T & 1) == self._inversion).all(axis=-1))


class LowRateChain:
    """The chain from 640 Hz on, for many messages at once."""

    def __init__(self, profile: TrackCodeProfile) -> None:
        self.profile = profile
        self.words = Words(profile)
        self.chain = DemodulatorChain(profile, CARRIER_HZ, RATE_HZ)
        self.rate_hz = self.chain.discriminator_rate_hz
        self._every = round(self.rate_hz / DEMODULATED_RATE_HZ)
        # As many hops as the receiver takes from silence to a confirmed word.
        self.hops = math.ceil((self.chain.settling_samples + profile.slot_samples) / HOP) + 1
        self.samples = self.hops * HOP * round(self.rate_hz / SLOT_RATE_HZ)
        self.slot = profile.slot_samples * round(self.rate_hz / SLOT_RATE_HZ)
        self._estimator = receiver_estimator(self.chain)
        self._deviations = np.array(profile.deviations_hz)
        self._tones = np.array(profile.tones_hz)
        offset = np.fft.fftfreq(1024, 1 / self.rate_hz)
        band = response(self.chain.band_pass, CARRIER_HZ + offset, RATE_HZ)
        taps = self.chain.analytic_taps
        turn = -2j * math.pi * np.outer((CARRIER_HZ + offset) / RATE_HZ, np.arange(taps.size))
        # Half, since the analytic filter doubles a real wave's positive frequencies.
        self._band = np.fft.ifft(band * (np.exp(turn) @ taps) / 2)[:BAND_TAPS]
        self._waves = self._tone_waves(self.samples)

    def _tone_waves(self, samples: int) -> np.ndarray:
        wave = 2 * math.pi * np.outer(self._tones, np.arange(samples) / self.rate_hz)
        return np.concatenate([np.cos(wave), -np.sin(wave)]).astype(np.float32)

    def waves(
        self, rng: np.random.Generator, bits: np.ndarray, samples: int | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Complex baseband [n, samples] of words and the phases of their tones [n, tones]."""
        waves = self._waves if samples is None else self._tone_waves(samples)
        start = 2 * math.pi * self._tones * rng.uniform(0, PERIOD_S, (len(bits), 1))
        index = bits * (self._deviations / self._tones)
        both = np.concatenate([index * np.cos(start), index * np.sin(start)], axis=1)
        phase = -(both.astype(np.float32) @ waves)
        phase += rng.uniform(0, 2 * math.pi, (len(bits), 1)).astype(np.float32)
        return np.cos(phase) + 1j * np.sin(phase), start

    def noise(self, rng: np.random.Generator, shape: tuple[int, int], snr: float) -> np.ndarray:
        """Complex white noise [n, samples] for a carrier of amplitude 1."""
        parts = rng.standard_normal((*shape, 2), dtype=np.float32)
        return parts.view(np.complex64)[..., 0] * np.float32(math.sqrt(0.5 / snr))

    def slots_rate(self, baseband: np.ndarray) -> np.ndarray:
        """Demodulated wave at 64 Hz [n, samples / 10]."""
        count = baseband.shape[1]
        size = fft.next_fast_len(count + BAND_TAPS)
        spectrum = fft.fft(baseband, size, axis=1)
        spectrum *= fft.fft(self._band, size).astype(np.complex64)
        band = fft.ifft(spectrum, axis=1)[:, :count]
        before = np.concatenate([np.zeros((len(band), 1), band.dtype), band[:, :-1]], axis=1)
        step = band * before.conj()
        frequency = np.arctan2(step.imag, step.real) * (self.rate_hz / (2 * math.pi))
        low = signal.sosfilt(self.chain.low_pass, frequency, axis=1)
        low = low[:, self._every - 1 :: self._every]
        return np.asarray(
            signal.sosfilt(np.concatenate([dc_rejecter(), self.chain.compressor]), low, axis=1)
        )[:, 1::2]

    def judge(self, slots: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Bits and levels [..., tones] of slots [..., slot], and whether they are a message."""
        profile = self.profile
        levels = np.abs(self._estimator.amplitudes(slots)) / self._deviations
        noise = self._estimator.noise(slots) / self._deviations
        bits = levels > (profile.absent_max + profile.present_min) / 2
        present = (levels >= profile.present_min) & (levels <= profile.present_max)
        clear = (present | (levels <= profile.absent_max)).all(axis=-1)
        quiet = noise.max(axis=-1) <= MOST_NOISE
        return bits, levels, clear & quiet & self.words.pass_check(bits)

    def receive(self, baseband: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Bits and levels of the last slot [n, tones], and whether they are confirmed [n]."""
        wave = self.slots_rate(baseband)
        length = self.profile.slot_samples
        earlier, _, first = self.judge(wave[:, -length - HOP : -HOP])
        bits, levels, last = self.judge(wave[:, -length:])
        return bits, levels, first & last & (earlier == bits).all(axis=1)


@dataclass(frozen=True)
class Point:
    """Message error rates at one carrier-to-noise density."""

    density_db_hz: float
    bound: float
    ml: Count | None
    near: Count | None
    tracked: Count | None
    chain_bits: Count
    chain_lost: Count
    chain_wrong: Count


def scaled(profile: TrackCodeProfile, scale: float) -> TrackCodeProfile:
    """The profile with other deviations: small ones keep the discriminator above its threshold."""
    deviations_hz = tuple(scale * each for each in profile.deviations_hz)
    return replace(profile, deviations_hz=deviations_hz)


class Study:
    """All measurements with one seed, with the profile's deviations times ``scale``."""

    def __init__(self, seed: int = 23, scale: float = 1.0) -> None:
        self.low = LowRateChain(scaled(load_profile("tones27"), scale))
        profile = self.low.profile
        self._tones, self._deviations = np.array(profile.tones_hz), np.array(profile.deviations_hz)
        self._ml = MaximumLikelihoodTones(
            self._tones, self.low.slot, self.low.rate_hz, deviations_hz=self._deviations
        )
        self._seeds = np.random.SeedSequence(seed)

    def rng(self) -> np.random.Generator:
        """Next independent generator."""
        return np.random.default_rng(self._seeds.spawn(1)[0])

    def bound(self, density_db_hz: float) -> float:
        """Message error rate of the closed form."""
        snr = 10 ** (density_db_hz / 10) / self.low.rate_hz
        return message_error_bound(
            self._tones, self._deviations, snr, self.low.slot, self.low.rate_hz
        )

    def bound_density_db_hz(self, rate: float = TARGET) -> float:
        """Density at which the bound is `rate` [dB Hz]."""
        low = self.low
        snr = snr_of_message_error(rate, self._tones, self._deviations, low.slot, low.rate_hz)
        return 10 * math.log10(snr * low.rate_hz)

    def point(self, density_db_hz: float, messages: int, ml_messages: int) -> Point:
        """Measure one point."""
        followed = density_db_hz >= LEAST_TRACKED_DB_HZ
        rng = self.rng()
        snr = 10 ** (density_db_hz / 10) / self.low.rate_hz
        threshold = self._thresholds_hz(snr)
        bits_wrong = lost = wrong = ml_wrong = near_wrong = 0
        for start in range(0, messages, BATCH):
            count = min(BATCH, messages - start)
            sent = self.low.words.draw(rng, count)
            clean, phase = self.low.waves(rng, sent)
            wave = clean + self.low.noise(rng, clean.shape, snr)
            bits, _, valid = self.low.receive(wave)
            right = (bits == sent).all(axis=1)
            bits_wrong += int((~right).sum())
            lost += int((~(valid & right)).sum())
            wrong += int((valid & ~right).sum())
            some = min(count, ml_messages - start)
            if some > 0:
                slots = wave[:some, -self.low.slot :]
                found = np.abs(self._ml.estimate(slots).amplitudes_hz) > threshold
                ml_wrong += int((found != sent[:some]).any(axis=1).sum())
                near = self._near(sent[:some], clean[:some], phase[:some], slots) > threshold
                near_wrong += int((near != sent[:some]).any(axis=1).sum())
        return Point(
            density_db_hz,
            self.bound(density_db_hz),
            Count(ml_wrong, ml_messages) if ml_messages else None,
            Count(near_wrong, ml_messages) if ml_messages else None,
            self.tracked(density_db_hz, ml_messages) if ml_messages and followed else None,
            Count(bits_wrong, messages),
            Count(lost, messages),
            Count(wrong, messages),
        )

    def _thresholds_hz(self, snr: float) -> np.ndarray:
        """Levels that best tell a tone that is there from one that is not [tones, Hz]."""
        sigma = tone_sigma_bound(self._tones, snr, self.low.slot, self.low.rate_hz)
        ratio = (self._deviations / sigma).tolist()
        return np.asarray(sigma * [best_threshold(r) if r < 200 else r / 2 for r in ratio])

    def tracked(self, density_db_hz: float, messages: int) -> Count:
        """Slots of streams that are followed, once they had time to be found."""
        rng, low = self.rng(), self.low
        snr = 10 ** (density_db_hz / 10) / low.rate_hz
        threshold = self._thresholds_hz(snr)
        hop = HOP * round(low.rate_hz / SLOT_RATE_HZ)
        apart = math.ceil(low.slot / hop)
        first = math.ceil(SETTLED_S * SLOT_RATE_HZ / HOP)
        hops = first + (SLOTS_PER_STREAM - 1) * apart + 1
        trials = wrong = 0
        while trials < messages:
            sent = low.words.draw(rng, STREAMS)
            clean, _ = low.waves(rng, sent, low.slot + (hops - 1) * hop)
            wave = clean + low.noise(rng, clean.shape, snr)
            tracker = TrackedTones(self._ml, hop)
            for k in range(hops):
                levels = np.abs(tracker.next(wave[:, k * hop : k * hop + low.slot]).amplitudes_hz)
                if k >= first and (k - first) % apart == 0:
                    trials += STREAMS
                    wrong += int(((levels > threshold) != sent).any(axis=1).sum())
        return Count(wrong, trials)

    def _near(
        self, sent: np.ndarray, clean: np.ndarray, phase: np.ndarray, slots: np.ndarray
    ) -> np.ndarray:
        """Levels [n, tones, Hz] of the fit that starts at the truth."""
        middle_s = (self.low.samples - (self.low.slot + 1) / 2) / self.low.rate_hz
        turn = phase + 2 * math.pi * self._tones * middle_s
        # The deviation is A sin(turn + 2 pi F t): x = A sin(turn), y = A cos(turn).
        parts = [
            np.zeros((len(sent), 2)),
            sent * self._deviations * np.sin(turn),
            sent * self._deviations * np.cos(turn),
        ]
        start = np.concatenate(parts, axis=1)
        model = np.exp(1j * start @ self._ml.basis)
        start[:, 0] = np.angle((clean[:, -self.low.slot :] * model.conj()).mean(axis=1))
        return np.abs(self._ml.refine(slots, start).amplitudes_hz)

    def equivalence(self, density_db_hz: float, messages: int) -> dict[str, Count | float]:
        """Messages lost and error of the levels, at 16 kHz and at 640 Hz."""
        rng, low = self.rng(), self.low
        scale = math.sqrt(RATE_HZ / (4 * 10 ** (density_db_hz / 10)))
        lost = 0
        square = 0.0
        sent = low.words.draw(rng, messages)
        for word in sent:
            phases = 2 * math.pi * self._tones * rng.uniform(0, PERIOD_S)
            sender = FmTransmitter(low.profile, CARRIER_HZ, RATE_HZ, phases.tolist())
            wave = sender.block(word, round(low.hops * HOP * RATE_HZ / SLOT_RATE_HZ))
            wave += rng.normal(scale=scale, size=wave.size)
            receiver = ReferenceTrackCodeReceiver(low.profile, CARRIER_HZ, RATE_HZ, hop_samples=HOP)
            last = receiver.feed(wave)[-1]
            lost += not (last.valid and np.array_equal(last.bits, word))
            square += float(np.mean((last.levels - word) ** 2))
        sent = low.words.draw(rng, 10 * messages)
        clean, _ = low.waves(rng, sent)
        snr = 10 ** (density_db_hz / 10) / low.rate_hz
        bits, levels, valid = low.receive(clean + low.noise(rng, clean.shape, snr))
        right = valid & (bits == sent).all(axis=1)
        return {
            "lost at 16 kHz": Count(lost, messages),
            "lost at 640 Hz": Count(int((~right).sum()), len(sent)),
            "level error at 16 kHz": math.sqrt(square / messages),
            "level error at 640 Hz": math.sqrt(float(np.mean((levels - sent) ** 2))),
        }

    def noise_only(self, decisions: int) -> dict[str, int]:
        """What noise without a carrier makes of so many decisions."""
        rng, low = self.rng(), self.low
        streams, hops = 50, 500
        length, lead = low.profile.slot_samples, low.hops * HOP
        found = {"decisions": 0, "pass windows, noise and CRC": 0, "confirmed": 0}
        while found["decisions"] < decisions:
            samples = (lead + hops * HOP) * round(low.rate_hz / SLOT_RATE_HZ)
            wave = low.slots_rate(low.noise(rng, (streams, samples), 1.0))
            view = np.lib.stride_tricks.sliding_window_view(wave[:, lead - length :], length, 1)
            bits, _, valid = low.judge(view[:, HOP::HOP])
            same = (bits[:, 1:] == bits[:, :-1]).all(axis=2)
            found["decisions"] += valid.size
            found["pass windows, noise and CRC"] += int(valid.sum())
            found["confirmed"] += int((valid[:, 1:] & valid[:, :-1] & same).sum())
        return found

    def predicted_undetected(self, density_db_hz: float, confirmations: int) -> float:
        """By closed form, with efficient amplitudes and the windows of the profile."""
        low, profile = self.low, self.low.profile
        snr = 10 ** (density_db_hz / 10) / low.rate_hz
        ratio = self._deviations / tone_sigma_bound(self._tones, snr, low.slot, low.rate_hz)
        windows = (profile.absent_max, profile.present_min, profile.present_max)
        right, wrong = window_probabilities(ratio, *(w * ratio for w in windows))
        return undetected_error_probability(right, wrong, low.words.check, confirmations)


def density_at(points: Sequence[tuple[float, float]], rate: float) -> float | None:
    """Density [dB Hz] at which rates fall to `rate`, by interpolation of their logarithm."""
    for (a_db, a), (b_db, b) in itertools.pairwise(points):
        if a >= rate >= b and a > 0:
            share = math.log(a / rate) / math.log(a / b) if b > 0 else 1.0
            return a_db + (b_db - a_db) * share
    return None


def threshold(quick: bool = False) -> None:
    """Print what the chain loses to the bound as the deviation shrinks."""
    messages = 500 if quick else 4000
    for scale in (1.0, 0.5, 0.25, 0.15):
        study = Study(scale=scale)
        bound_db = study.bound_density_db_hz()
        first = max(30.0, math.floor(bound_db))
        curve = []
        for step in range(8):
            point = study.point(first + step, messages, 0)
            curve.append((first + step, point.chain_bits.rate))
        at = density_at(curve, TARGET)
        print(
            f"deviations x {scale:4.2f}: bound 1e-2 at {bound_db:5.2f} dB Hz, chain bits at"
            f" {at or math.nan:5.2f}, loss {(at or math.nan) - bound_db:5.2f} dB"
        )


def measure(quick: bool = False) -> dict[str, object]:
    """All figures; prints the table as it grows."""
    study = Study()
    part = 20 if quick else 1
    bound_db = study.bound_density_db_hz()
    print(f"bound 1e-2 at {bound_db:.2f} dB Hz (27 tones, {study.low.profile.slot_s} s)")
    names = ("ML, near", "ML, tracked", "ML", "chain bits", "chain lost")
    print(f"{'C/N0':>5} {'bound':>8}  " + " ".join(f"{name:27}" for name in names))
    points = []
    for density in DENSITIES_DB_HZ:
        points.append(
            study.point(density, 10_000 // part, 1000 // part if density <= MOST_ML_DB_HZ else 0)
        )
        p = points[-1]
        cells = [p.near, p.tracked, p.ml, p.chain_bits, p.chain_lost]
        print(f"{density:5.1f} {p.bound:8.1e}  " + " ".join(f"{c or '-'!s:27}" for c in cells))
    losses: dict[str, float | None] = {}
    for name in ("near", "tracked", "ml", "chain_bits", "chain_lost"):
        curve = [(p.density_db_hz, c.rate) for p in points if (c := getattr(p, name)) is not None]
        at = density_at(curve, TARGET)
        losses[name] = None if at is None else at - bound_db
        print(
            f"{name:12} 1e-2 at {at or math.nan:6.2f} dB Hz, loss {losses[name] or math.nan:6.2f}"
        )
    half_db = density_at([(p.density_db_hz, p.chain_lost.rate) for p in points], 0.5)
    assert half_db is not None
    same = study.equivalence(half_db, 600 // part)
    print("equivalence:", {k: str(v) for k, v in same.items()})
    undetected = study.point(half_db, 100_000 // part, 0)
    print(
        f"at {half_db:.2f} dB Hz lost {undetected.chain_lost},"
        f" undetected wrong {undetected.chain_wrong.events} of {undetected.chain_wrong.trials}"
        f" [{undetected.chain_wrong.interval[1]:.1e}]"
    )
    predicted = {
        f"{db:.2f} dB Hz, {slots} slots": study.predicted_undetected(db, slots)
        for db in (bound_db, half_db)
        for slots in (1, 2)
    }
    print("undetected by closed form, efficient amplitudes:", predicted)
    noise = study.noise_only(1_000_000 // part)
    print("noise alone:", noise)
    return {
        "bound_db_hz": bound_db,
        "points": [asdict(p) for p in points],
        "loss_db": losses,
        "equivalence": {k: asdict(v) if isinstance(v, Count) else v for k, v in same.items()},
        "half_lost_db_hz": half_db,
        "undetected": asdict(undetected),
        "undetected_closed_form": predicted,
        "noise_only": noise,
    }


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="file to write")
    parser.add_argument("--quick", action="store_true", help="a twentieth of the trials")
    parser.add_argument(
        "--threshold", action="store_true", help="only: the chain's loss as the deviation shrinks"
    )
    options = parser.parse_args()
    if options.threshold:
        threshold(options.quick)
        return
    values = measure(options.quick)
    if options.json:
        options.json.write_text(json.dumps(values, indent=2) + "\n")


if __name__ == "__main__":
    main()

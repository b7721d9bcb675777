"""Seconds of track-code signal decoded per CPU-second, beside SciPy and GNU Radio.

One carrier of the 27-tone profile at 16 or 48 kHz, a new word every 20 s (a block of 1500 m
at 300 km/h lasts 18 s), 20 dB of signal-to-noise ratio in the band of the input. All sides
start from the same single-precision samples in memory, decide every 1/8 s and must find the
words sent. Peers do the least that suffices: mixer, low-pass, discriminator, low-pass to
64 Hz, amplitudes of the tones in a sliding slot by least squares, a threshold. The receiver
also looks for faults of the input, rejects DC, weighs with the noise's spectrum, checks
windows, noise, CRC and confirmation, and watches for a change of the word; each of its
decisions is compared with that of `ReferenceTrackCodeReceiver` before anything is timed. GNU Radio
runs twice: alone, which is the peer, and as front end of one NumPy product, which is told.

The bound is one reading of the samples, and the multiplications of filters, tones and residuals at
the rate of a large product of matrices: no discriminator, no decisions, no checks.

CPU time of one process is counted; matrix products use one thread. Each round takes the middle
of a few passes on each side, the figure is the median of the rounds.
"""

from __future__ import annotations

import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

# Before NumPy is loaded; harmless, and without effect, where it is loaded already.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scipy import signal

from rail_signals.track_code.decision import Decision
from rail_signals.track_code.profile import SLOT_RATE_HZ, TrackCodeProfile, load_profile
from rail_signals.track_code.receiver import TrackCodeReceiver
from rail_signals.track_code.reference_receiver import ReferenceTrackCodeReceiver
from rail_signals.track_code.signal import FmTransmitter
from rail_signals.track_code.tone_levels import tone_estimator
from rail_signals.track_code.word import encode

PEER = Path(__file__).parent / "peers" / "gnuradio_track_code.py"
RATES = {"track_code.decode_16k": 16_000.0, "track_code.decode_48k": 48_000.0}
CARRIER_HZ = 1700.0
MIDDLE_HZ = 640.0
HOP = 8
SNR = 100.0
WORDS = 12
WORD_S = 20.0
SETTLED_S = 2.5
ROUNDS = 7
_SIDE = 512
PASSES = 5


@dataclass(frozen=True)
class Case:
    """Samples float32 [n] at a rate, and the words sent, as integers [WORDS]."""

    rate_hz: float
    samples: np.ndarray
    words: tuple[int, ...]
    profile: TrackCodeProfile

    @property
    def duration_s(self) -> float:
        """Length of the signal [s]."""
        return float(self.samples.size / self.rate_hz)

    def check(self, times_s: np.ndarray, words: np.ndarray, who: str) -> None:
        """Refuse to report the speed of a wrong result.

        Decisions within 2.5 s of a change, mixtures of two words, are left out.
        """
        index = np.ceil(times_s / WORD_S).astype(int) - 1
        settled = times_s - index * WORD_S > SETTLED_S
        wrong = words[settled] != np.array(self.words)[index[settled]]
        if wrong.any() or not settled.any():
            raise RuntimeError(f"{who}: {int(wrong.sum())} of {settled.sum()} words are wrong")


@dataclass(frozen=True)
class Peer:
    """Design of the chain that peers run: taps at the input rate and at 640 Hz, tones."""

    front: np.ndarray
    back: np.ndarray
    matrix: np.ndarray
    threshold: np.ndarray


def rows(names: tuple[str, ...] = ()) -> Iterator[dict[str, Any]]:
    """Measure, and yield one row per figure; only those whose names begin as one of `names`."""
    python = _peer_python()
    for name, rate_hz in RATES.items():
        if not names or any(name.startswith(wanted) for wanted in names):
            yield _row(name, rate_hz, python)


def _row(name: str, rate_hz: float, python: str | None) -> dict[str, Any]:
    """Measure one row."""
    rng = np.random.default_rng(17)
    case = _case(rng, load_profile("tones27"), rate_hz)
    _compare(case)
    design = _design(case)
    ours: list[float] = []
    plain: list[float] = []
    bounds: list[float] = []
    radio: dict[str, list[float]] = {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "signal.npz"
        _save(path, case, design)
        for _ in range(ROUNDS):  # in turns, so that all see the same machine
            ours.append(case.duration_s / _cpu_s(lambda: _receive(case)))
            bounds.append(case.duration_s / _least_s(case))
            plain.append(case.duration_s / _cpu_s(lambda: _receive_plain(case, design)))
            if python:
                for form, rate in _radio_rates(python, path, case).items():
                    radio.setdefault(form, []).append(rate)
    rates = {"SciPy": statistics.median(plain)}
    if radio:
        rates["GNU Radio"] = statistics.median(radio["alone"])
    best = max(rates, key=lambda k: rates[k])
    mine = statistics.median(ours)
    others = [f"{k} {v:.0f}" for k, v in rates.items() if k != best]
    if radio:
        mixed = statistics.median(radio["with_numpy"])
        others.append(f"GNU Radio to 64 Hz and NumPy for the tones {mixed:.0f}")
    else:
        others.append("GNU Radio not installed")
    return {
        "name": name,
        "unit": "s/CPU-s",
        "ours": mine,
        "peer_name": f"{best} ({', '.join(others)})",
        "peer": rates[best],
        "ratio": mine / rates[best],
        "bound": statistics.median(bounds),
    }


def _case(rng: np.random.Generator, profile: TrackCodeProfile, rate_hz: float) -> Case:
    """Draw words and the wave that carries them, in noise."""
    transmitter = FmTransmitter(profile, CARRIER_HZ, rate_hz)
    waves, words = [], []
    for _ in range(WORDS):
        fields = {n: int(rng.integers(2**b)) for n, b in profile.fields if n != "crc"}
        bits = encode(profile, fields)
        words.append(_number(bits))
        waves.append(transmitter.block(bits, round(WORD_S * rate_hz)))
    wave = np.concatenate(waves)
    # The power of a real wave of amplitude 1 is a half.
    wave += rng.normal(scale=math.sqrt(0.5 / SNR), size=wave.size)
    return Case(rate_hz, wave.astype(np.float32), tuple(words), profile)


def _number(bits: np.ndarray) -> int:
    return int(bits @ (1 << np.arange(bits.size, dtype=np.int64)))


def _cpu_s(call: Callable[[], object]) -> float:
    """CPU time of a pass [s], median of some."""
    cpu_s = []
    for _ in range(PASSES):
        start = time.process_time()
        call()
        cpu_s.append(time.process_time() - start)
    return statistics.median(cpu_s)


def _receive(case: Case) -> list[Decision]:
    """All decisions of the fast receiver; its design is not part of the time."""
    receiver = _receiver(case)
    receiver.reset()
    return receiver.feed(case.samples)


def _least_s(case: Case) -> float:
    """CPU time of the receiver's multiplications alone [s], and of one reading of the samples."""
    receiver = _receiver(case)
    front, band, low_pass, *_ = receiver._fast_demodulator._tables
    fast_hz = receiver.chain.discriminator_rate_hz
    slots = sum(table.size for table in receiver._tables[:3]) / HOP
    each_s = fast_hz * (front.size + 2 * band.size) + 128.0 * low_pass.size + SLOT_RATE_HZ * slots
    square = np.ones((_SIDE, _SIDE), np.float32)
    product_s = _cpu_s(lambda: np.matmul(square, square))
    reading_s = _cpu_s(lambda: case.samples.max())
    return reading_s + product_s * case.duration_s * each_s / _SIDE**3


_RECEIVERS: dict[float, TrackCodeReceiver] = {}


def _receiver(case: Case) -> TrackCodeReceiver:
    if case.rate_hz not in _RECEIVERS:
        _RECEIVERS[case.rate_hz] = TrackCodeReceiver(
            case.profile, CARRIER_HZ, case.rate_hz, hop_samples=HOP
        )
    return _RECEIVERS[case.rate_hz]


def _compare(case: Case) -> None:
    """Every decision of the fast receiver is that of the document's chain, and right."""
    fast = _receive(case)
    chain = ReferenceTrackCodeReceiver(case.profile, CARRIER_HZ, case.rate_hz, hop_samples=HOP)
    slow = chain.feed(case.samples)
    same = len(fast) == len(slow) and all(
        np.array_equal(a.bits, b.bits) and a.valid == b.valid and a.fields == b.fields
        for a, b in zip(fast, slow, strict=True)
    )
    if not same:
        raise RuntimeError("fast receiver: decisions differ from those of the chain")
    valid = [d for d in fast if d.valid]
    times_s = np.array([d.time_s for d in valid])
    # Of the word before, a word may count for a few hops until its change is noticed.
    case.check(times_s, np.array([_number(d.bits) for d in valid]), "fast receiver")
    if len(valid) < 0.85 * len(fast):
        raise RuntimeError(f"fast receiver: only {len(valid)} of {len(fast)} decisions are valid")


def _design(case: Case) -> Peer:
    """Filters and tone matrix of the peers."""
    profile = case.profile
    front = _low_pass(180.0, 400.0, case.rate_hz)
    back = _low_pass(18.0, 46.0, MIDDLE_HZ)
    _, gain = signal.freqz(back, 1, np.array(profile.tones_hz), fs=MIDDLE_HZ)
    estimator = tone_estimator(profile.tones_hz, SLOT_RATE_HZ, profile.slot_samples, gain=gain)
    return Peer(
        front.astype(np.float32),
        back.astype(np.float32),
        estimator.matrix.astype(np.complex64),
        0.5 * np.array(profile.deviations_hz),
    )


def _low_pass(pass_hz: float, stop_hz: float, rate_hz: float) -> np.ndarray:
    """Taps of a low-pass of 50 dB."""
    taps, beta = signal.kaiserord(50.0, (stop_hz - pass_hz) / (rate_hz / 2))
    middle_hz = (pass_hz + stop_hz) / 2
    return np.asarray(signal.firwin(taps | 1, middle_hz, window=("kaiser", beta), fs=rate_hz))


def _receive_plain(case: Case, design: Peer) -> tuple[np.ndarray, np.ndarray]:
    """Straightforward SciPy: mixer, polyphase decimator, discriminator, tones."""
    number = np.arange(case.samples.size)
    mixer = np.exp(-2j * np.pi * CARRIER_HZ / case.rate_hz * number).astype(np.complex64)
    low = signal.upfirdn(design.front, case.samples * mixer, down=round(case.rate_hz / MIDDLE_HZ))
    frequency = np.angle(low[1:] * low[:-1].conj()) * np.float32(MIDDLE_HZ / (2 * np.pi))
    slow = signal.upfirdn(design.back, frequency, down=round(MIDDLE_HZ / SLOT_RATE_HZ))
    slots = np.lib.stride_tricks.sliding_window_view(slow, design.matrix.shape[1])[::HOP]
    levels = np.abs(slots @ design.matrix.T)
    bits = levels > design.threshold
    words = bits @ (1 << np.arange(bits.shape[1], dtype=np.int64))
    times_s = (np.arange(len(words)) * HOP + design.matrix.shape[1]) / SLOT_RATE_HZ
    return times_s, words


def _save(path: Path, case: Case, design: Peer) -> None:
    """Write what the peer reads, having checked the design by the plain chain."""
    case.check(*_within(case, *_receive_plain(case, design)), "SciPy")
    np.savez(
        path,
        samples=case.samples,
        rate_hz=case.rate_hz,
        carrier_hz=CARRIER_HZ,
        matrix=design.matrix,
        threshold=design.threshold,
        hop=HOP,
        front_taps=design.front,
        back_taps=design.back,
    )


def _within(case: Case, times_s: np.ndarray, words: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Decisions whose slot ends before the signal does."""
    inside = times_s <= case.duration_s - 0.1
    return times_s[inside], words[inside]


def _peer_python() -> str | None:
    """Find an interpreter that has GNU Radio; None where there is none."""
    for candidate in (sys.executable, "/usr/bin/python3"):
        if Path(candidate).exists():
            probe = [candidate, "-c", "import gnuradio.analog, gnuradio.filter"]
            if subprocess.run(probe, capture_output=True, check=False).returncode == 0:
                return candidate
    return None


def _radio_rates(python: str, path: Path, case: Case) -> dict[str, float]:
    """Seconds of signal per CPU-second of both forms of GNU Radio."""
    done = subprocess.run(
        [python, str(PEER), str(path), str(PASSES)], capture_output=True, text=True, check=True
    )
    slot = case.profile.slot_samples
    rates = {}
    for form, answer in json.loads(done.stdout).items():
        words = np.array(answer["words"])
        times_s = (np.arange(len(words)) * HOP + slot) / SLOT_RATE_HZ
        case.check(*_within(case, times_s, words), f"GNU Radio {form}")
        rates[form] = float(case.duration_s / statistics.median(answer["cpu_s"]))
    return rates


def main() -> None:
    """Print the rows."""
    for row in rows():
        print(
            f"{row['name']:24} {row['ours']:8.0f} {row['unit']}"
            f"  {row['peer_name']}: {row['peer']:.0f}  ratio {row['ratio']:.2f} x"
            f"  bound {row['bound']:.0f}"
        )


if __name__ == "__main__":
    main()

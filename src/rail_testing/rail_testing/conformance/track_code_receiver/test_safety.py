"""Safety of a receiver of track codes: a word that was not sent lets a train run."""

from __future__ import annotations

import array
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from rail_msgs_py.topics.track_code import CODE_RX
from rail_msgs_py.waveform import HEADER_VALUES, Waveform
from rail_testing.conformance.bench import Bench
from rail_testing.conformance.track_code_receiver.kind import HELD_S, KIND

REQUIREMENT = pytest.mark.requirement
Change = Callable[[np.ndarray[Any, Any], float], np.ndarray[Any, Any]]


def replace_pick_up(bench: Bench, change: Change) -> None:
    """Let a function of its samples and of the time in the block take the place of the pick-up."""

    def altered(message: Any) -> Any:
        block = Waveform.from_msg(message)
        if block.silent:
            return message
        data = np.array(message.data)
        real = data[HEADER_VALUES::2]
        data[HEADER_VALUES::2] = change(real, block.stamp_ns * 1e-9)
        message.data = array.array("d", data.tobytes())
        return message

    bench.corridor.intercept(CODE_RX.name(train=bench.place), altered)


@REQUIREMENT("S3 eq 8, resolution of the tones; DESIGN, What a claim is")
@pytest.mark.parametrize("snr_db", [20.0, 6.0, -3.0])
def test_no_wrong_word_at_any_signal_to_noise_ratio(bench: Bench, snr_db: float) -> None:
    """White noise in the whole band: each valid word was sent; at 20 and 6 dB there are words."""
    bench.start()
    bench.run_until_working(KIND.starts_within_s, "after the start")
    generator = np.random.default_rng(4)

    def noisy(samples: np.ndarray[Any, Any], _: float) -> np.ndarray[Any, Any]:
        power = float(np.mean(samples**2))
        sigma = np.sqrt(power * 10.0 ** (-snr_db / 10.0))
        return np.asarray(samples + sigma * generator.standard_normal(samples.size))

    replace_pick_up(bench, noisy)
    heard = 0

    def count() -> str:
        nonlocal heard
        heard += KIND.working(bench)
        return ""

    bench.run(HELD_S)
    bench.run(15.0, count)
    if snr_db >= 6.0 and not heard:
        bench.refuse(f"has understood no word at {snr_db:g} dB")


@REQUIREMENT("S3 section 3.1, no code in noise")
@pytest.mark.parametrize("level", [1e-3, 1.0])
def test_in_noise_there_is_no_word(bench: Bench, level: float) -> None:
    """The code ceases and noise of a level takes its place: soon there is no valid word."""
    bench.start()
    bench.run_until_working(KIND.starts_within_s, "after the start")
    generator = np.random.default_rng(5)
    replace_pick_up(bench, lambda samples, _: level * generator.standard_normal(samples.size))
    bench.run(HELD_S, claims=False)

    def word() -> str:
        if not KIND.working(bench):
            return ""
        return f"has the valid word {int(KIND.message(bench).word):#x}, in noise without a code"

    bench.run(20.0, word, claims=False)


@REQUIREMENT("S3 section 2, a carrier alone is no message")
def test_a_carrier_without_a_code_is_no_word(bench: Bench) -> None:
    """Unmodulated carriers of each frequency in turn."""
    bench.start()
    bench.run_until_working(KIND.starts_within_s, "after the start")
    rate_hz = float(bench.parameters["sample_rate_hz"])
    carriers_hz = [float(each) for each in bench.parameters["carriers_hz"]]
    begun_s = bench.corridor.time_s

    def carrier(samples: np.ndarray[Any, Any], time_s: float) -> np.ndarray[Any, Any]:
        which = int((time_s - begun_s) // 15.0) % len(carriers_hz)
        times_s = time_s + np.arange(samples.size) / rate_hz
        return np.asarray(np.cos(2.0 * np.pi * carriers_hz[which] * times_s))

    replace_pick_up(bench, carrier)
    bench.run(HELD_S, claims=False)

    def word() -> str:
        return "has a valid word of a carrier without a code" if KIND.working(bench) else ""

    bench.run(30.0, word, claims=False)


@REQUIREMENT("S3 section 3, a code that ceases; IEEE 1474.1 6.1, fail-safe reaction [M]")
@pytest.mark.parametrize("after", ["silence", "next to nothing"])
def test_a_code_that_ceases_leaves_no_word(bench: Bench, after: str) -> None:
    """Nothing is picked up any more: within two slots there is no valid word."""
    bench.start()
    bench.run_until_working(KIND.starts_within_s, "after the start")
    if after == "silence":

        def silent(message: Any) -> Any:
            block = Waveform.from_msg(message)
            head = (block.stamp_ns, block.sample_rate_hz, block.carrier_hz, block.channel)
            return Waveform(*head, np.zeros((1, 0), dtype=np.complex128)).to_msg()

        bench.corridor.intercept(CODE_RX.name(train=bench.place), silent)
    else:
        replace_pick_up(bench, lambda samples, _: 1e-6 * samples)
    bench.run(HELD_S, claims=False)
    bench.run(10.0, lambda: KIND.believes_garbage(bench), claims=False)

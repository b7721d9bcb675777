"""The channel of one link in double precision, sample by sample: oracle of the compiled one."""

from __future__ import annotations

import math

import numpy as np

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_signals.train_radio.mimo_fading import MimoFading
from rail_world.train_radio.links import Links


def gains(
    seed: int,
    links: Links,
    link: tuple[int, int, int],
    time_s: FloatArray,
    carrier_hz: float,
    rician_factor: float,
) -> ComplexArray:
    """Gains [rx, tx, time] of a link (base, train, direction), two antennas at either end."""
    base, train, direction = link
    key = [seed, 7, base, train, direction]
    rng = np.random.Generator(np.random.Philox(np.random.SeedSequence(key)))
    wavelength_m = SPEED_OF_LIGHT_M_PER_S / carrier_hz
    turns = rng.uniform(size=(2, 1)) + rng.uniform(size=2)
    field = MimoFading(rng, 2, 2, wavelength_m)
    since_s = time_s - links.tick_s
    moved_m = links.speed_mps[train] * since_s + 0.5 * links.acceleration_mps2[train] * since_s**2
    away_m = links.distance_m[base, train]
    distance_m = np.sqrt(away_m**2 + 2.0 * away_m * links.sight[base, train] * moved_m + moved_m**2)
    sight = np.exp(2j * math.pi * (turns[..., None] - distance_m / wavelength_m))
    h = field.at(links.path_m[train] + moved_m) + math.sqrt(rician_factor) * sight
    start, end = 10.0 ** (links.gain_db[direction, :, base, train] / 20.0)
    path = start + (end - start) * time_s / links.tick_s
    return np.asarray(h * path / math.sqrt(1.0 + rician_factor))

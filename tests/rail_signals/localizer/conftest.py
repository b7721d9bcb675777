"""A train, its sensors and its localizer, for tests of the localizer as a whole."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
import pytest

from rail_signals.localizer.localizer import Localizer
from rail_signals.localizer.protection_level import Localization
from rail_signals.localizer.readings import (
    BlockEntry,
    DopplerFix,
    RangeFix,
    TickMeasurements,
    WheelSpeed,
)
from rail_signals.localizer.settings import LocalizerSettings, Sensor

DEFAULT = LocalizerSettings()
TICK_S = 0.1
#: Of a tick, by the names of `TickMeasurements`.
Readings: TypeAlias = dict[str, Any]


@dataclass
class Trip:
    """A train at a constant speed, its sensors and its localizer."""

    settings: LocalizerSettings = DEFAULT
    speed_mps: float = 20.0
    sensors: frozenset[Sensor] = frozenset(Sensor)
    seed: int = 1
    tick_s: float = TICK_S
    tick: int = 0
    path_m: float = 1000.0
    history: list[Localization] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.seed)
        self.localizer = Localizer(self.settings)

    @property
    def chainage_m(self) -> float:
        return self.settings.direction * self.path_m

    @property
    def velocity_mps(self) -> float:
        return self.settings.direction * self.speed_mps

    def place(self) -> Trip:
        self.localizer.place(self.chainage_m, 1.0, speed_mps=self.velocity_mps, sigma_mps=0.1)
        return self

    def run(
        self, seconds: float, falsify: Callable[[Readings], None] | None = None
    ) -> Localization:
        """Let time pass; `falsify` may change what the sensors report."""
        for _ in range(round(seconds / self.tick_s)):
            before_m = self.path_m
            self.tick += 1
            self.path_m += self.speed_mps * self.tick_s
            now_s = self.tick * self.tick_s
            noise = [float(n) for n in self.rng.standard_normal(4)]
            s, v = self.chainage_m, self.velocity_mps
            readings: Readings = {}
            if Sensor.RANGE in self.sensors:
                readings["range"] = RangeFix(s + 0.2 * noise[0], 0.04, 0.0)
            if Sensor.DOPPLER in self.sensors and self.speed_mps > 0.0:
                readings["doppler"] = DopplerFix(
                    s + 2.0 * noise[1], v + 0.2 * noise[2], 4.0, 0.0, 0.04, 0.0
                )
            if Sensor.ODOMETER in self.sensors:
                wheel_mps = 1.005 * self.speed_mps + 0.03 * noise[3] * (self.speed_mps > 0.0)
                readings["odometer"] = WheelSpeed(wheel_mps, 0.0)
            joint = np.floor(self.path_m / 500.0)
            if Sensor.BLOCK in self.sensors and joint > np.floor(before_m / 500.0):
                joint_m = self.settings.direction * 500.0 * joint
                readings["block"] = BlockEntry(joint_m, 0.0)
            if falsify is not None:
                falsify(readings)
            estimate = self.localizer.tick(now_s, TickMeasurements(**readings))
            self.history.append(Localization.of(estimate))
        return self.history[-1]

    def holds(self, here: Localization) -> bool:
        return here.low_m <= self.chainage_m <= here.high_m


@pytest.fixture
def new_trip() -> type[Trip]:
    """Return what makes a train with its sensors and its localizer."""
    return Trip

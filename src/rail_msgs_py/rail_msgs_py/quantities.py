"""Quantities that are common to all equipment: time, trains, and what is assumed of positions."""

from __future__ import annotations

from typing import Final, Literal, get_args

from .quantity import NEEDED, Quantity

TICK: Final = Quantity(0.1, "time of one tick", unit="s", low=0.01, high=1.0)
SEED: Final = Quantity(1, "seed of every random draw", low=0, high=2**63 - 1)

END_WHEN_ARRIVED: Final = Quantity(False, "whether to end earlier, once every train has arrived")

PATIENCE: Final = Quantity(
    60.0,
    "a train that stands for longer without a reason is stuck",
    unit="s",
    low=1.0,
    high=1e5,
)

FAULT_BEGIN: Final = Quantity(0.0, "start", unit="s", low=0.0, high=1e6)
FAULT_END: Final = Quantity(1e6, "end", unit="s", low=0.0, high=1e6)
SLIP_RATIO: Final = Quantity(
    NEEDED, "speed of the wheels over that of the train", low=0.0, high=3.0
)
BRAKE_FACTOR: Final = Quantity(1.0, "what is left of the force of a brake", low=0.0, high=1.0)
ADHESION: Final = Quantity(
    NEEDED, "adhesion of wheels on rails, 0.3 dry, 0.05 under leaves", low=0.01, high=0.6
)

TRAIN_START: Final = Quantity(
    0.0,
    "chainage of its front on its first track when it is put into service",
    unit="m",
    low=0.0,
    high=1e6,
)
TRAIN_LENGTH: Final = Quantity(100.0, "length over couplers", unit="m", low=1.0, high=2000.0)
Direction = Literal[1, -1]
DIRECTION: Final[Quantity[Direction]] = Quantity(
    1, "+1 runs towards increasing chainage, -1 towards decreasing", choices=get_args(Direction)
)
#: For equipment that finds out by itself which way the train runs.
DIRECTION_OR_UNKNOWN: Final = DIRECTION.but(
    text=f"{DIRECTION.text}, 0 = not known", choices=(*DIRECTION.choices, 0)
)
CAB_SIGNALS: Final = Quantity(
    True, "whether drivers keep to the permitted speed before the brake makes them"
)

ODOMETER_ERROR: Final = Quantity(
    0.005, "standard deviation of the wheels' relative error", low=0.0, high=0.1
)
#: Distances and fixes may be off by this many standard deviations.
CLAIM_SIGMAS: Final = Quantity(
    4.0, "half-width of a claimed interval, in standard deviations", low=1.0, high=10.0
)
ALLOWED_ODOMETER_ERROR: Final = ODOMETER_ERROR.derived(
    lambda sigma: CLAIM_SIGMAS.default * sigma,
    "relative error of distances that must be allowed for",
)
#: What the dispatcher knows of where a train is when it is put into service.
PLACED: Final = Quantity(
    1.0, "how well the front is known when put into service", unit="m", low=0.0, high=1e4
)
PLACED_SIGMA: Final = PLACED.derived(
    lambda placed_m: placed_m / CLAIM_SIGMAS.default,
    "standard deviation of the front when put into service",
).but(low=0.001)

#: The launcher gives each node its share of ``--timeout``, those that others wait for less.
GIVE_UP: Final = Quantity(
    2.0, "wall time after which a silent node is given up", unit="s", low=0.05, high=3600.0
)

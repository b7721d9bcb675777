"""The localizer as a node: what comes by topics is judged by the localizer, and nowhere else."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState

from rail_msgs_py.parameters import ParameterError
from rail_msgs_py.position import Position
from rail_msgs_py.stamps import NANOSECONDS
from rail_msgs_py.table import Table
from rail_msgs_py.topics.doppler import DOPPLER_FIX
from rail_msgs_py.topics.localizer import LOCALIZER_POSITION, LOCALIZER_STATE, RELAYED_RANGE
from rail_msgs_py.topics.ranging import POSITION
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.topics.track_code import CODE_RECEIVED
from rail_msgs_py.topics.world import ODOMETER
from rail_onboard.localizer.localizer_node import LocalizerNode
from rail_signals.localizer.localizer import Localizer
from rail_signals.localizer.protection_level import Localization, ProtectionReason, Status
from rail_signals.localizer.readings import DopplerFix, RangeFix, TickMeasurements, WheelSpeed
from rail_signals.localizer.settings import (
    IntegrityClaim,
    LocalizerSettings,
    OdometerModel,
    RangeModel,
    Sensor,
)

TRAIN = "train_1"
TICK_S = 0.1
TICK_NS = 100_000_000
START_M = 1000.0
ACCELERATION_MPS2 = 1.0
CLAIM = IntegrityClaim(tick_s=TICK_S, oldest_s=1.5)
#: In which filters that know neither a position nor the wheels' speed are lost.
LOST_TICKS = 150
#: A fix of the positioner: reason, chainage, speed, and their covariance.
Fix = tuple[float, float, float, float, float, float]
NO_FIX: Fix = (1.0, math.nan, math.nan, math.nan, math.nan, math.nan)


class Train:
    """A train that stands, or starts, with the sensors that its localizer has."""

    def __init__(self, graph: Any, *, starts: bool = False, **parameters: Any) -> None:
        self.graph, self.ticks, self.front_m, self.speed_mps = graph, 0, START_M, 0.0
        self._change_mps = ACCELERATION_MPS2 * TICK_S if starts else 0.0
        self.rng = np.random.default_rng(1)
        self._senders = {ODOMETER.pattern: self._sender(ODOMETER)}
        for parameter, topic in (
            ("doppler", DOPPLER_FIX),
            ("told", RELAYED_RANGE),
            ("ranged", POSITION),
            ("joints_m", CODE_RECEIVED),
        ):
            if parameters.get(parameter):
                self._senders[topic.pattern] = self._sender(topic)
        self._states = graph.mailbox(LOCALIZER_STATE, train=TRAIN)
        self._positions = graph.mailbox(LOCALIZER_POSITION, train=TRAIN)
        parameters = {"start_m": START_M, "placed_m": 1.0, **parameters}
        self.node = graph.add(LocalizerNode(context=graph.context, parameters=parameters))
        graph.connect(f"/{TRAIN}/localizer")

    def _sender(self, topic: Topic) -> Callable[[Any], None]:
        return self.graph.sender(topic, train=TRAIN)

    def _row(self, topic: Topic, *values: float) -> None:
        row = np.array([[*values, *(0.0,) * (len(topic.columns) - len(values))]])
        table = Table(self.ticks * TICK_NS, (TRAIN,), topic.columns, row)
        self._senders[topic.pattern](table.to_msg())

    def range_m(self) -> float:
        """Return where the train is ranged to be."""
        return self.front_m + 0.2 * float(self.rng.standard_normal())

    def tick(
        self,
        *,
        wheels_mps: float | None = None,
        doppler: Fix | None = None,
        ranged: tuple[float, float] | None = None,
        relayed: tuple[float, float, float] | None = None,
        carrier_hz: float = 0.0,
    ) -> dict[str, float]:
        """Return the state after the readings of a tick; those not given are of a healthy train."""
        if self.ticks:
            self.front_m += (self.speed_mps + 0.5 * self._change_mps) * TICK_S
            self.speed_mps += self._change_mps
        time_s = self.ticks * TICK_S
        self._row(ODOMETER, 0.0, self.speed_mps if wheels_mps is None else wheels_mps)
        if DOPPLER_FIX.pattern in self._senders:
            n = self.rng.standard_normal(2)
            healthy = (0.0, self.front_m + 2.0 * n[0], self.speed_mps + 0.2 * n[1], 4.0, 0.0, 0.04)
            self._row(DOPPLER_FIX, *(healthy if doppler is None else doppler))
        if RELAYED_RANGE.pattern in self._senders:
            # Four sigmas of 0.2 m, received in this tick and of use in the next.
            self._row(
                RELAYED_RANGE, *((time_s, self.range_m(), 0.8) if relayed is None else relayed)
            )
        if POSITION.pattern in self._senders:
            chainage_m, variance_m2 = (self.range_m(), 0.04) if ranged is None else ranged
            stamp_ns = self.ticks * TICK_NS
            place = Position(stamp_ns, TRAIN, "main", chainage_m, variance_m2, 0.0, math.inf)
            self._senders[POSITION.pattern](place.to_msg())
        if CODE_RECEIVED.pattern in self._senders:
            row = dict.fromkeys(CODE_RECEIVED.columns, 0.0) | {"carrier_hz": carrier_hz}
            self._row(CODE_RECEIVED, *row.values())
        self.ticks += 1
        self.graph.wait(
            lambda: len(self._states) >= self.ticks and len(self._positions) >= self.ticks
        )
        table = Table.from_msg(self._states[-1])
        assert table.stamp_ns == (self.ticks - 1) * TICK_NS
        return table.row(TRAIN)

    def holds(self, state: dict[str, float]) -> bool:
        return state["low_m"] <= self.front_m <= state["high_m"]

    @property
    def position(self) -> Position:
        """The position of the last tick."""
        return Position.from_msg(self._positions[-1])

    def health(self, aspect: str) -> tuple[bytes, str]:
        """Return level and message last published of an aspect of the node."""
        name = f"/{TRAIN}/localizer: {aspect}"
        found = [s for array in self.graph.diagnostics for s in array.status if s.name == name]
        return (found[-1].level, found[-1].message)

    def change(self, transition: int) -> None:
        request = ChangeState.Request(transition=Transition(id=transition))
        name = f"/{TRAIN}/localizer/change_state"
        assert self.graph.call(ChangeState, name, request).success

    def off_and_on(self) -> None:
        self.change(Transition.TRANSITION_DEACTIVATE)
        self.change(Transition.TRANSITION_ACTIVATE)


def test_the_node_says_what_the_localizer_says(graph: Any) -> None:
    """To the last bit: messages are converted, nothing is decided."""
    train = Train(
        graph,
        starts=True,
        doppler=True,
        ranged=True,
        zone_starts_m=(1003.0,),
        range_bias_m=0.4,
        odometer_scale=0.01,
        integrity_risk=1e-6,
        oldest_s=0.7,
    )
    claim = IntegrityClaim(risk=1e-6, tick_s=TICK_S, oldest_s=0.7)
    alone = Localizer(
        LocalizerSettings(
            ranging=RangeModel(bias_m=0.4), odometer=OdometerModel(scale=0.01), claim=claim
        )
    )
    alone.place(START_M, 1.0)
    rng = np.random.default_rng(3)
    for tick in range(30):
        v = ACCELERATION_MPS2 * TICK_S * tick
        s = START_M + 0.5 * v * v / ACCELERATION_MPS2
        n = rng.standard_normal(3).tolist()
        fix = (0.0, s + 2.0 * n[0], v + 0.2 * n[1], 4.0, 0.3, 0.04)
        ranged, wheels_mps = (s + 0.2 * n[2], 0.04), 1.005 * v
        state = train.tick(wheels_mps=wheels_mps, doppler=fix, ranged=ranged)
        here = Localization.of(
            alone.tick(
                tick * TICK_NS / NANOSECONDS,
                TickMeasurements(
                    RangeFix(*ranged, 0.0, float(ranged[0] >= 1003.0)),
                    DopplerFix(*fix[1:], 0.0),
                    None,
                    WheelSpeed(wheels_mps, 0.0),
                ),
            )
        )
        assert state == {
            "status": here.status,
            "reason": here.reason,
            "found": here.detected,
            "excluded": 0.0,
            "front_m": here.position_m,
            "low_m": here.low_m,
            "high_m": here.high_m,
            "speed_mps": here.speed_mps,
            "speed_low_mps": here.speed_low_mps,
            "speed_high_mps": here.speed_high_mps,
            "sigma_m": here.sigma_m,
            "fastest_mps": here.fastest_mps,
            "wheels_doubted": here.wheels_doubted,
        }
    assert here.status is Status.PROTECTED
    assert (train.position.chainage_m, train.position.speed_mps) == (
        here.position_m,
        here.speed_mps,
    )
    assert train.position.variance_m2 == here.sigma_m**2


def test_a_relayed_range_enters_with_its_age_and_its_sigma(graph: Any) -> None:
    """Used in the tick after the one in which it was received."""
    train = Train(graph, told=True, told_sigmas=5.0, zone_starts_m=(1001.0,), range_bias_m=0.4)
    alone = Localizer(LocalizerSettings(ranging=RangeModel(bias_m=0.4), claim=CLAIM))
    alone.place(START_M, 1.0)
    received: tuple[float, float] | None = None
    for tick in range(30):
        state = train.tick(relayed=(tick * TICK_S - 0.3, relayed_m := train.range_m(), 2.5))
        time_s = tick * TICK_NS / NANOSECONDS
        ranging = None
        if received is not None:
            measured_s, range_m = received
            age_s = time_s - measured_s
            ranging = RangeFix(range_m, 0.25, age_s, float(range_m >= 1001.0), lasting_m=0.5)
        here = Localization.of(
            alone.tick(time_s, TickMeasurements(ranging, odometer=WheelSpeed(0.0, 0.0)))
        )
        assert (state["front_m"], state["low_m"]) == (here.position_m, here.low_m)
        received = (tick * TICK_S - 0.3, relayed_m)


@pytest.mark.parametrize("at", [1, 2, 3, 4, 5])
def test_a_doppler_fix_with_nan_is_never_protected_with_nan(graph: Any, at: int) -> None:
    train = Train(graph, starts=True, doppler=True, ranged=True)
    for _ in range(10):
        train.tick()
    broken = [0.0, train.front_m, 1.0, 4.0, 0.0, 0.04]
    broken[at] = math.nan
    for _ in range(10):
        state = train.tick(doppler=tuple(broken))  # type: ignore[arg-type]
        assert all(math.isfinite(value) for value in state.values())
        assert state["status"] == Status.PROTECTED and train.holds(state)
    graph.wait(lambda: train.health("readings")[0] == DiagnosticStatus.WARN)
    assert train.health("readings") == (DiagnosticStatus.WARN, "doppler: not finite")
    train.tick()
    graph.wait(lambda: train.health("readings")[0] == DiagnosticStatus.OK)


@pytest.mark.parametrize("broken_mps", [math.nan, math.inf, 1e9])
def test_a_broken_odometer_poisons_nothing(graph: Any, broken_mps: float) -> None:
    train = Train(graph, starts=True, doppler=True, ranged=True)
    for tick in range(30):
        state = train.tick(wheels_mps=broken_mps if tick % 3 else None)
        assert all(math.isfinite(value) for value in state.values())
        assert train.holds(state)


@pytest.mark.parametrize("frozen", [True, False])
def test_a_range_frozen_at_a_stand_is_no_evidence_and_a_healthy_one_is(
    graph: Any, frozen: bool
) -> None:
    """Shared by the wayside: 3 m off and the same again and again, or with noise drawn anew."""
    train = Train(graph, ranged=True)
    states = [train.tick(ranged=(START_M + 3.0, 0.04) if frozen else None) for _ in range(250)]
    assert all(train.holds(state) for state in states)
    late = {state["status"] for state in states[LOST_TICKS:]}
    assert late == {Status.UNMONITORED if frozen else Status.PROTECTED}
    reason = ProtectionReason.TOO_FEW_SENSORS if frozen else ProtectionReason.NONE
    assert {state["reason"] for state in states[LOST_TICKS:]} == {reason}
    if frozen:
        graph.wait(lambda: train.health("readings")[0] == DiagnosticStatus.WARN)
        assert train.health("readings")[1] == "range: frozen"


@pytest.mark.parametrize("frozen", [True, False])
def test_the_same_of_a_range_that_is_relayed_by_radio(graph: Any, frozen: bool) -> None:
    """Each with a time of its own and in centimetres, as a movement authority has it."""
    train = Train(graph, told=True)
    statuses = []
    for tick in range(250):
        range_m = START_M + 3.0 if frozen else round(train.range_m(), 2)
        state = train.tick(relayed=(tick * TICK_S, range_m, 0.8))
        assert train.holds(state)
        statuses.append(state["status"])
    late = set(statuses[LOST_TICKS:])
    assert late == {Status.UNMONITORED if frozen else Status.PROTECTED}


@pytest.mark.parametrize(
    ("relayed", "why"),
    [
        ((0.0, START_M, -0.8), "covariance not positive definite"),
        ((0.0, START_M, 0.0), "covariance not positive definite"),
        ((0.0, START_M, math.inf), "not finite"),
        ((0.0, math.nan, 0.8), "not finite"),
        ((math.nan, START_M, 0.8), "not finite"),
        # Received at 0.0 s and of use at 0.1 s: as old as it may be is 0.5 s.
        ((-0.4 - 1e-6, START_M, 0.8), "too old"),
        ((0.1 + 1e-5, START_M, 0.8), "from the future"),
        ((-0.4 + 1e-6, START_M, 0.8), ""),
        ((0.1, START_M, 0.8), ""),
        # What train protection sends when nothing was relayed is no reading, and no fault.
        ((math.nan, math.nan, math.inf), ""),
    ],
)
def test_a_relayed_range_is_judged_by_the_localizer(
    graph: Any, relayed: tuple[float, float, float], why: str
) -> None:
    train = Train(graph, told=True, oldest_s=0.5)
    train.tick(relayed=relayed)
    before = train.tick()
    assert all(math.isfinite(before[name]) for name in ("low_m", "high_m", "front_m"))
    expected = (
        (DiagnosticStatus.WARN, f"range: {why}") if why else (DiagnosticStatus.OK, "accepted")
    )
    graph.wait(lambda: train.health("readings") == expected)


def test_no_fix_and_no_range_are_not_rejected(graph: Any) -> None:
    """They are what the other equipment sends when it has none."""
    train = Train(graph, doppler=True, ranged=True)
    for _ in range(3):
        train.tick(doppler=NO_FIX, ranged=(START_M, math.inf))
    assert train.health("readings") == (DiagnosticStatus.OK, "accepted")


def test_switched_off_it_knows_nothing_and_says_so(graph: Any) -> None:
    train = Train(graph, starts=True, ranged=True)
    assert train.tick()["status"] == Status.PROTECTED
    train.change(Transition.TRANSITION_DEACTIVATE)
    state = train.tick()
    assert state["status"] == Status.UNAVAILABLE
    assert math.isnan(state["front_m"]) and math.isnan(state["speed_mps"])
    assert (state["low_m"], state["high_m"], state["sigma_m"]) == (-math.inf, math.inf, math.inf)
    assert not train.position.known


def test_switched_on_again_it_does_not_believe_to_be_where_it_started(graph: Any) -> None:
    """Nothing but sensors says where it is then, and without them it is not known."""
    train = Train(graph, starts=True, ranged=True)
    for _ in range(30):
        train.tick()
    train.off_and_on()
    nowhere = train.tick(ranged=(0.0, math.inf))
    assert (nowhere["status"], nowhere["reason"]) == (Status.UNAVAILABLE, ProtectionReason.NO_FIX)
    assert not train.position.known
    for _ in range(20):
        state = train.tick()
        assert state["status"] == Status.UNAVAILABLE or train.holds(state)
    assert state["status"] == Status.UNMONITORED
    assert state["front_m"] == pytest.approx(train.front_m, abs=1.5)


def test_switched_on_for_the_first_time_after_the_start_it_was_not_placed_either(
    graph: Any,
) -> None:
    train = Train(graph, starts=True, ranged=True)
    train.change(Transition.TRANSITION_DEACTIVATE)
    train.tick()
    train.change(Transition.TRANSITION_ACTIVATE)
    assert train.tick(ranged=(0.0, math.inf))["reason"] == ProtectionReason.NO_FIX


def test_an_excluded_sensor_and_a_frozen_one_are_forgotten_with_the_switch(graph: Any) -> None:
    train = Train(graph, starts=True, doppler=True, ranged=True)
    for _ in range(20):
        train.tick()
    for _ in range(5):
        state = train.tick(ranged=(train.front_m + 60.0, 0.04))
    assert state["excluded"] == 1 << Sensor.RANGE
    graph.wait(lambda: train.health("position")[1] == "without range")
    train.off_and_on()
    for _ in range(50):
        state = train.tick()
    assert (state["excluded"], state["status"]) == (0.0, Status.PROTECTED)
    assert train.holds(state)


def test_a_joint_is_passed_where_the_carrier_changes(graph: Any) -> None:
    joints = {"joints_m": (START_M + 10.0,), "joint_carriers_hz": (2300.0,), "placed_m": 3.0}
    train = Train(graph, starts=True, **joints)
    sigmas_m: dict[bool, float] = {}
    while train.front_m < START_M + 12.0:
        passed = train.front_m > START_M + 10.0
        state = train.tick(carrier_hz=2300.0 if passed else 1700.0)
        assert train.holds(state)
        sigmas_m[passed] = state["sigma_m"]
    # The joint is as good as its survey and the delay of its notice, the start is worse.
    assert sigmas_m[False] == pytest.approx(3.0, rel=0.1)
    assert sigmas_m[True] < 1.5


def test_the_first_carrier_after_the_switch_is_no_joint_passed(graph: Any) -> None:
    """The joint may have been passed at any time since it was switched off."""
    joints = {"joints_m": (START_M + 10.0,), "joint_carriers_hz": (2300.0,)}
    train = Train(graph, **joints)
    train.tick(carrier_hz=1700.0)
    train.off_and_on()
    assert train.tick(carrier_hz=2300.0)["reason"] == ProtectionReason.NO_FIX
    # Nor is a later one, while it is not known which joint is near.
    train.tick(carrier_hz=1700.0)
    assert train.tick(carrier_hz=2300.0)["reason"] == ProtectionReason.NO_FIX


@pytest.mark.parametrize(
    ("parameters", "name"),
    [
        ({"direction": 0}, "direction"),
        ({"joints_m": (500.0, 900.0), "joint_carriers_hz": (1700.0,)}, "joints_m"),
        ({"odometer_scale": 0.5}, "odometer_scale"),
        ({"integrity_risk": 0.0}, "integrity_risk"),
        ({"start_m": "here"}, "start_m"),
    ],
)
def test_wrong_parameters_are_one_line(graph: Any, parameters: dict[str, Any], name: str) -> None:
    with pytest.raises(ParameterError, match=rf"^localizer: {name}: ") as caught:
        LocalizerNode(context=graph.context, parameters=parameters, services=False)
    assert "\n" not in str(caught.value)

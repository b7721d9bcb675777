"""The motion of one train: a fixed-step integration of its equation of motion.

Within a step the acceleration is constant, so position and speed are exact for it. Everything is
a pure function of the state and of the command, in plain floats: the same train gives the same
run to the last bit.
"""

from __future__ import annotations

from math import ceil, inf
from typing import Literal

from rail_world.errors import WorldDataError
from rail_world.line.network import Network
from rail_world.trains.description import SpeedRestriction, TrainDescription

from .brakes import Brakes
from .drive_command import DriveCommand
from .driver import Drivers
from .itinerary import Itinerary, Target
from .vehicle import Extent, LineForces, Vehicle

State = Literal["waiting", "running", "dwelling", "arrived"]

_LONGEST_STEP_S = 0.1
_AT_TARGET_M = 1e-3
_SAME_MPS = 1e-9
#: Who runs on sight stands this far before an obstacle [m].
_BEFORE_OBSTACLE_M = 5.0
_NO_COMMAND = DriveCommand()


class TrainMotion:
    """The true motion of a train.

    The reference point is the front end in the first direction of travel and stays with the train:
    after a reversal it is at the rear. ``path_m`` is measured along the route and increases with
    chainage; speed and acceleration are its derivatives, so they are negative for a train that
    runs towards decreasing chainage.

    Parameters
    ----------
    description : TrainDescription
        The train.
    network : Network
        The tracks it runs on.
    tick_s : float
        Simulated time of one ``step`` [s]; integrated in equal parts of at most 0.1 s.

    Raises
    ------
    WorldDataError
        If the description does not fit the network, names ``trains.<name>.<field>``.
    """

    def __init__(self, description: TrainDescription, network: Network, tick_s: float) -> None:
        if not 0.0 < tick_s <= 60.0:
            raise ValueError(f"tick_s: {tick_s} is not within 0 ... 60 s")
        self.description = description
        self.name = description.name
        self._field = f"trains.{description.name}"
        try:
            self.route = network.route(description.route, description.direction)
        except WorldDataError as error:
            field = f"{self._field}.{error.field}"
            raise WorldDataError(field, error.value, error.reason) from None
        self.vehicle = Vehicle(description.vehicle)
        self._itinerary = Itinerary(description, self.route)
        self._tick_s = tick_s
        self._parts = max(1, ceil(tick_s / _LONGEST_STEP_S - 1e-9))
        self._dt_s = tick_s / self._parts
        length_m = self.vehicle.length_m
        extent = Extent(length_m, 0.0) if description.direction > 0 else Extent(0.0, length_m)
        self._forces = LineForces(self.route, extent)
        self._extent = extent
        self._drivers = Drivers(description, self.route, self.vehicle, extent)
        self._driver = self._drivers.keeping(())
        #: What slows it down, and what its wheels show of it.
        self.brakes = Brakes(self.vehicle)
        self._wheel_path_m = 0.0
        #: Speed at which it came to the end of its track and went on, 0 if it did not [m/s].
        self.ran_off_mps = 0.0

        self._free_ahead_m = inf
        self._ticks = 0
        self._time_s = 0.0
        self._path_m = self._itinerary.start_m
        self._speed_mps = 0.0  # magnitude
        self._acceleration_mps2 = 0.0
        self._distance_m = 0.0
        self._direction: int = description.direction
        self._state: State = "waiting"
        self._at = Target(self._path_m, "start")
        self._target: Target | None = None
        self._dwell_until_s = 0.0
        self._check_initial_speed()
        if description.depart_s <= 0.0:
            self._start()

    def _check_initial_speed(self) -> None:
        speed_mps = self.description.speed_kmh / 3.6
        if speed_mps == 0.0:
            return
        target = self._itinerary.next_target(self._at, self._direction)
        ahead_m = 0.0 if target is None else self._stop_s(target) - self._direction * self._path_m
        permitted = min(self.permitted_mps, (2.0 * self._driver.deceleration_mps2 * ahead_m) ** 0.5)
        if speed_mps > permitted * (1.0 + 1e-12):
            raise WorldDataError(
                f"{self._field}.speed_kmh",
                self.description.speed_kmh,
                f"is more than the {3.6 * permitted:.1f} km/h permitted at the start",
            )

    # --- what can be seen -------------------------------------------------------------------

    @property
    def time_s(self) -> float:
        """Simulated time [s]."""
        return self._time_s

    @property
    def path_m(self) -> float:
        """Path distance of the reference point [m]."""
        return self._path_m

    @property
    def track(self) -> str:
        """Track the reference point is on."""
        return self.route.locate(self._path_m)[0]

    @property
    def chainage_m(self) -> float:
        """Chainage of the reference point on its track [m]."""
        return self.route.locate(self._path_m)[1]

    @property
    def speed_mps(self) -> float:
        """Speed, positive towards increasing chainage [m/s]."""
        return self._direction * self._speed_mps

    @property
    def acceleration_mps2(self) -> float:
        """Mean acceleration over the last tick, positive towards increasing chainage [m/s^2]."""
        return self._acceleration_mps2

    @property
    def state(self) -> State:
        """``waiting`` for departure, ``running``, ``dwelling`` at a stop, or ``arrived``."""
        return self._state

    @property
    def direction(self) -> int:
        """Running direction: +1 towards increasing chainage, -1 towards decreasing."""
        return self._direction

    @property
    def distance_m(self) -> float:
        """Distance travelled [m]."""
        return self._distance_m

    @property
    def wheel_distance_m(self) -> float:
        """Distance that the rims of its wheels have turned [m]: more or less where they slip."""
        return self._wheel_path_m

    @property
    def low_m(self) -> float:
        """Path distance of the end of the train at lesser chainage [m]."""
        return self._path_m - self._extent.below_m

    @property
    def high_m(self) -> float:
        """Path distance of the end of the train at greater chainage [m]."""
        return self._path_m + self._extent.above_m

    @property
    def front_m(self) -> float:
        """Path distance of the end that leads [m]."""
        return self.high_m if self._direction > 0 else self.low_m

    @property
    def due(self) -> bool:
        """Whether it waits although the time of its departure has come."""
        late_s = self._time_s - self.description.depart_s
        return self._state == "waiting" and late_s >= -1e-9

    @property
    def pulls(self) -> bool:
        """Whether its motors can start it where it stands."""
        specific = self._direction * self._forces.slope_sine(self._path_m)
        specific += self._forces.curve_resistance(self._path_m)
        drag = self.vehicle.running_resistance_mps2(0.0) + self.vehicle.gravity_mps2 * specific
        return min(self.vehicle.traction_mps2(0.0), self.brakes.bears_mps2) > drag

    @property
    def limit_mps(self) -> float:
        """Speed limit for the train as it stands, its whole length counted [m/s]."""
        return float(self._driver.limits_mps.at(self._path_m))

    @property
    def permitted_mps(self) -> float:
        """Speed the driver keeps here so as to brake in time for the limits ahead [m/s]."""
        return self._driver.envelopes[self._direction].speed_mps(self._direction * self._path_m)

    @property
    def planned_deceleration_mps2(self) -> float:
        """Braking the driver plans with [m/s^2]."""
        return self._driver.deceleration_mps2

    @property
    def next_stop_path_m(self) -> float | None:
        """Path distance of the point the train runs to [m]; None when it has no further one."""
        return None if self._target is None else self._target.path_m

    # --- motion -----------------------------------------------------------------------------

    def restrict(self, restrictions: tuple[SpeedRestriction, ...]) -> None:
        """Have the driver keep to boards on the line from now on."""
        self._driver = self._drivers.keeping(restrictions)

    def step(
        self,
        command: DriveCommand | None = None,
        *,
        may_depart: bool = True,
        free_ahead_m: float = inf,
    ) -> None:
        """Move the train by one tick.

        Parameters
        ----------
        command : DriveCommand, optional
            What supervision imposes during this tick.
        may_depart : bool
            False for a train that waits at an entrance that is not free.
        free_ahead_m : float
            Way to the first obstacle ahead, which the driver sees if it is near enough [m].
        """
        if self.due and may_depart:
            self._start()
        self._free_ahead_m = free_ahead_m
        before_mps = self._direction * self._speed_mps
        start_s = self._time_s
        for part in range(self._parts):
            self._substep(start_s + part * self._dt_s, command or _NO_COMMAND)
        self._ticks += 1
        self._time_s = self._ticks * self._tick_s
        after_mps = self._direction * self._speed_mps
        self._acceleration_mps2 = (after_mps - before_mps) / self._tick_s
        if self._state == "arrived" and self.description.leaves_on_arrival:
            self._acceleration_mps2 = 0.0  # gone, not stopped

    def _substep(self, now_s: float, command: DriveCommand) -> None:
        now_s += 1e-9  # what is due at this instant is due
        if self._state == "dwelling" and now_s >= self._dwell_until_s:
            self._leave()
        if self._state != "running":
            return
        reversal = self._itinerary.next_reversal
        due = reversal is not None and reversal.at_s is not None and now_s >= reversal.at_s
        if due and self._speed_mps == 0.0:
            self._stand(Target(self._path_m, "reversal"), now_s)
            return
        self._move(command, stop_now=due)
        target = self._target
        if self._speed_mps == 0.0 and target is not None:
            self._stand_if_there(target, now_s + self._dt_s)

    def _move(self, command: DriveCommand, *, stop_now: bool) -> None:
        vehicle, dt, v = self.vehicle, self._dt_s, self._speed_mps
        s = self._direction * self._path_m
        stop_s = inf if self._target is None else self._stop_s(self._target)
        specific = self._direction * self._forces.slope_sine(self._path_m)
        specific += self._forces.curve_resistance(self._path_m)
        drag = vehicle.running_resistance_mps2(v) + vehicle.gravity_mps2 * specific

        envelope = self._driver.envelopes[self._direction]
        brakes = self.brakes
        wanted = envelope.next_speed_mps(s, v, stop_s, dt)
        # Before what he knows of, the driver applies the brake so early that it has built up.
        wanted = max(wanted, self._braked(brakes.full_mps2(), drag) - _SAME_MPS)
        at_stop = wanted <= 0.0
        pull = 0.0 if command.traction_cut_off else vehicle.traction_mps2(v)
        wanted = min(wanted, v + (pull - drag) * dt)
        if stop_now:
            wanted = min(wanted, v - self._driver.deceleration_mps2 * dt)
        service = self._braked(brakes.building_up_mps2(dt), drag)
        if command.on_sight:
            sees_m = min(self.description.sight_m, self._free_ahead_m - _BEFORE_OBSTACLE_M)
            sees_m -= 0.5 * v * vehicle.brake_build_up_s  # run until the brake acts
            on_sight = envelope.next_speed_mps(s, v, s + max(sees_m, 0.0), dt)
            wanted = min(wanted, max(on_sight, service))
        effort = 0.0
        if command.emergency_brake:
            effort = brakes.built_up_mps2(dt, emergency=True)
            wanted = min(wanted, self._braked(brakes.building_up_mps2(dt, True), drag))
        elif command.service_brake:
            effort = brakes.built_up_mps2(dt)
            wanted = min(wanted, service)
        elif wanted > command.max_speed_mps:
            wanted = max(command.max_speed_mps, min(service, wanted))
            effort = brakes.built_up_mps2(dt) if wanted == service else 0.0
        demand = (wanted - v) / dt + drag
        if abs(demand) > brakes.bears_mps2:
            held = min(max(demand, -brakes.bears_mps2), brakes.bears_mps2)
            wanted = v + (held - drag) * dt if v > 0.0 or demand > 0.0 else 0.0
        at_stop = at_stop and wanted <= 0.0

        if wanted > 0.0:
            moved_m = 0.5 * (v + wanted) * dt
            self._speed_mps = wanted
        else:
            # A stand within the step, at the deceleration asked for.
            self._speed_mps = 0.0
            moved_m = 0.5 * v * v * dt / (v - wanted) if wanted < v else 0.0
            if at_stop:
                moved_m = min(moved_m, stop_s - s) if wanted < 0.0 else stop_s - s
                moved_m = max(moved_m, 0.0)
        brakes.effort_mps2 = max(effort, -demand if v > 0.0 else 0.0, 0.0)
        if stop_s == inf and self._target is not None:
            moved_m = self._run_out(self._target, moved_m)
        moved_m = self._kept_on_track(moved_m)
        self._path_m += self._direction * moved_m
        self._distance_m += moved_m
        self._free_ahead_m -= moved_m
        brakes.turn_wheels(self._speed_mps, demand, dt)
        self._wheel_path_m += moved_m + brakes.creep_mps * dt

    def _braked(self, effort_mps2: float, drag_mps2: float) -> float:
        """Speed at the end of a step with a brake effort; who stands is held."""
        if self._speed_mps == 0.0:
            return 0.0
        return self._speed_mps - (effort_mps2 + drag_mps2) * self._dt_s

    def _kept_on_track(self, moved_m: float) -> float:
        """Way of a train that does not leave its route, but runs into what ends it."""
        s = self._direction * self._path_m
        left_m = (self.route.length_m if self._direction > 0 else 0.0) - s
        if moved_m <= left_m + _AT_TARGET_M:
            return min(moved_m, max(left_m, 0.0)) if left_m < moved_m else moved_m
        self.ran_off_mps = self._speed_mps
        self._speed_mps = 0.0
        return max(left_m, 0.0)

    def _run_out(self, end: Target, moved_m: float) -> float:
        """Return how far the train moves, which is gone when it reaches the end of the track."""
        left_m = abs(end.path_m - self._path_m)
        if moved_m >= left_m:
            self._speed_mps = 0.0
            return left_m
        return moved_m

    # --- what comes next --------------------------------------------------------------------

    def _start(self) -> None:
        self._speed_mps = self.description.speed_kmh / 3.6
        self._depart()

    def _stop_s(self, target: Target) -> float:
        """Where to stand for a target, as a position that increases in the running direction."""
        if target.kind == "end" and self.description.leaves_on_arrival:
            return inf
        return self._direction * target.path_m

    def _depart(self) -> None:
        self._target = self._itinerary.next_target(self._at, self._direction)
        if self._target is not None:
            self._state = "running"
            return
        reversal = self._itinerary.next_reversal
        if reversal is None or reversal.at_s is None:
            self._state = "arrived"
            return
        # The end of the line, but the train is to turn back at a time still to come.
        self._state = "dwelling"
        self._at = Target(self._path_m, "reversal")
        self._dwell_until_s = max(self._dwell_until_s, reversal.at_s)

    def _stand(self, target: Target, now_s: float) -> None:
        self._at = target
        self._state = "dwelling"
        if target.kind == "reversal":
            reversal = self._itinerary.next_reversal
            dwell_s = 0.0 if reversal is None else reversal.dwell_s
            self._dwell_until_s = now_s + dwell_s
            return
        self._dwell_until_s = now_s + self.description.dwell_s
        if self._itinerary.next_target(target, self._direction) is None:
            self._depart()

    def _stand_if_there(self, target: Target, now_s: float) -> None:
        # Who could not stop in time stands beyond it, and has been there all the same.
        if self._direction * (target.path_m - self._path_m) <= _AT_TARGET_M:
            self._stand(target, now_s)

    def _leave(self) -> None:
        if self._at.kind == "reversal":
            self._itinerary.reversed()
            self._direction = -self._direction
        self._depart()

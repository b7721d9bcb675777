"""A quantity: its default, meaning, unit and bounds, declared once for everybody who names it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Generic, TypeVar, cast

import numpy as np

Value_co = TypeVar("Value_co", covariant=True)

#: Default of a quantity that has to be given.
NEEDED: Final[Any] = dataclasses.MISSING
_KEY: Final = "quantity"


@dataclass(frozen=True, eq=False)
class Quantity(Generic[Value_co]):
    """What a scenario sets, and media and nodes work with.

    Two quantities are the same only if they are one object: a scenario section, a description of
    the world and a node parameter that mean the same thing refer to the same declaration.

    Parameters
    ----------
    default : bool, int, float, str or tuple
        Value where nobody gives one; `NEEDED` if somebody has to.
    text, unit : str
        What it is, and in what unit.
    low, high : float
        Inclusive bounds of a number, and of each number of an array.
    low_open : bool
        Whether `low` itself is out of bounds.
    choices : tuple
        The values that it may have; empty = all within the bounds.
    source : Quantity, optional
        The declaration that this one was made from by `but`, `derived` or `array`.

    Examples
    --------
    >>> error = Quantity(0.005, "standard deviation of the error", low=0.0, high=0.1)
    >>> allowed = error.derived(lambda sigma: 4.0 * sigma, "error that is allowed for")
    >>> allowed.default, allowed.high, allowed.origin is error
    (0.02, 0.4, True)
    """

    default: Value_co
    text: str
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    low_open: bool = False
    choices: tuple[Value_co, ...] = ()
    source: Quantity[Any] | None = None

    @property
    def description(self) -> str:
        """Text with unit."""
        return f"{self.text} [{self.unit}]" if self.unit else self.text

    @property
    def origin(self) -> Quantity[Any]:
        """The declaration that it goes back to, itself if it was made from no other."""
        return self if self.source is None else self.source.origin

    def parameter(self) -> Value_co:
        """Field of a dataclass of node parameters; see `rail_msgs_py.parameters`."""
        return dataclasses.field(default=self.default, metadata={_KEY: self})

    def but(self, **changes: Any) -> Quantity[Any]:
        """The same quantity with another text, default or bounds where somebody means it so."""
        return cast("Quantity[Any]", dataclasses.replace(self, source=self, **changes))

    def derived(
        self: Quantity[float],
        function: Callable[[float], float],
        text: str,
        unit: str | None = None,
    ) -> Quantity[float]:
        """A monotonic function of this quantity: default and bounds follow from it."""
        low, high = sorted((function(self.low), function(self.high)))
        unit = self.unit if unit is None else unit
        return self.but(default=function(self.default), text=text, unit=unit, low=low, high=high)

    def array(self, text: str) -> Quantity[tuple[Value_co, ...]]:
        """Several of this quantity, each within its bounds; one of its default by default."""
        return self.but(default=(self.default,), text=text)

    def refusal(self, value: object) -> str:
        """Why a value cannot be, empty if it can; of an array one number after the other."""
        if isinstance(value, tuple):
            if self._takes_all(value):
                return ""
            return next((why for each in value if (why := self.refusal(each))), "")
        if self.choices and value not in self.choices:
            return f"{value} is not one of {', '.join(map(str, self.choices))}"
        if isinstance(value, bool) or not isinstance(value, int | float):
            return ""
        above = value > self.low if self.low_open else value >= self.low
        if above and value <= self.high:
            return ""
        bracket = "(" if self.low_open else "["
        return f"{value} is not within {bracket}{self.low}, {self.high}] {self.unit}"

    def _takes_all(self, values: tuple[object, ...]) -> bool:
        """Whether an array is one of numbers that are all within the bounds; quick where it is."""
        if self.choices or not values:
            return not values
        numbers = np.array(values)
        if numbers.ndim != 1 or numbers.dtype.kind not in "fi":
            return False
        above = numbers > self.low if self.low_open else numbers >= self.low
        return bool(np.all(above & (numbers <= self.high)))


def quantity_of(field: dataclasses.Field[Any]) -> Quantity[Any]:
    """Quantity of a field of node parameters."""
    return cast("Quantity[Any]", field.metadata[_KEY])

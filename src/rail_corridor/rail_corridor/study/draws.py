"""Laws that a study draws values of fields from."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from pydantic import Field, model_validator

from .strict import Strict

Pair = tuple[float, float]
_FURTHEST: Final = 2**53


class Draw(Strict):
    """One law, by its name.

    >>> Draw(uniform=(1.0, 3.0)).value(np.random.default_rng(1))
    2.023643249400513
    >>> Draw(choice=["siso", "mrc"]).value(np.random.default_rng(1))
    'siso'
    """

    uniform: Pair | None = Field(None, description="from, to")
    log_uniform: Pair | None = Field(None, description="from, to, both above zero")
    normal: Pair | None = Field(None, description="mean, standard deviation")
    integers: tuple[int, int] | None = Field(None, description="from, to, both included")
    choice: tuple[Any, ...] | None = Field(None, description="any of these, equally likely")

    @model_validator(mode="after")
    def _is_one_law(self) -> Draw:
        given = self.model_dump(exclude_none=True)
        if len(given) != 1:
            raise ValueError(f"must be one of {', '.join(type(self).model_fields)}")
        (name, values), *_ = given.items()
        if name == "choice":
            if not values:
                raise ValueError("choice: there is nothing to choose from")
        elif name == "normal":
            if not values[1] >= 0.0:
                raise ValueError("normal: the standard deviation must not be below 0")
        elif name == "integers" and not -_FURTHEST <= values[0] <= values[1] <= _FURTHEST:
            raise ValueError(f"integers: must be two in order, from {-_FURTHEST} to {_FURTHEST}")
        elif not values[0] <= values[1] or (name == "log_uniform" and not values[0] > 0.0):
            raise ValueError(f"{name}: must be two values in order")
        return self

    def extremes(self) -> tuple[Any, ...]:
        """Values that show whether all can be: the ends of a range, each choice.

        Of a normal law those three deviations off the mean.
        """
        if self.normal is not None:
            mean, sigma = self.normal
            return mean - 3.0 * sigma, mean + 3.0 * sigma
        (given,) = self.model_dump(exclude_none=True).values()
        return tuple(given)

    def value(self, rng: np.random.Generator) -> Any:
        """Draw one."""
        if self.uniform is not None:
            return float(rng.uniform(*self.uniform))
        if self.log_uniform is not None:
            low, high = self.log_uniform
            return float(math.exp(rng.uniform(math.log(low), math.log(high))))
        if self.normal is not None:
            return float(rng.normal(*self.normal))
        if self.integers is not None:
            return int(rng.integers(self.integers[0], self.integers[1] + 1))
        assert self.choice is not None
        return self.choice[int(rng.integers(len(self.choice)))]

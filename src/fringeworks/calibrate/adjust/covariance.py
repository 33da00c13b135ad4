"""How well the parameters of a calibration are known: covariance, spread, correlations.

The covariance is the inverse of the weighted normal matrix at the solution, priors included. The
weights stand on standard deviations that the residuals have mended class by class, so that it
needs no further scale: `sigma0` is about one. It says what the observations' scatter leaves open.
What is wrong with the model (a bowed board, a lens beyond five terms) is not in it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from fringeworks.errors import FormatError

Array = NDArray[np.float64]

KEY = "covariance"
"""Where `Rig.further` keeps it."""


@dataclass(frozen=True, slots=True, eq=False)
class Covariance:
    """Of the parameters that were solved for.

    Attributes
    ----------
    names
        As `state.parameter_names`: the part, a point, and the parameter with its unit where it
        is not px or a coefficient.
    matrix
        ``(k, k)``, in the units of the parameters.
    degrees_of_freedom
        Observed coordinates less parameters.
    sigma0
        Root mean squared whitened residual, those beyond Huber's bound counted as at it; about
        one where the standard deviations are right.
    """

    names: tuple[str, ...]
    matrix: Array
    degrees_of_freedom: int
    sigma0: float

    @property
    def sigma(self) -> dict[str, float]:
        """Standard deviation of each parameter."""
        return dict(zip(self.names, np.sqrt(np.diag(self.matrix)).tolist(), strict=True))

    def correlations(self, most: int = 10) -> list[tuple[str, str, float]]:
        """The strongest correlations of two parameters, strongest first."""
        sigma = np.sqrt(np.diag(self.matrix))
        ratio = self.matrix / np.outer(sigma, sigma)
        first, second = np.triu_indices(len(sigma), 1)
        order = np.argsort(-np.abs(ratio[first, second]), kind="stable")[:most]
        return [
            (self.names[i], self.names[j], float(ratio[i, j]))
            for i, j in zip(first[order], second[order], strict=True)
        ]

    def only(self, *parts: str) -> Covariance:
        """The part of it that belongs to ``camera``, ``projector``, ``board``..., in its order."""
        chosen = [i for i, name in enumerate(self.names) if name.rsplit(".", 1)[0] in parts]
        names = tuple(self.names[i] for i in chosen)
        matrix = self.matrix[np.ix_(chosen, chosen)]
        return Covariance(names, matrix, self.degrees_of_freedom, self.sigma0)

    def as_plain(self) -> dict[str, Any]:
        """JSON-able: ``names``, ``upper`` (the triangle row by row), ``sigma`` by name."""
        return {
            "names": list(self.names),
            "sigma": self.sigma,
            "degrees_of_freedom": self.degrees_of_freedom,
            "sigma0": self.sigma0,
            "upper": [row[place:] for place, row in enumerate(self.matrix.tolist())],
        }


class _Table(BaseModel):
    model_config = ConfigDict(strict=False, allow_inf_nan=False)

    names: Annotated[list[str], Field(min_length=1)]
    degrees_of_freedom: int
    sigma0: Annotated[float, Field(ge=0)]
    upper: list[list[float]]


def read_covariance(further: Mapping[str, Any]) -> Covariance | None:
    """The covariance in `Rig.further`; None where the rig keeps none.

    Raises
    ------
    FormatError
        Naming what is missing or does not hold what `Covariance.as_plain` writes.
    """
    if KEY not in further:
        return None
    try:
        table = _Table.model_validate(further[KEY])
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        key = ".".join(str(part) for part in (KEY, *first["loc"]))
        raise FormatError(f"the rig's covariance is damaged: {key}: {first['msg']}") from error
    count = len(table.names)
    if [len(row) for row in table.upper] != list(range(count, 0, -1)):
        raise FormatError(
            f"the rig's covariance is damaged: {KEY}.upper must have rows of {count} to 1 numbers "
            f"for its {count} names"
        )
    matrix = np.zeros((count, count))
    matrix[np.triu_indices(count)] = np.concatenate(table.upper)
    matrix += np.triu(matrix, 1).T
    if not (np.diag(matrix) > 0).all():
        raise FormatError(f"the rig's covariance is damaged: {KEY}.upper must have variances > 0")
    return Covariance(tuple(table.names), matrix, table.degrees_of_freedom, table.sigma0)

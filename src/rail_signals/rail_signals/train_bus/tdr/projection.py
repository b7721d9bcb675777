"""What a trace says about something new, when the deviations of the train are open as well.

Around a fit the trace is linear in the deviations, with the rows of its Jacobian. Whatever else
might be in the trace is judged by what the deviations cannot explain of it: the cost

    |r|^2 + |theta|^2 - |L^-1 (J r - theta)|^2,    L L' = J J' + 1,

is that of the best deviations for the residual r, without another fit. The backscatter of rough
cable counts as deviations too.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from rail_signals.arrays import FloatArray

from .fit import Fit


class Projection:
    """Takes the deviations out of what is shown to it.

    Parameters
    ----------
    at
        A fit without fault.
    samples
        Only so many first samples count; all by default.
    """

    def __init__(self, at: Fit, samples: int | None = None) -> None:
        count = len(at.residual) if samples is None else min(samples, len(at.residual))
        self.samples = count
        rough = at.metric.rows[:, :count]
        self._rows = np.concatenate([at.prediction.jacobian[:, :count] / at.sigma, rough])
        self._residual = at.residual[:count]
        deviations = at.deviations[at.prediction.rows]
        self._deviations = np.concatenate([deviations, np.zeros(len(rough))])
        self._offset = float(at.deviations @ at.deviations)
        matrix = self._rows @ self._rows.T
        matrix[np.diag_indices_from(matrix)] += 1
        self._factor = cholesky(matrix, lower=True)
        self._left = self._solve(self._rows @ self._residual - self._deviations)

    def costs(self, changes: FloatArray) -> FloatArray:
        """Cost if the trace is expected to be otherwise: [candidates].

        Parameters
        ----------
        changes : float64 [candidates, samples]
            What candidates add to the trace of the fit, over the noise.
        """
        residual = self._residual - changes
        pull = self._rows @ residual.T - self._deviations[:, None]
        gained = self._solve(pull)
        total = np.einsum("ij,ij->i", residual, residual) - np.einsum("ij,ij->j", gained, gained)
        return np.asarray(total + self._offset)

    def normal(self, *columns: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Normal equations of the amplitudes of candidates.

        Parameters
        ----------
        columns : float64 [candidates, samples]
            What a unit of each value of a candidate adds to the trace, over the noise.

        Returns
        -------
        matrix : float64 [candidates, values, values]
        vector : float64 [candidates, values]
        """
        explained = [self._solve(self._rows @ column.T) for column in columns]
        vector = [
            column @ self._residual - part.T @ self._left
            for column, part in zip(columns, explained, strict=True)
        ]
        count = len(columns)
        matrix = np.empty((len(columns[0]), count, count))
        for i in range(count):
            for j in range(i + 1):
                own = np.einsum("ij,ij->i", columns[i], columns[j])
                own -= np.einsum("ij,ij->j", explained[i], explained[j])
                matrix[:, i, j] = matrix[:, j, i] = own
        return matrix, np.stack(vector, axis=-1)

    def likelihood_ratio(self, *columns: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Statistic of the generalised likelihood ratio and amplitudes.

        Chi-square with as many degrees of freedom as there are values, where none is there.

        Returns
        -------
        statistic : float64 [candidates]
        amplitudes : float64 [candidates, values]
        """
        matrix, vector = self.normal(*columns)
        scale = np.sqrt(np.einsum("kii->ki", matrix).clip(1e-300))
        # Values that cannot be told apart share what they see.
        alike = matrix / (scale[:, :, None] * scale[:, None, :]) + 1e-9 * np.eye(len(columns))
        solved = np.linalg.solve(alike, (vector / scale)[..., None])[..., 0]
        return np.einsum("ki,ki->k", solved, vector / scale), solved / scale

    def _solve(self, right: FloatArray) -> FloatArray:
        return np.asarray(solve_triangular(self._factor, right, lower=True, check_finite=False))

"""Common part of the neural nets: data checks, scaling, warning about too many weights, and `freeze`."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from sklearn.utils import Tags

from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Input
from thermocomp.core.network import Affine, Network, Perceptron
from thermocomp.models.base import FloatArray, IntArray, MemorylessRegressor
from thermocomp.models.numerics.leastsquares import effective_sample_size


class NetRegressor(MemorylessRegressor):
    """Net with one hidden layer; a single net for several outputs if y has several columns.

    Attributes
    ----------
    net_ : Perceptron
        Net from scaled inputs to scaled outputs.
    input_scaling_, output_scaling_ : Affine
        Scaling to the inputs of the net, and from its outputs.
    n_parameters_ : int
        Number of weights and thresholds.
    n_patterns_ : int
        Number of training rows.
    n_effective_ : float
        Effective sample size of the training rows, from the autocorrelation of the residual (E-C12); the minimum over
        several outputs.
    caution_ : str
        Reason not to trust the net, mainly more parameters than independent rows (C-27); otherwise empty.
    data_min_, data_max_ : ndarray of shape (n_features,)
        Trained range.
    """

    def _predict(self, change: FloatArray) -> FloatArray:
        deviation = self.output_scaling_(self.net_.evaluate(self.input_scaling_(change)))
        return deviation[:, 0] if self._one_dimensional else deviation

    def freeze(self, *, inputs: Sequence[Input] | None = None, output: int | None = None, **header: Any) -> Network:
        """Return one output of the fitted net as plain numbers, without inputs that were constant in training."""
        return self._frozen(self._inputs(inputs), {"unit": "um", **header}, output)

    def _frozen(self, inputs: Sequence[Input], header: dict[str, Any], output: int | None = None) -> Network:
        net, into, out_of = self.net_, self.input_scaling_, self.output_scaling_
        n_outputs = net.shape[2]
        if output is None and n_outputs == 1:
            output = 0
        if output is None or not 0 <= output < n_outputs:
            raise InputError(
                f"output {output}: the net has {n_outputs} outputs; freeze each separately, with output=0 .. "
                f"{n_outputs - 1}"
            )
        # inputs with gain 0 are merged into the thresholds
        kept = [i for i, gain in enumerate(into.gain) if gain != 0 and out_of.gain[output] != 0]
        weights = np.array(net.hidden_weights)
        fixed = np.where(np.isin(np.arange(weights.shape[1]), kept), 0.0, into.offset)
        return Network(
            **header,
            inputs=tuple(inputs[i] for i in kept),
            net=Perceptron.of(
                weights[:, kept],
                np.array(net.hidden_thresholds) + weights @ fixed,
                np.array(net.output_weights[output : output + 1]),
                np.array(net.output_thresholds[output : output + 1]),
                hidden=net.hidden,
                output=net.output,
            ),
            input_scaling=Affine(tuple(into.gain[i] for i in kept), tuple(into.offset[i] for i in kept)),
            output_scaling=Affine(out_of.gain[output : output + 1], out_of.offset[output : output + 1]),
        )

    def __sklearn_tags__(self) -> Tags:
        tags = super().__sklearn_tags__()
        tags.target_tags.multi_output = True
        return tags

    # -- for subclasses ----------------------------------------------------------------------------------------------

    def _read(self, X: ArrayLike, y: ArrayLike, *, multi_output: bool = True) -> tuple[FloatArray, FloatArray]:
        """Check the training data; return X, and y as a table of shape (n_rows, n_outputs)."""
        change, deviation = super()._read(X, y, multi_output=multi_output)
        self._one_dimensional = deviation.ndim == 1
        return change, deviation.reshape(len(deviation), -1)

    def _keep(self, net: Perceptron, into: Affine, out_of: Affine, X: FloatArray, y: FloatArray, n_rows: int) -> None:
        """Store the net, with a comparison of its size and the `n_rows` training patterns from X and y."""
        self.net_, self.input_scaling_, self.output_scaling_ = net, into, out_of
        self.n_parameters_, self.n_patterns_ = net.n_parameters, n_rows
        residual = y - out_of(net.evaluate(into(X)))
        self.n_effective_ = min(float(n_rows), *(effective_sample_size(r) for r in residual.T))
        self.caution_ = ""
        if self.n_parameters_ > self.n_effective_:
            self.caution_ = (
                f"the net has {self.n_parameters_} weights and thresholds, but its {n_rows} training rows are "
                f"equivalent to only {self.n_effective_:.0f} independent rows: it may be overfitted; judge it by "
                "unseen cycles only"
            )


def thin_rows(n_rows: int, n_most: int) -> IntArray:
    """Return the indices of at most `n_most` of `n_rows` rows, evenly spread, including the first and the last."""
    if n_most < 2:
        raise InputError(f"maximum number of patterns {n_most}: expected at least 2")
    return np.linspace(0, n_rows - 1, min(n_rows, n_most)).round().astype(np.intp)

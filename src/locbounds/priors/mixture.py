"""Mixture of position priors."""

import equinox as eqx
import numpy as np

from locbounds.axes import Array, Bool, Float
from locbounds.errors import InputError
from locbounds.precision import float64
from locbounds.priors.position import PositionPrior


class PriorMixture(PositionPrior):
    """One of several laws of a position, each with a probability.

    Parameters
    ----------
    weights
        Probabilities of the parts, [parts], positive, summing to one.
    parts
        The laws, of equally many coordinates; they may overlap.

    Raises
    ------
    InputError
        If there are not as many weights as parts, the weights are no probabilities, or the dimensions differ.

    Examples
    --------
    >>> from locbounds.priors import UniformBox
    >>> rooms = PriorMixture([0.8, 0.2], [UniformBox([0, 0], [4, 4]), UniformBox([4, 0], [8, 4])])
    >>> rooms.mean.tolist()
    [2.8, 2.0]
    """

    weights: Float[Array, " parts"] = eqx.field(converter=float64)
    parts: tuple[PositionPrior, ...] = eqx.field(converter=tuple)

    def __check_init__(self):
        if np.shape(self.weights) != (len(self.parts),) or not self.parts:
            raise InputError(
                f"a mixture of {len(self.parts)} priors has weights of shape {np.shape(self.weights)}",
                "Give one weight per prior",
            )
        if not (np.all(self.weights > 0) and abs(self.weights.sum() - 1) < 1e-9):
            raise InputError(f"mixture weights are {self.weights}", "Give positive weights that sum to one")
        if len({part.dim for part in self.parts}) > 1:
            raise InputError("the parts of the mixture have different numbers of coordinates", "Give the same for all")

    @property
    def mean(self) -> Float[Array, " space"]:
        return sum(w * part.mean for w, part in zip(self.weights, self.parts, strict=True))  # pyright: ignore[reportReturnType]

    @property
    def covariance(self) -> Float[Array, "space space"]:
        between = [part.mean - self.mean for part in self.parts]
        each = zip(self.weights, self.parts, between, strict=True)
        return sum(w * (part.covariance + np.outer(d, d)) for w, part, d in each)  # pyright: ignore[reportReturnType]

    def log_density(self, points: Float[Array, "points space"]) -> Float[Array, " points"]:
        from scipy.special import logsumexp

        logs = np.stack([part.log_density(points) for part in self.parts])
        with np.errstate(divide="ignore"):  # outside of all
            return np.asarray(logsumexp(logs, axis=0, b=self.weights[:, None]))

    def inside(self, points: Float[Array, "points space"]) -> Bool[Array, " points"]:
        return np.any([part.inside(points) for part in self.parts], axis=0)

    def nodes(self, n: int) -> tuple[Float[Array, "nodes space"], Float[Array, " nodes"]]:
        """The nodes of all parts."""
        rules = [part.nodes(n) for part in self.parts]
        weights = [w * rule[1] for w, rule in zip(self.weights, rules, strict=True)]
        return np.concatenate([rule[0] for rule in rules]), np.concatenate(weights)

    def bounds(self) -> tuple[Float[Array, " space"], Float[Array, " space"]]:
        each = [part.bounds() for part in self.parts]
        return np.min([low for low, _ in each], axis=0), np.max([high for _, high in each], axis=0)

    def sample(self, n: int, *, seed: int = 0) -> Float[Array, "n space"]:
        pick = np.random.default_rng(seed).choice(len(self.parts), n, p=self.weights)
        draws = np.stack([part.sample(n, seed=seed + 7919 * (i + 1)) for i, part in enumerate(self.parts)])
        return draws[pick, np.arange(n)]

    def irregular(self) -> str | None:
        return next((why for part in self.parts if (why := part.irregular()) is not None), None)

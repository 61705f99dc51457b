"""What a filter returns."""

import equinox as eqx
import numpy as np

from locbounds.axes import Array, Bool, Float


class Estimates(eqx.Module):
    """State estimates of many tracks, each from the measurements up to the same step.

    Attributes
    ----------
    mean
        [runs, steps+1, state] in the scenario's state order; row 0 is the prior's mean.
    covariance
        [runs, steps+1, state, state] as the filter believes, or None if the filter was told not to return it.
    diagnostics
        What else a filter says about its own work, by name, [runs, ...] each.

    Examples
    --------
    >>> import locbounds as lb
    >>> scenario = lb.papers.fritsche2013.scenario(steps=3)
    >>> draws = lb.simulate(scenario, runs=2, seed=0)
    >>> estimates = lb.ImmEkf()(scenario, draws.measurements)
    >>> estimates.mean.shape, estimates.diverged.any()
    ((2, 4, 4), np.False_)
    """

    mean: Float[Array, "runs times state"]
    covariance: Float[Array, "runs times state state"] | None = None
    diagnostics: dict[str, Array] = eqx.field(default_factory=dict)

    @property
    def diverged(self) -> Bool[Array, " runs"]:
        """Which runs hold a number that is not finite: the filter broke down and its errors must not be averaged."""
        broken = ~np.isfinite(self.mean).all(axis=(1, 2))
        if self.covariance is not None:
            broken |= ~np.isfinite(self.covariance).all(axis=(1, 2, 3))
        return np.asarray(broken)

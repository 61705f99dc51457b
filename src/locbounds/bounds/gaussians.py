"""The expectation over the Gaussians of a filter that ran before, by sigma points."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.bounds.expectation import Expectation
from locbounds.errors import InputError
from locbounds.linalg import is_positive_semidefinite, psd_root
from locbounds.precision import double_precision, float64, traced
from locbounds.scenario import Scenario


class Gaussians(Expectation):
    """One Gaussian of the state per step, as a filter returns them: gradients are averaged over its sigma points.

    The filter's Gaussians belong to one track and one draw of its ranges, and so does the number that a bound makes of
    them: run it on another draw and it changes. It is no bound on the error over random tracks.

    Parameters
    ----------
    mean
        [steps+1, state] at steps 0..K, in the scenario's state order; step 0 is not used.
    covariance
        [steps+1, state, state], may be singular.
    label
        How results name what the number is conditional on.

    Raises
    ------
    InputError
        If numbers are not finite or a covariance is none; when used, if the shapes do not fit the scenario or a sigma
        point coincides with an anchor.

    Notes
    -----
    Chen 2010, eqs. (27)-(28). With n state components the points are ``mean +- sqrt(n)`` times the columns of the
    covariance's symmetric root, equally weighted: the scaling parameter kappa = 0, whose centre point has the weight
    zero. Other kappa change the average of a smooth function in the fourth order of the spread only.

    Examples
    --------
    The Gaussians of a filter that is told the sight, for the first of two tracks:

    >>> import numpy as np, locbounds as lb
    >>> scenario = lb.papers.fritsche2013.scenario(steps=3).with_known_sight(np.zeros(3, int))
    >>> draws = lb.simulate(scenario, runs=2)
    >>> found = lb.OracleEkf()(scenario, draws.measurements, sight=draws.sight)
    >>> of_filter = Gaussians(found.mean[0], found.covariance[0], label="one EKF run")
    >>> print(lb.known_sight(scenario, expectation=of_filter).verdict)
    valid under (conditional on one EKF run)
    """

    mean: Float[Array, "times state"] = eqx.field(converter=float64)
    covariance: Float[Array, "times state state"] = eqx.field(converter=float64)
    name: str = eqx.field(static=True)

    def __init__(self, mean, covariance, label: str = "the Gaussians of one filter run"):
        self.mean = mean
        self.covariance = covariance
        self.name = label

    def __check_init__(self):
        shapes = np.shape(self.mean), np.shape(self.covariance)
        if len(shapes[0]) != 2 or shapes[1] != (*shapes[0], shapes[0][1]):
            raise InputError(
                f"the means have shape {shapes[0]} and the covariances {shapes[1]}",
                "Give [steps+1, state] and [steps+1, state, state]",
            )
        if traced(self.mean, self.covariance):
            return
        if not (np.all(np.isfinite(self.mean)) and np.all(np.isfinite(self.covariance))):
            raise InputError("the Gaussians hold numbers that are not finite", "Check whether the filter diverged")
        bad = [k for k, P in enumerate(self.covariance) if not is_positive_semidefinite(P)]
        if bad:
            raise InputError(
                f"the matrix of step {bad[0]} is no covariance: not symmetric, or an eigenvalue is negative",
                "Give what a filter returns as Estimates.covariance, one run of it",
            )

    @property
    def random(self) -> bool:
        return False

    @property
    def label(self) -> str:
        return self.name

    def positions(self, scenario: Scenario, key: Array, paths: int) -> Float[Array, "paths steps space"]:
        mean, covariance = jnp.asarray(self.mean)[1:], jnp.asarray(self.covariance)[1:]
        n = mean.shape[1]
        columns = jnp.moveaxis(jnp.sqrt(float(n)) * psd_root(covariance), -1, 0)
        return scenario.motion.position(jnp.concatenate([mean + columns, mean - columns]))

    @double_precision
    def check(self, scenario: Scenario) -> None:
        expected = (scenario.steps + 1, scenario.motion.state_size)
        if self.mean.shape != expected:
            raise InputError(
                f"the means have shape {self.mean.shape}, the scenario needs {expected}",
                "Give one Gaussian of the state per step 0..K",
            )
        if traced(self.mean, self.covariance, scenario):
            return
        points = np.asarray(self.positions(scenario, jnp.zeros(2), 1))
        for link in scenario.links:
            if np.any(np.all(points == link.measurement.anchor, axis=-1)):
                raise InputError(
                    f"a sigma point is exactly at anchor {link.name}, where a range has no direction",
                    "Move the anchor, or give it its height (3-D)",
                )

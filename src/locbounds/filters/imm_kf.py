"""IMM-KF: ranges smoothed causally by a two-mode IMM Kalman filter per link, then least squares for the position."""

from collections.abc import Callable
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from locbounds.axes import Array
from locbounds.errors import InputError
from locbounds.filters.estimates import Estimates
from locbounds.filters.least_squares import damped, locate
from locbounds.filters.lowering import Model, check_measurements, estimates, lower
from locbounds.filters.over_tracks import over_tracks
from locbounds.filters.range_update import correct, corrected, direction, no_correction, relative_weights
from locbounds.filters.tracks_last import Symmetric, Vector, dense, materialise, solve, upper
from locbounds.precision import double_precision
from locbounds.scenario import Scenario

TINY = 1e-290  # a mode less likely than this has no mean


def range_models(model: Model) -> tuple[Array, Array, Array, Array]:
    """The motion of each link's [range, range rate], seen along the direction from the anchor to the prior mean.

    With that direction u and ``W = [[u, 0], [0, u]]`` the range state is ``W^T x`` to first order, hence
    ``F_r = W^T F W`` and ``Q_r = W^T Q W``: for nearly constant velocity, [[1, dt], [0, 1]] and the one-axis Q.

    Returns
    -------
    F_r [steps, 2, 2, links], Q_r [steps, 2, 2, links], mean [2, links], covariance [2, 2, links] at step 0.
    """
    dim = model.anchors.shape[1]
    anchors, m0 = jnp.asarray(model.anchors), jnp.asarray(model.m0)
    offset = m0[:dim] - anchors
    distance = jnp.sqrt(jnp.sum(offset**2, axis=1))
    somewhere = jnp.full(dim, dim**-0.5)  # a prior mean at the anchor has no direction: any one
    u = jnp.where(distance[:, None] > 0, offset / jnp.where(distance > 0, distance, 1.0)[:, None], somewhere)
    W = jnp.einsum("ab,li->laib", jnp.eye(2), u).reshape(len(u), 2 * dim, 2)  # [links, state, 2]
    F, Q, P0 = (jnp.einsum("lia,...ij,ljb->...abl", W, jnp.asarray(A), W) for A in (model.F, model.Q, model.P0))
    mean = jnp.stack([distance, u @ m0[dim:]])
    return F, Q, mean, P0


def range_filter(model: Model) -> tuple[Callable[[Any, Any], Any], Any]:
    """The two-mode IMM Kalman filter on [range, range rate] of every link: one step, and what it starts from.

    The step takes and returns mode probabilities, means and covariances, arrays [modes, links, tracks], from F, Q, T
    and ranges of one step, and gives mean and variance of the mixture of modes.
    """
    modes = model.means.shape[1]
    links = len(model.means)
    _, _, mean_0, P_0 = range_models(model)
    # [components, modes, links, 1]
    noises = tuple(jnp.asarray(a).transpose(2, 1, 0)[..., None] for a in (model.weights, model.means, model.variances))

    def smooth(carry: Any, piece: Any) -> Any:
        mu, x, P = carry
        F, Q, T, z = piece
        F, Q, T = F[..., None], Q[..., None], T[..., None]

        def mix(values: Array) -> Array:
            return jnp.stack([sum(T[:, i, j] * values[i] for i in range(modes)) for j in range(modes)])

        centre = materialise([over_modes(mu * a) for a in x])
        d = [a - b for a, b in zip(x, centre, strict=True)]
        c = mix(mu)
        inverse = materialise(jnp.where(c > TINY, 1.0 / jnp.where(c > TINY, c, 1.0), 0.0))
        P = {(i, j): mix(mu * (P[i, j] + d[i] * d[j])) * inverse for i, j in P}
        d = materialise([mix(mu * a) * inverse for a in d])
        P = {(i, j): P[i, j] - d[i] * d[j] for i, j in P}
        x = [a + b for a, b in zip(centre, d, strict=True)]

        x, P = materialise(predicted(F, Q, x, P))
        prediction = x[0], [jnp.ones_like(x[0])]
        correction = correct(no_correction(x[0], 1), {(0, 0): P[0, 0]}, prediction, z, noises)
        mu = materialise(relative_weights(c, correction))
        mu = materialise(mu / over_modes(mu))
        x, P = materialise(corrected(x, P, correction))
        return (mu, x, P), materialise(moments(mu, x, P))

    shape = modes, links, 1
    mu = jnp.broadcast_to(jnp.asarray(model.start).T[..., None], shape)
    x = [jnp.broadcast_to(mean_0[i][:, None], shape) for i in range(2)]
    P = {(i, j): jnp.broadcast_to(P_0[i, j][:, None], shape) for i, j in upper(2)}
    return smooth, (mu, x, P)


def over_modes(values: Array) -> Array:
    """Sum over the first axis, which is short."""
    return sum(values[j] for j in range(len(values)))  # pyright: ignore[reportReturnType]


def predicted(F: Array, Q: Array, x: Vector, P: Symmetric) -> tuple[Vector, Symmetric]:
    """Mean and covariance of the range state one step later."""
    x = [F[i, 0] * x[0] + F[i, 1] * x[1] for i in range(2)]
    FP = [[F[i, 0] * P[0, j] + F[i, 1] * P[min(1, j), max(1, j)] for j in range(2)] for i in range(2)]
    return x, {(i, j): FP[i][0] * F[j, 0] + FP[i][1] * F[j, 1] + Q[i, j] for i, j in P}


def moments(mu: Array, x: Vector, P: Symmetric) -> tuple[Vector, Symmetric]:
    """Mean and covariance of the mixture of modes."""
    mean = [over_modes(mu * a) for a in x]
    d = [a - b for a, b in zip(x, mean, strict=True)]
    return mean, {(i, j): over_modes(mu * (P[i, j] + d[i] * d[j])) for i, j in P}


def place(
    position: Vector, anchors: Array, ranges: tuple[Vector, Symmetric], *, weighted: bool, covariance: bool
) -> tuple[Vector, Vector, Array | None]:
    """Position and velocity from smoothed ranges and rates, and their covariance; least squares from a position."""
    dim = anchors.shape[1]
    (r, rate), V = ranges
    weights = materialise([1.0 / V[i, i] if weighted else jnp.ones_like(r) for i in range(2)])
    position = materialise(locate(position, anchors, r, weights[0], 1.0 / V[0, 0]))
    _, u = direction(position, anchors.T[:, :, None])

    gains = []  # d position / d ranges and d velocity / d rates, [space] of [links, tracks]
    for w in weights:
        G = {(i, j): jnp.sum(w * u[i] * u[j], axis=0) for i, j in upper(dim)}
        gains.append(solve(damped(G, 0.0), [w * a for a in u]))
    velocity = [jnp.sum(g * rate, axis=0) for g in gains[1]]
    full = gains[0] + gains[1]  # [state] of [links, tracks]
    spread = None
    if covariance:
        spread = {(i, j): jnp.sum(full[i] * full[j] * V[i // dim, j // dim], axis=0) for i, j in upper(2 * dim)}
        spread = dense(spread)
    return position, velocity, spread


def imm_kf(model: Model, z: Array, *, weighted: bool, covariance: bool) -> tuple[Array, Array | None]:
    """Smooth each link's ranges, then locate.

    Per link, a two-mode interacting multiple model Kalman filter on the state [range, range rate], with the noise law
    and the chain of the link; a mixture noise is moment-matched within the mode. Its output is the mean and variance of
    the mixture of modes. Position: nonlinear least squares of the smoothed ranges, started at the previous position
    (and once more elsewhere, see :func:`locbounds.filters.least_squares.locate`). Velocity: linear least squares of the
    range rates along the directions at that position. Covariance: that of the smoothed ranges and rates, taken as
    independent over links, through the linearised least squares.

    Parameters
    ----------
    model
        The scenario.
    z
        Ranges [steps, links, tracks], NaN = missing: the range is predicted.
    weighted
        Whether least squares weights are the inverse variances of the smoothed ranges, or all equal.
    covariance
        Whether to return it.
    """
    dim, tracks = model.anchors.shape[1], z.shape[-1]
    anchors = jnp.asarray(model.anchors)
    F_r, Q_r, _, _ = range_models(model)
    smooth, first = range_filter(model)

    def step(carry: Any, piece: Any) -> Any:
        filters, position = carry
        filters, ranges = smooth(filters, piece)
        position, velocity, spread = place(position, anchors, ranges, weighted=weighted, covariance=covariance)
        return (filters, position), (jnp.stack([*position, *velocity]), spread)

    first = jax.tree.map(lambda a: jnp.broadcast_to(a, (*a.shape[:2], tracks)), first)
    start = [jnp.broadcast_to(model.m0[i], tracks) for i in range(dim)]
    pieces = F_r, Q_r, jnp.moveaxis(jnp.asarray(model.transitions), 0, 1), z
    return jax.lax.scan(step, (first, start), pieces)[1]


def check_scenario(id: str, scenario: Scenario) -> None:
    """An InputError if positions cannot be found from ranges and range rates one by one."""
    if scenario.motion.state_size != 2 * scenario.dim:
        raise InputError(
            f"the state has {scenario.motion.state_size} components, {id} needs a position and a velocity",
            "Use the filter imm-ekf or imm-ekf-factorised",
        )
    if len(scenario.links) < scenario.dim:
        raise InputError(
            f"{id} cannot locate in {scenario.dim} dimensions with {len(scenario.links)} links",
            "Use the filter imm-ekf, or add anchors",
        )


class ImmKf(eqx.Module):
    """IMM-KF: causal smoothing of each link's ranges by a two-mode IMM Kalman filter, then least squares.

    Parameters
    ----------
    weighted
        Whether the least squares weighs each smoothed range by its inverse variance, which is what makes it robust to
        links that have not reported for a while. False: equal weights.
    covariance
        Whether the estimates carry covariances.

    Notes
    -----
    The papers that compare with this filter only cite it; what was chosen here, and why:

    - the range's process noise is the motion model's along the direction from the anchor to the prior mean, and the
      range state's prior is the state's prior seen along that direction: nothing new is assumed;
    - hence the same prior enters once per link, as an error that is independent between links, which it is not. This is
      what the algorithm loses against one joint filter: its average position error is 59 to 61 m in the scenario of
      Fritsche et al. 2013, where Table I says 59.4 to 61.6 m and the IMM-EKF reaches 51.5 to 54.6 m;
    - it is causal: no range after step k enters the position at step k; :class:`ImmKfSmoother` uses them all;
    - step 0 is the prior's mean and covariance.

    The constant range rate misses the turn of the range when the mobile passes an anchor, so that large errors occur.
    The covariance takes the errors of different links as independent, which they are not.

    References
    ----------
    Liao, Chen, "Robust mobile location estimator with NLOS mitigation using interacting multiple model algorithm", IEEE
    Trans. Wireless Commun., 2006; Fritsche, Klein, Gustafsson, IEEE Wireless Commun. Letters, 2013, section V.

    Examples
    --------
    >>> import locbounds as lb
    >>> scenario = lb.papers.fritsche2013.scenario(steps=3)
    >>> ImmKf()(scenario, lb.simulate(scenario, runs=2, seed=0).measurements).mean.shape
    (2, 4, 4)
    """

    weighted: bool = eqx.field(static=True, default=True, kw_only=True)
    covariance: bool = eqx.field(static=True, default=True, kw_only=True)

    id: ClassVar[str] = "imm-kf"
    name: ClassVar[str] = "IMM-KF"
    sees: ClassVar[frozenset[str]] = frozenset({"ranges"})

    @double_precision
    def __call__(self, scenario: Scenario, z: Array, seed: int = 0) -> Estimates:
        """Filter many tracks.

        Parameters
        ----------
        scenario
            The model; its state must consist of positions and velocities.
        z
            Ranges in metres, [runs, steps, links], NaN = missing.
        seed
            Not used: the filter draws nothing.

        Raises
        ------
        InputError
            If shapes do not match, a range is infinite, there are fewer links than coordinates, or the state is not
            made of positions and velocities.
        """
        z = check_measurements(scenario, z)
        check_scenario(self.id, scenario)
        model = lower(scenario)
        results = over_tracks(
            imm_kf,
            model,
            (z,),
            (model.m0, model.P0),
            hypotheses=8 * model.means.shape[1],
            weighted=self.weighted,
            covariance=self.covariance,
        )
        return estimates(scenario, *results)

"""One range after the other into a Gaussian: the extended Kalman update in position-information form.

A range depends on the position only. With ``P_p`` the columns of the covariance P that belong to the position and
``P_pp`` its position block, the update of N(x, P) by any number of ranges, all linearised at x, has the form

    mean  x + P_p y,        covariance  P - P_p K P_p^T,

and only y (space) and K (space x space) change from range to range. Let u be the range's direction and
``a = (I - K P_pp) u``; the variance of the predicted range is ``u^T P_pp a``. For noise N(mu, R):

    s = u^T P_pp a + R,     e = (z - h(x) - mu - u^T P_pp y) / s,     y <- y + a e,     K <- K + a a^T / s,

with likelihood ``N(e s; 0, s)``. This is the sequential form of the textbook's gain form, without a matrix inverse. A
Gaussian mixture noise gives one (e_c, s_c) with posterior weight l_c per component, and matching mean and covariance of
the mixture gives ``e = sum l_c e_c`` and ``1/s -> sum l_c / s_c - sum l_c (e_c - e)^2``, as in probabilistic data
association (Bar-Shalom, Willett, Tian 2011, section 6.4).
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp

from locbounds.axes import Array
from locbounds.filters.tracks_last import Symmetric, Vector, dot, entry, materialise, times, upper

IMPOSSIBLE = 1e-30  # below any probability that matters, far above underflow
LARGEST_EXPONENT = 1200.0  # exp(600) is finite, and times IMPOSSIBLE still decides


class Correction(NamedTuple):
    """What ranges say about a predicted Gaussian.

    Attributes
    ----------
    y, K
        See the module's text.
    energy, scale
        The likelihood of the ranges is proportional to ``sqrt(scale) exp(-energy / 2)``.
    """

    y: Vector
    K: Symmetric
    energy: Array
    scale: Array


def no_correction(like: Array, dim: int) -> Correction:
    """Before the first range, in the shape of an array."""
    zero = jnp.zeros_like(like)
    return Correction([zero] * dim, dict.fromkeys(upper(dim), zero), zero, zero + 1.0)


def direction(position: Vector, anchor: Array) -> tuple[Array, Vector]:
    """The range to an anchor and its gradient, which is zero at the anchor itself.

    >>> h, u = direction([jnp.array(3.0), jnp.array(4.0)], jnp.zeros(2))
    >>> float(h), [round(float(c), 3) for c in u]
    (5.0, [0.6, 0.8])
    """
    offset = [p - anchor[i] for i, p in enumerate(position)]
    square = dot(offset, offset)
    inverse = jnp.where(square > 0, 1.0 / jnp.sqrt(jnp.where(square > 0, square, 1.0)), 0.0)
    inverse = materialise(inverse)
    return square * inverse, [d * inverse for d in offset]


def correct(
    so_far: Correction,
    P_pp: Symmetric,
    prediction: tuple[Array, Vector],
    z: Array,
    noise: Sequence[Array],
) -> Correction:
    """Take one more range into account.

    Parameters
    ----------
    so_far
        The correction by the ranges before.
    P_pp
        Covariance of the predicted position.
    prediction
        Predicted range and its gradient with respect to the position, see :func:`direction`.
    z
        The range, [tracks], NaN where it is missing: then nothing changes.
    noise
        Weights, means, variances of the components, [components, ...] broadcast against the prediction.
    """
    y, K, energy, scale = so_far
    weights, means, variances = noise
    components = range(len(means))
    h, u = prediction
    seen = jnp.isfinite(z)
    residual = jnp.where(seen, z, 0.0) - h
    t = times(P_pp, u)
    a = [u_i - v for u_i, v in zip(u, times(K, t), strict=True)]
    innovation = residual - dot(t, y)
    variance = dot(t, a)
    s = [1.0 / (variance + variances[c]) for c in components]  # inverse innovation variances
    s = materialise(s)
    e = [(innovation - means[c]) * s[c] for c in components]
    q = [e[c] * (innovation - means[c]) for c in components]
    if len(components) == 1:
        (e_bar,), (s_bar,), (q_bar,), scale_new = e, s, q, s[0]
    else:
        q_bar = _least(q)
        likelihood = [weights[c] * jnp.sqrt(s[c]) * jnp.exp(-0.5 * (q[c] - q_bar)) for c in components]
        total = sum(likelihood)
        l = [x / total for x in likelihood]
        e_bar = sum(l_c * e_c for l_c, e_c in zip(l, e, strict=True))
        spread = sum(l_c * (e_c - e_bar) ** 2 for l_c, e_c in zip(l, e, strict=True))
        s_bar = sum(l_c * s_c for l_c, s_c in zip(l, s, strict=True)) - spread
        scale_new = total**2
    e_bar, s_bar, q_bar = (jnp.where(seen, v, 0.0) for v in (e_bar, s_bar, q_bar))
    return materialise(
        Correction(
            [y_i + a_i * e_bar for y_i, a_i in zip(y, a, strict=True)],
            {(i, j): K[i, j] + a[i] * a[j] * s_bar for i, j in K},
            energy + q_bar,
            scale * jnp.where(seen, scale_new, 1.0),
        )
    )


def correct_in_plane(
    P_pp: Symmetric, predictions: Sequence[tuple[Array, Vector]], z: Sequence[Array], noises: Sequence[Sequence[Array]]
) -> Correction:
    """All ranges at once where positions have two coordinates and noises one component: the same result, faster.

    With ``G = sum u u^T / R`` and ``b = sum u nu / R`` over the ranges, in two dimensions (Cayley-Hamilton)

        D = det(I + G P_pp) = 1 + tr(G P_pp) + det(G) det(P_pp),
        K = (G + det(G) adj(P_pp)) / D,     y = (I + G P_pp)^-1 b,     energy = sum nu^2 / R - b^T P_pp y.

    Parameters
    ----------
    P_pp
        Covariance of the predicted position.
    predictions, z, noises
        What :func:`correct` takes, for every range.
    """
    G: Symmetric = {}
    b: Vector = []
    energy = scale = jnp.asarray(0.0)
    for (h, u), range_, (_, means, variances) in zip(predictions, z, noises, strict=True):
        seen = jnp.isfinite(range_)
        information = jnp.where(seen, 1.0 / variances[0], 0.0)
        nu = jnp.where(seen, range_, 0.0) - h - means[0]
        w = [a * information for a in u]
        first = not b
        G = {(i, j): w[i] * u[j] if first else G[i, j] + w[i] * u[j] for i, j in upper(2)}
        b = [w[i] * nu if first else b[i] + w[i] * nu for i in range(2)]
        energy = nu * nu * information if first else energy + nu * nu * information
        factor = jnp.where(seen, 1.0 / variances[0], 1.0)
        scale = factor if first else scale * factor
    G, b, energy, scale = materialise((G, b, energy, scale))

    def product(i: int, j: int) -> Array:
        return entry(G, i, 0) * entry(P_pp, 0, j) + entry(G, i, 1) * entry(P_pp, 1, j)

    det_G = G[0, 0] * G[1, 1] - G[0, 1] ** 2
    det_P = P_pp[0, 0] * P_pp[1, 1] - P_pp[0, 1] ** 2
    D = 1.0 + product(0, 0) + product(1, 1) + det_G * det_P
    inverse = materialise(1.0 / D)
    K = {
        (0, 0): (G[0, 0] + det_G * P_pp[1, 1]) * inverse,
        (0, 1): (G[0, 1] - det_G * P_pp[0, 1]) * inverse,
        (1, 1): (G[1, 1] + det_G * P_pp[0, 0]) * inverse,
    }
    y = [
        ((1.0 + product(1, 1)) * b[0] - product(0, 1) * b[1]) * inverse,
        ((1.0 + product(0, 0)) * b[1] - product(1, 0) * b[0]) * inverse,
    ]
    y, K = materialise((y, K))
    return materialise(Correction(y, K, energy - dot(b, times(P_pp, y)), scale * inverse))


def corrected(x: Vector, P: Symmetric, correction: Correction) -> tuple[Vector, Symmetric]:
    """Mean and covariance after the correction."""
    y, K = correction.y, correction.K
    n, dim = len(x), len(y)
    columns = [[entry(P, i, a) for a in range(dim)] for i in range(n)]
    KP = [times(K, row) for row in columns]
    return (
        [x[i] + dot(columns[i], y) for i in range(n)],
        {(i, j): P[i, j] - dot(KP[i], columns[j]) for i, j in P},
    )


def _least(values: list[Array]) -> Array:
    least = values[0]
    for value in values[1:]:
        least = jnp.minimum(least, value)
    return least


def relative_weights(prior: Array, correction: Correction) -> Array:
    """Posterior probabilities of hypotheses along the first axis up to a common factor, without a logarithm.

    Energies are taken relative to the least one among the hypotheses that are not practically impossible, so that at
    least one weight does not underflow; the exponent of the others is limited so that none overflows.
    """
    rows = range(len(prior))
    possible = jnp.where(prior > IMPOSSIBLE, correction.energy, jnp.inf)
    least = materialise(_least([possible[i] for i in rows]))
    excess = jnp.maximum(correction.energy - least, -LARGEST_EXPONENT)
    return prior * jnp.sqrt(correction.scale) * jnp.exp(-0.5 * excess)

"""A user's own log-density, and any NumPyro distribution, as a noise."""

from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float, Scalar, ndarray
from locbounds.errors import InputError
from locbounds.noise.base import Noise
from locbounds.noise.singularity import Pieces, Singularity
from locbounds.precision import double_precision, float64

NORMALISED = 1e-6
PANELS, REFINED, HALVINGS = 400, 128, 50
ROWS = 512  # panels at once: one compiled shape
EXACT = 1e-13  # share of the mass up to which a panel is integrated exactly
_REACH = np.sinh(np.linspace(-40, 40, 4001))  # metres around the middle, while the mass is searched for
TAIL, LOGIT = 1e-16, 18.0  # probability left out of a table without an end, and its level on a logistic scale
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)


class Tabulated(Noise):
    """What the adaptors share: moments and a table of quantiles by quadrature of the log-density, at construction."""

    mean: eqx.AbstractVar[Scalar]
    moment: eqx.AbstractVar[Scalar]
    places: eqx.AbstractVar[Array]
    masses: eqx.AbstractVar[Array]

    @property
    def variance(self) -> Scalar:
        return self.moment

    def landmarks(self) -> Float[Array, " k"]:
        return jnp.asarray(self.places)

    def sample(self, key: Array, shape: tuple[int, ...]) -> Float[Array, "..."]:
        """Inverse distribution function: the table's interval, then bisection within it."""
        u = jax.random.uniform(key, shape) * self.masses[-1]
        i = jnp.clip(jnp.searchsorted(jnp.asarray(self.masses), u, side="right") - 1, 0, len(self.places) - 2)
        low, high = jnp.asarray(self.places)[i], jnp.asarray(self.places)[i + 1]
        start, need = low, u - jnp.asarray(self.masses)[i]

        def halve(_: Any, bracket: tuple[Array, Array]) -> tuple[Array, Array]:
            low, high = bracket
            middle = 0.5 * (low + high)
            half = 0.5 * (middle - start)
            x = (start + half)[..., None] + half[..., None] * _NODES
            below = half * jnp.sum(_WEIGHTS * jnp.exp(self.log_prob(x)), -1) < need
            return jnp.where(below, middle, low), jnp.where(below, high, middle)

        low, high = jax.lax.fori_loop(0, 40, halve, (low, high))
        return 0.5 * (low + high)


class FromLogDensity(Tabulated):
    """Noise with a log-density of the user's own.

    Parameters
    ----------
    function
        Log-density of an array, elementwise, written with ``jax.numpy``. It is evaluated inside the support only.
    support
        Its ends in metres, infinite where there are none.
    singular
        Where the density is not smooth, as :class:`~locbounds.noise.singularity.Singularity` entries; an empty
        sequence declares a smooth density. Left out: it is examined as a black box.
    landmarks
        Places (optional) that help to find narrow peaks.
    normalise
        Whether to divide by the integral instead of insisting that it is one.

    Raises
    ------
    InputError
        If the function is not a density, or not written with ``jax.numpy``.

    Examples
    --------
    >>> noise = FromLogDensity(lambda w: -jnp.abs(w) ** 3, normalise=True)
    >>> noise.regularity().status
    'regular'
    """

    function: Callable[[Array], Array] = eqx.field(static=True)
    low: Scalar
    high: Scalar
    log_mass: Scalar
    mean: Scalar
    moment: Scalar
    places: Float[Array, " k"]
    masses: Float[Array, " k"]
    singular: tuple[Singularity, ...] | None = eqx.field(static=True)

    def __init__(
        self,
        function: Callable[[Array], Array],
        *,
        support: tuple[float, float] = (-np.inf, np.inf),
        singular: Sequence[Singularity] | None = None,
        landmarks: Sequence[float] = (),
        normalise: bool = False,
    ):
        low, high = float(support[0]), float(support[1])
        if not low < high:
            raise InputError(f"the support of a noise is {support}", "Give low < high, in metres")
        self.function, self.low, self.high = function, float64(low), float64(high)
        self.singular = None if singular is None else tuple(singular)
        table = tabulate(function, low, high, tuple(landmarks), normalise=normalise)
        self.log_mass, self.mean, self.moment, self.places, self.masses = table

    def log_prob(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        w = jnp.asarray(w)
        there = (w > self.low) & (w < self.high)
        middle = jnp.asarray(self.places)[len(self.places) // 2]
        return jnp.where(there, self.function(jnp.where(there, w, middle)) - self.log_mass, -jnp.inf)

    def support(self) -> Pieces:
        return ((float(self.low), float(self.high)),)

    def singularities(self) -> tuple[Singularity, ...] | None:
        return self.singular


class FromNumPyro(Tabulated):
    """Any continuous univariate NumPyro distribution as a noise.

    Parameters
    ----------
    distribution
        For example ``numpyro.distributions.Gumbel(0.0, 1.0)``. NumPyro keeps its numbers in single precision unless JAX
        computes in double precision; they are widened as they are.
    singular, landmarks
        As for :class:`FromLogDensity`.

    Raises
    ------
    InputError
        If it is not a continuous distribution of one number.

    Examples
    --------
    >>> import numpyro.distributions as dist
    >>> noise = FromNumPyro(dist.Gumbel(0.0, 1.0))
    >>> noise.regularity().status, round(float(noise.mean), 4)
    ('regular', 0.5772)
    """

    distribution: Any
    mean: Scalar
    moment: Scalar
    places: Float[Array, " k"]
    masses: Float[Array, " k"]
    ends: tuple[float, float] = eqx.field(static=True)
    singular: tuple[Singularity, ...] | None = eqx.field(static=True)

    def __init__(
        self, distribution: Any, *, singular: Sequence[Singularity] | None = None, landmarks: Sequence[float] = ()
    ):
        support = getattr(distribution, "support", None)
        if getattr(distribution, "batch_shape", None) != () or getattr(distribution, "event_shape", None) != ():
            raise InputError(f"{distribution!r} is not a distribution of one number", "Give a scalar one")
        if support is None or support.is_discrete:
            raise InputError(f"{distribution!r} is not continuous", "Give a distribution with a density")
        self.distribution = jax.tree.map(float64, distribution)
        low = getattr(support, "lower_bound", -np.inf)
        high = getattr(support, "upper_bound", np.inf)
        if type(support).__name__ in ("_Positive", "_SoftplusPositive"):
            low = 0.0
        self.ends = float(low), float(high)
        self.singular = None if singular is None else tuple(singular)
        _, self.mean, self.moment, self.places, self.masses = tabulate(
            lambda w: self.distribution.log_prob(w), *self.ends, tuple(landmarks), normalise=False
        )

    def log_prob(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        w = jnp.asarray(w)
        there = (w > self.ends[0]) & (w < self.ends[1])
        middle = jnp.asarray(self.places)[len(self.places) // 2]
        return jnp.where(there, self.distribution.log_prob(jnp.where(there, w, middle)), -jnp.inf)

    def support(self) -> Pieces:
        return (self.ends,)

    def singularities(self) -> tuple[Singularity, ...] | None:
        return self.singular


@double_precision
def tabulate(
    function: Callable[[Array], Array], low: float, high: float, landmarks: tuple[float, ...], *, normalise: bool
) -> tuple[ndarray, ndarray, ndarray, ndarray, ndarray]:
    """Logarithm of the mass, mean, variance, and a table of places and masses below them.

    The places are spread by probability, and towards both ends of the support by powers of two.
    """
    try:
        log_p = jax.jit(lambda w: function(w))
        seen = jax.eval_shape(log_p, jnp.full(2, _middle(low, high)))
    except (TypeError, jax.errors.JAXTypeError) as error:
        raise InputError(
            "the log-density cannot be traced by JAX", "Write it with jax.numpy, elementwise, for arrays"
        ) from error
    if seen.shape != (2,):
        raise InputError(f"the log-density of 2 numbers has shape {seen.shape}", "Return one number for each")
    x = _first_grid(low, high, landmarks)
    for _ in range(3):  # the grid follows the mass, as found on the grid before
        x, mass = _next_grid(log_p, x, low, high, landmarks)
    if np.isfinite(mass) and mass > 0:
        x = _exactly(_refined(log_p, x, mass), PANELS + 1 + REFINED)
    p, first, second = _panels(log_p, x)
    mass = p.sum()
    if not np.isfinite(mass) or mass <= 0:
        raise InputError(f"the integral of the density is {mass}", "Give the logarithm of a density")
    if not normalise and abs(mass - 1) > NORMALISED:
        raise InputError(
            f"the density integrates to {mass:.7g}, not to one",
            "Subtract its logarithm from the log-density, correct the support, or set normalise=True",
        )
    below = np.concatenate([[0.0], np.cumsum(p)]) / mass
    log_mass = np.log(mass) if normalise else 0.0
    mean = first.sum() / mass
    return np.asarray(log_mass), np.asarray(mean), np.asarray(second.sum() / mass - mean**2), x, below


def _middle(low: float, high: float) -> float:
    if np.isfinite(low) and np.isfinite(high):
        return 0.5 * (low + high)
    return low + 1.0 if np.isfinite(low) else high - 1.0 if np.isfinite(high) else 0.1


def _first_grid(low: float, high: float, landmarks: tuple[float, ...]) -> ndarray:
    if np.isfinite(low) and np.isfinite(high):
        x = low + (high - low) * np.linspace(0, 1, len(_REACH))
    elif np.isfinite(low):
        x = low + np.exp(np.linspace(-40, 40, len(_REACH)))
    elif np.isfinite(high):
        x = high - np.exp(np.linspace(40, -40, len(_REACH)))
    else:
        x = _REACH
    return np.unique(np.concatenate([x, [v for v in landmarks if low < v < high]]))


def _panels(log_p: Callable[[Any], Any], x: ndarray) -> tuple[ndarray, ndarray, ndarray]:
    half = 0.5 * np.diff(x)[:, None]
    w = 0.5 * (x[1:] + x[:-1])[:, None] + half * _NODES
    rows = np.concatenate([w, np.broadcast_to(w[-1:], (-len(w) % ROWS, 16))]).reshape(-1, ROWS, 16)
    p = half * _WEIGHTS * np.exp(np.concatenate([np.asarray(log_p(row)) for row in rows])[: len(w)])
    return p.sum(1), (p * w).sum(1), (p * w**2).sum(1)


def _refined(log_p: Callable[[Any], Any], x: ndarray, mass: float) -> ndarray:
    """Panels in which halves give another mass than the whole, halved again and again: kinks and jumps inside."""
    found: list[float] = []
    todo = np.stack([x[:-1], x[1:]], 1)
    for _ in range(HALVINGS):
        padded = np.concatenate([todo, np.broadcast_to(todo[-1:], (-len(todo) % PANELS, 2))])
        low, high = padded.T
        middle = 0.5 * (low + high)
        each = [
            _panels(log_p, np.stack([a, b], 1).ravel())[0][::2] for a, b in ((low, high), (low, middle), (middle, high))
        ]
        rough = (np.abs(each[0] - each[1] - each[2]) > EXACT * mass)[: len(todo)]
        found += list(middle[: len(todo)][rough])
        todo = np.stack([np.stack([low, middle], 1), np.stack([middle, high], 1)], 1)[: len(rough)][rough].reshape(
            -1, 2
        )
        if not len(todo) or len(found) > REFINED - 2:
            break
    return np.unique(np.concatenate([x, found[:REFINED]]))


def _next_grid(log_p, x, low, high, landmarks) -> tuple[ndarray, float]:
    """A grid that follows the mass on the grid before, and that mass."""
    with np.errstate(over="ignore"):
        p, _, _ = _panels(log_p, x)
    if not np.all(np.isfinite(p)):
        return x, float(p.sum())
    mass = max(p.sum(), 1e-300)
    below = np.concatenate([[0.0], np.cumsum(p)]) / mass
    above = np.concatenate([np.cumsum(p[::-1])[::-1], [0.0]]) / mass
    spread = np.interp(0.84, below, x) - np.interp(0.16, below, x)
    inside = x[(below > TAIL) & (above > TAIL)]
    ends = (low if np.isfinite(low) else inside[0], high if np.isfinite(high) else inside[-1])
    graded = spread * 2.0 ** -np.arange(1.0, 46.0)
    towards = [low + graded] if np.isfinite(low) else []
    towards += [high - graded] if np.isfinite(high) else []
    count = (PANELS + 1 - sum(map(len, towards))) // 2
    level = 0.5 * (1 - np.tanh(np.linspace(0, LOGIT, count)))  # dense in both tails
    lower, upper = np.interp(level, below, x), np.interp(-level, -above, x)
    quantiles = np.concatenate([lower, upper])
    grid = np.unique(np.clip(np.concatenate([quantiles, *towards, list(ends)]), *ends))
    grid = np.unique(np.concatenate([grid, [v for v in landmarks if ends[0] < v < ends[1]]]))
    return _exactly(grid, PANELS + 1), float(p.sum())


def _exactly(grid: ndarray, n: int) -> ndarray:
    """The grid with its widest intervals halved, or its places thinned, until it has n places: one compiled shape."""
    while len(grid) < n:
        i = int(np.argmax(np.diff(grid)))
        grid = np.insert(grid, i + 1, 0.5 * (grid[i] + grid[i + 1]))
    if len(grid) > n:
        grid = grid[np.unique(np.round(np.linspace(0, len(grid) - 1, n)).astype(int))]
    return grid

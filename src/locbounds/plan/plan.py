"""A plan: what is measured at a static position, and what is known of it beforehand."""

from functools import cached_property, partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Bool, Float, Scalar
from locbounds.errors import InputError, RefusedError
from locbounds.noise import Gaussian, Noise
from locbounds.plan.laws import WRAPS_FROM_RAD, Table, table, wrap, wrapped_information
from locbounds.plan.observations import Observations
from locbounds.precision import double_precision, traced
from locbounds.priors import PositionPrior
from locbounds.stacks import stacks

FLAT = np.inf  # clock deviation: nothing is known of the clock


class Plan(eqx.Module):
    """Measurements of one static position, in 2-D or 3-D.

    Parameters
    ----------
    groups
        What is measured: groups of observations with independent noise.
    prior
        What is known of the position before; None: nothing, the position is a fixed unknown.
    clock_std_m
        Standard deviation of the mobile's clock offset, times the speed of light, which adds to every time of arrival:
        None if the clock is known, infinite (``locbounds.plan.FLAT``) if nothing is known of it.
    title
        One line that names it.

    Raises
    ------
    InputError
        If there is nothing measured, or numbers of coordinates differ.

    Notes
    -----
    The noise adds to noise-free values ``m(position)``; its law does not depend on the position. Gaussian channels are
    described by their joint covariance; any other noise is independent of the other channels. Angles live on the
    circle. A Gaussian clock offset is integrated out; a flat one projects the common part of the times away.

    Examples
    --------
    >>> import locbounds as lb
    >>> square = [[0, 0], [100, 0], [100, 100], [0, 100]]
    >>> plan = lb.toa(square, std_m=2.0) + lb.aoa([[0, 0]], std_rad=0.05)
    >>> plan.means(np.array([[50.0, 50.0]])).shape, plan.information(np.array([[50.0, 50.0]])).shape
    ((1, 5), (1, 2, 2))
    """

    groups: tuple[Observations, ...] = eqx.field(converter=tuple)
    prior: PositionPrior | None = None
    clock_std_m: Scalar | None = None
    title: str = eqx.field(static=True, default="")

    def __check_init__(self):
        if not self.groups:
            raise InputError("the plan measures nothing", "Give at least one group of observations")
        dims = {m.dim for m in self.measurements if m.dim is not None}
        dims |= set() if self.prior is None else {self.prior.dim}
        if len(dims) > 1:
            raise InputError(
                f"measurements and prior of the plan have {sorted(dims)} coordinates",
                "Use the same number of dimensions everywhere",
            )
        if not dims:
            raise InputError("the plan does not say how many coordinates a position has", "Give a prior, or an anchor")
        clock = self.clock_std_m
        if clock is not None and not traced(clock) and not (np.shape(clock) == () and clock > 0):
            raise InputError(
                f"the deviation of the clock offset is {clock} m",
                "Give a positive number of metres, inf if nothing is known, None if the clock is known",
            )
        if clock is not None and not np.any(self.clocked):
            raise InputError(
                "the plan has an unknown clock, and no time of arrival", "Leave the clock out, or measure ranges"
            )

    def replace(self, **changes: Any) -> "Plan":
        """A copy with some fields changed; all checks run again."""
        fields = {name: getattr(self, name) for name in ("groups", "prior", "clock_std_m", "title")}
        return Plan(**(fields | changes))

    def __add__(self, other: "Plan") -> "Plan":
        """Both plans' observations, of the same position; what is not None may be given by either, equally by both."""
        if not isinstance(other, Plan):
            return NotImplemented
        merged = {}
        for name in ("prior", "clock_std_m"):
            one, two = getattr(self, name), getattr(other, name)
            if one is not None and two is not None and one is not two and one != two:
                raise InputError(f"both plans have a {name} of their own", "Give it to the sum: plan.replace(...)")
            merged[name] = two if one is None else one
        return Plan(self.groups + other.groups, title=self.title or other.title, **merged)

    @property
    def measurements(self) -> tuple[Any, ...]:
        """All measurements."""
        return tuple(m for group in self.groups for m in group.measurements)

    @property
    def dim(self) -> int:
        """Number of coordinates of a position."""
        if self.prior is not None:
            return self.prior.dim
        return next(m.dim for m in self.measurements if m.dim is not None)

    @property
    def size(self) -> int:
        """Number of channels."""
        return sum(group.size for group in self.groups)

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of every channel."""
        return tuple(m.unit for group in self.groups for m in group.per_channel)

    @property
    def periodic(self) -> Bool[Array, " channels"]:
        """Which channels are angles on the circle."""
        return np.array([m.periodic for group in self.groups for m in group.per_channel])

    @property
    def clocked(self) -> Bool[Array, " channels"]:
        """To which channels a clock offset adds."""
        return np.array([m.clocked for group in self.groups for m in group.per_channel])

    @property
    def channel_names(self) -> tuple[str, ...]:
        """Name of every channel."""
        return tuple(name for group in self.groups for name in group.channel_names)

    @property
    def stds(self) -> Float[Array, " channels"]:
        """Standard deviation of every channel."""
        return np.concatenate([group.stds for group in self.groups])

    @property
    def anchors(self) -> Float[Array, "anchors space"]:
        """Different positions of anchors, in order of appearance."""
        found = [getattr(m, name) for m in self.measurements for name in ("reference", "anchor") if hasattr(m, name)]
        if not found:
            return np.zeros((0, self.dim))
        found = np.stack(found)
        return found[np.sort(np.unique(found, axis=0, return_index=True)[1])]

    def irregular_noise(self, finite: bool | None = False) -> str | None:
        """Which channel's noise has no finite Fisher information (None: is not known to have one), or None."""
        for group in self.groups:
            for name, noise in zip(group.channel_names, group.noises or (), strict=False):
                regularity = noise.regularity()
                if regularity.finite is finite:
                    what = "has no finite" if finite is False else "is not known to have a finite"
                    return f"the noise of {name} {what} Fisher information: {regularity.reason}"
        return None

    def too_few(self) -> str | None:
        """Why the measurements cannot determine a position anywhere, or None."""
        unknowns = self.dim + (self.clock_std_m is not None and not np.isfinite(self.clock_std_m))
        if self.size >= unknowns:
            return None
        what = f"{self.dim} coordinates" + (" and a clock" if unknowns > self.dim else "")
        return f"{self.size} measured number{'s' * (self.size > 1)} cannot determine {what}"

    @double_precision
    def means(self, points: Float[Array, "points space"]) -> Float[Array, "points channels"]:
        """Noise-free values at points."""
        return _values(*self._assembled, points)

    @double_precision
    def gradients(self, points: Float[Array, "points space"]) -> Float[Array, "points channels space"]:
        """Derivatives of the noise-free values with respect to the position."""
        return _slopes(*self._assembled, points)

    @double_precision
    def information(self, points: Float[Array, "points space"]) -> Float[Array, "points space space"]:
        """Fisher information of the measurements about the position, the clock eliminated, in 1/m^2."""
        H = _slopes(*self._assembled, points)
        return jnp.einsum("pia,ij,pjb->pab", H, self.accuracy, H)

    @property
    @double_precision
    def accuracy(self) -> Float[Array, "channels channels"]:
        """W in ``information = H^T W H``: intrinsic accuracies, the clock offset eliminated (Schur complement).

        Raises
        ------
        RefusedError
            If a noise has no finite Fisher information.
        """
        return self.without_clock(self.accuracy_with_clock)

    def without_clock(self, W: Float[Array, "channels channels"]) -> Float[Array, "channels channels"]:
        """Eliminate the clock offset from an accuracy of the channels."""
        if self.clock_std_m is None:
            return W
        xp = jnp if traced(W, self.clock_std_m) else np
        clocked = np.asarray(self.clocked, dtype=float)
        seen: Any = W @ clocked
        total = clocked @ seen + 1.0 / xp.asarray(self.clock_std_m) ** 2
        return W - xp.outer(seen, seen) / total

    @property
    @double_precision
    def accuracy_with_clock(self) -> Float[Array, "channels channels"]:
        """Intrinsic accuracies of the channels for a known clock: the inverse covariance if all are Gaussian."""
        blocks: list[Any] = []
        start = 0
        for group in self.groups:
            names, here = group.channel_names, slice(start, start + group.size)
            start = here.stop
            if group.covariance is not None:
                blocks.append(jnp.linalg.inv(group.covariance) if traced(group) else np.linalg.inv(group.covariance))
                continue
            each = [
                _accuracy(noise, bool(periodic), name)
                for noise, periodic, name in zip(group.noises or (), self.periodic[here], names, strict=True)
            ]
            blocks.append(jnp.diag(jnp.stack(each)) if traced(each) else np.diag(np.array(each, dtype=float)))
        if traced(blocks):
            return jax.scipy.linalg.block_diag(*blocks)
        from scipy.linalg import block_diag

        return np.asarray(block_diag(*blocks))

    @cached_property
    def _assembled(self) -> tuple[list, tuple[int, ...], np.ndarray]:
        """Stacks of alike measurements, how many each has, and where each of their channels belongs."""
        starts = np.concatenate([[0], np.cumsum([m.size for m in self.measurements])])
        found = stacks(self.measurements)
        order = [starts[i] + np.arange(self.measurements[i].size) for index, _ in found for i in index]
        counts = tuple(len(index) for index, _ in found)
        return [stack for _, stack in found], counts, np.argsort(np.concatenate(order))

    # ---- how well two places are told apart -------------------------------------------------------------------

    @property
    def gaussian(self) -> Bool[Array, " channels"]:
        """Which channels are jointly Gaussian; wide angles, whose law on the circle is not, are not."""
        wide = self.periodic & (self.stds > WRAPS_FROM_RAD)
        normal = [
            group.noises is None or type(group.noises[i]) is Gaussian
            for group in self.groups
            for i in range(group.size)
        ]
        return np.array(normal) & ~wide

    @cached_property
    def precision(self) -> Float[Array, "gaussians gaussians"]:
        """Inverse covariance of the Gaussian channels, the clock offset integrated out.

        Raises
        ------
        RefusedError
            If channels that are not Gaussian depend on the Gaussian ones, by a covariance or a common clock.
        """
        mine = self.gaussian
        if self.clock_std_m is not None and np.any(self.clocked & ~mine):
            raise RefusedError(
                "a clock offset is common to channels whose noise is not Gaussian",
                "Use lb.crlb, which takes that, or Gaussian noise, or a known clock",
            )
        W, start = np.zeros((self.size, self.size)), 0
        for group in self.groups:
            here = np.arange(start, start + group.size)
            start += group.size
            C = np.diag(group.stds**2) if group.covariance is None else np.asarray(group.covariance)
            apart = ~np.eye(group.size, dtype=bool) & ~(mine[here][:, None] & mine[here])
            if np.any(C[apart] != 0):
                raise RefusedError(
                    f"wide angles (above {WRAPS_FROM_RAD} rad) with noise correlated to other channels",
                    "Give them noise of their own",
                )
            g = here[mine[here]]
            W[np.ix_(g, g)] = np.linalg.inv(C[np.ix_(mine[here], mine[here])])
        return self.without_clock(W)[np.ix_(mine, mine)]

    @cached_property
    def tables(self) -> tuple[tuple[int, Table], ...]:
        """Channels that are not Gaussian, each with the table of its noise."""
        made: dict[Any, Table] = {}
        out, start = [], 0
        for group in self.groups:
            for i in range(group.size):
                c = start + i
                if not self.gaussian[c]:
                    noise = Gaussian(0.0, group.stds[i]) if group.noises is None else group.noises[i]
                    leaves, structure = jax.tree.flatten(noise)
                    key = (structure, tuple(np.asarray(x).tobytes() for x in leaves), bool(self.periodic[c]))
                    if key not in made:
                        made[key] = double_precision(table)(noise, bool(self.periodic[c]))
                    out.append((c, made[key]))
            start += group.size
        return tuple(out)

    def differences(
        self, a: Float[Array, "points space"], b: Float[Array, "points space"]
    ) -> Float[Array, "points channels"]:
        """Differences of the noise-free values at two places each, angles wrapped."""
        d = self.means(a) - self.means(b)
        return (jnp if traced(d) else np).where(self.periodic, wrap(d), d)

    @double_precision
    def log_bhattacharyya(
        self, a: Float[Array, "points space"], b: Float[Array, "points space"]
    ) -> Float[Array, " points"]:
        """Logarithm of the Bhattacharyya coefficient of the measurements' laws at two places each.

        For Gaussian channels ``-|m(a) - m(b)|^2 / 8`` in the Mahalanobis distance; other channels add their own.
        """
        return self.log_rho(self.differences(a, b))

    def log_rho(self, d: Float[Array, "*points channels"]) -> Float[Array, "*points"]:
        """The same, of given differences of noise-free values."""
        xp = jnp if traced(d) else np
        log = -self._squares(d[..., self.gaussian]) / 8
        for c, its in self.tables:
            log = log + xp.log(xp.maximum(its.rho(d[..., c]), 1e-300))
        return log

    def _squares(self, d: Array) -> Array:
        return (jnp if traced(d) else np).einsum("...i,ij,...j->...", d, self.precision, d)

    @property
    def minimum_error_exact(self) -> bool:
        """Whether :meth:`minimum_error` is exact, rather than a lower bound of it."""
        return len(self.tables) + bool(np.any(self.gaussian)) <= 1

    @double_precision
    def minimum_error(
        self, a: Float[Array, "points space"], b: Float[Array, "points space"]
    ) -> Float[Array, " points"]:
        """Smallest probability of error in deciding between two equally probable places each.

        Exact for Gaussian channels, ``Q(|m(a) - m(b)| / 2)``, and for a single other channel. Otherwise the largest of
        valid lower bounds: ``(1 - sqrt(1 - rho^2)) / 2``; half the product of the channels' ``2 P`` (the minimum of
        two products is not below the product of the minima); and, if all noises are Gaussian and only angles are
        wide, the error of their unwrapped differences.
        """
        return self.p_min(self.differences(a, b))

    def p_min(self, d: Float[Array, "*points channels"]) -> Float[Array, "*points"]:
        """The same, of given differences of noise-free values."""
        xp: Any = jnp if traced(d) else np
        if xp is np:
            from scipy.special import erfc
        else:
            from jax.scipy.special import erfc

        if not self.tables:
            return 0.5 * erfc(xp.sqrt(self._squares(d)) / np.sqrt(8.0))
        if self.minimum_error_exact:
            c, its = self.tables[0]
            return its.p_min(d[..., c])
        rho = xp.exp(self.log_rho(d))
        bound = 0.5 * rho**2 / (1 + xp.sqrt(xp.maximum(1 - rho**2, 0.0)))
        product = 0.5 * erfc(xp.sqrt(self._squares(d[..., self.gaussian])) / np.sqrt(8.0))
        for c, its in self.tables:
            product = product * 2 * its.p_min(d[..., c])
        bound = xp.maximum(bound, product)
        if all(group.noises is None or all(type(n) is Gaussian for n in group.noises) for group in self.groups):
            square = self._squares(d[..., self.gaussian])
            square = square + sum((d[..., c] / self.stds[c]) ** 2 for c, _ in self.tables)
            bound = xp.maximum(bound, 0.5 * erfc(xp.sqrt(square) / np.sqrt(8.0)))
        return bound

    def dangers(self) -> tuple[str, ...]:
        """What is legal but dangerous, one sentence each."""
        return ()


def _accuracy(noise: Noise, periodic: bool, name: str) -> Scalar:
    if traced(noise):
        return noise.information()
    regularity = noise.regularity()
    if regularity.finite is False:
        raise RefusedError(
            f"the noise of {name} has no finite Fisher information: {regularity.reason}",
            "Bounds that compare shifted copies (wwb, ezzb) apply",
        )
    if periodic and np.sqrt(noise.variance) > WRAPS_FROM_RAD:
        return wrapped_information(noise)
    return float(noise.information())


def _columns(rows: list, order: Any) -> Array:
    """Channels of all stacks [k, points(, size), ...] as [points, channels, ...], in the plan's order."""
    return jnp.concatenate(rows, axis=1)[:, order]


@partial(jax.jit, static_argnums=1)
def _values(parts: list, counts: tuple[int, ...], order: Any, points: Array) -> Array:
    def one(part: Any, k: int, p: Array) -> Array:
        return jax.vmap(lambda m: jnp.ravel(m(p)), axis_size=k)(part).ravel()

    rows = [jax.vmap(partial(one, part, k))(jnp.asarray(points)) for part, k in zip(parts, counts, strict=True)]
    return _columns(rows, order)


@partial(jax.jit, static_argnums=1)
def _slopes(parts: list, counts: tuple[int, ...], order: Any, points: Array) -> Array:
    def one(part: Any, k: int, p: Array) -> Array:
        slopes = jax.vmap(lambda m: jnp.reshape(jax.jacfwd(m)(p), (-1, len(p))), axis_size=k)(part)
        return slopes.reshape(-1, len(p))

    rows = [jax.vmap(partial(one, part, k))(jnp.asarray(points)) for part, k in zip(parts, counts, strict=True)]
    return _columns(rows, order)

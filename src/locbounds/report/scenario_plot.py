"""The picture of a scenario: anchors, prior, a few tracks."""

from functools import partial
from typing import TYPE_CHECKING

import jax
import numpy as np

from locbounds.axes import Array, Float
from locbounds.blocks import Stream, block_key, check_seed
from locbounds.precision import double_precision
from locbounds.scenario import Scenario
from locbounds.simulation import draw_states

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SIGMAS_95 = 2.4477  # radius that holds 95 % of a two-dimensional Gaussian: sqrt(-2 log 0.05)
CLOSE_UP = 0.5  # tracks that fill less of the picture than this get a panel of their own
BLUE, ORANGE, GREY = "#0072B2", "#D55E00", "#5F6B75"


def draw_scenario(scenario: Scenario, *, tracks: int = 8, seed: int = 0) -> "Figure":
    """Anchors, the prior's 95 % ellipse and simulated tracks, in metres with equal axes; 3-D seen from above.

    Parameters
    ----------
    scenario
        What to draw.
    tracks
        Number of simulated tracks.
    seed
        Seed of the tracks.

    Returns
    -------
    matplotlib.figure.Figure
        With a second panel around the tracks where they are small in the first.

    Examples
    --------
    >>> import locbounds as lb
    >>> len(draw_scenario(lb.papers.fritsche2013.scenario(steps=10)).axes)
    2
    """
    from matplotlib.figure import Figure

    paths = _simulated(scenario, check_seed(seed), tracks)[..., :2]
    index = list(scenario.motion.position_index[:2])
    ellipse = _ellipse(scenario.prior.mean[index], scenario.prior.covariance[np.ix_(index, index)])
    moving = np.vstack([paths.reshape(-1, 2), ellipse])
    everything = np.vstack([moving, scenario.anchors[:, :2]])
    close_up = np.max(np.ptp(moving, axis=0)) < CLOSE_UP * np.max(np.ptp(everything, axis=0))

    figure = Figure(figsize=(10.5 if close_up else 6.0, 5.2), layout="constrained")
    axes = figure.subplots(1, 2 if close_up else 1, squeeze=False)[0]
    for panel in axes:
        _draw(panel, scenario, paths, ellipse)
    _frame(axes[0], everything)
    view = ", seen from above" if scenario.dim == 3 else ""
    axes[0].set_title(f"{scenario.title or 'Scenario'}{view}", loc="left", fontsize=10, wrap=True)
    if close_up:
        _frame(axes[1], moving)
        axes[1].set_title("The mobile, close up", loc="left", fontsize=10)
        low, size = moving.min(axis=0), np.ptp(moving, axis=0)
        axes[0].add_patch(_rectangle(low - 0.05 * size, 1.1 * size))
    axes[-1].legend(loc="best", fontsize=8, frameon=False)
    return figure


@double_precision
def _simulated(scenario: Scenario, seed: int, runs: int) -> Float[Array, "runs times space"]:
    return _positions(scenario, block_key(seed, Stream.TRACKS, 0), runs)


@partial(jax.jit, static_argnames="runs")
def _positions(scenario: Scenario, key: Array, runs: int) -> Float[Array, "runs times space"]:
    """Positions only: a small program that compiles at once."""
    return scenario.motion.position(draw_states(key, scenario, runs))


def _draw(panel: "Axes", scenario: Scenario, paths: Float[Array, "runs times 2"], ellipse: Float[Array, "n 2"]) -> None:
    for k, path in enumerate(paths):
        panel.plot(*path.T, color=BLUE, lw=0.9, alpha=0.7, label=f"{len(paths)} simulated tracks" if k == 0 else None)
        panel.plot(*path[-1], ".", color=BLUE, ms=4, label="their ends" if k == 0 else None)
    panel.fill(*ellipse.T, facecolor=ORANGE, alpha=0.25, edgecolor=ORANGE, label="prior, 95 %")
    panel.plot(*scenario.anchors[:, :2].T, "^", color="black", ms=8, label="anchors")
    for link, anchor in zip(scenario.links, scenario.anchors, strict=True):
        panel.annotate(
            link.name, anchor[:2], (6, 6), textcoords="offset points", fontsize=9, annotation_clip=True, clip_on=True
        )
    panel.set_aspect("equal")
    panel.set_xlabel("x in m")
    panel.set_ylabel("y in m")
    panel.grid(lw=0.4, color="0.88")
    panel.tick_params(labelsize=8, colors=GREY)


def _frame(panel: "Axes", points: Float[Array, "n 2"]) -> None:
    """Limits around the points, with a margin, never of zero width."""
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    half = np.maximum(np.ptp(points, axis=0), 0.3 * np.max(np.ptp(points, axis=0)) or 1.0) * 0.62
    panel.set_xlim(middle[0] - half[0], middle[0] + half[0])
    panel.set_ylim(middle[1] - half[1], middle[1] + half[1])


def _ellipse(mean: Float[Array, " 2"], covariance: Float[Array, "2 2"]) -> Float[Array, "n 2"]:
    """Points on the 95 % ellipse of a Gaussian."""
    values, vectors = np.linalg.eigh(covariance)
    angle = np.linspace(0, 2 * np.pi, 121)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return mean + SIGMAS_95 * circle * np.sqrt(np.maximum(values, 0)) @ vectors.T


def _rectangle(corner: Float[Array, " 2"], size: Float[Array, " 2"]):
    from matplotlib.patches import Rectangle

    (x, y), (width, height) = corner.tolist(), size.tolist()
    return Rectangle((x, y), width, height, fill=False, edgecolor=GREY, lw=0.8, ls=":")

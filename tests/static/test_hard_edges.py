"""The least error where noise has hard edges: few nodes are possible for a draw."""

import numpy as np
import pytest

import locbounds as lb
from locbounds.static.mmse import REPLICATES, draw, likelihood, nodes_of, posterior

STATIONS = np.array([[0.0, 15.0], [-13.0, -7.5], [13.0, -7.5]])
STD = 4.0


def plan() -> lb.Plan:
    return lb.toa(STATIONS, [lb.Uniform(-1.0, 1.0)] * 3, prior=lb.GaussianPrior([0, 0], STD**2 * np.eye(2)))


def posterior_variance(ranges: np.ndarray, across: int = 100) -> float:
    """By sums over grids of the places that are possible, the second one over the box of the first."""
    low, high = (STATIONS - ranges[:, None] - 1).max(0), (STATIONS + ranges[:, None] + 1).min(0)
    places = np.zeros((0, 2))
    for _ in range(3):
        sides = [np.linspace(a, b, across) for a, b in zip(low, high, strict=True)]
        grid = np.stack(np.meshgrid(*sides, indexing="ij"), -1).reshape(-1, 2)
        away = np.linalg.norm(grid[:, None] - STATIONS, axis=-1)
        places = grid[np.all(np.abs(away - ranges) <= 1, axis=1)]
        step = 2 * (high - low) / (across - 1)
        low, high = np.maximum(low, places.min(0) - step), np.minimum(high, places.max(0) + step)
    weights = np.exp(-0.5 * np.sum(places**2, 1) / STD**2)
    weights /= weights.sum()
    return float(weights @ np.sum((places - weights @ places) ** 2, 1))


def test_least_error_of_hard_edges_is_that_of_a_grid():
    rng = np.random.default_rng(3)
    at = STD * rng.normal(size=(100, 2))
    ranges = np.linalg.norm(at[:, None] - STATIONS, axis=-1) + rng.uniform(-1, 1, (100, 3))
    by_hand = np.array([posterior_variance(z) for z in ranges])
    found = lb.mmse(plan(), draws=256, rtol=0.02)
    groups = found.replicates[:, 0]
    spread = np.hypot(by_hand.std() / np.sqrt(100), groups.std(ddof=1) / np.sqrt(len(groups)))
    assert abs(found.position_mse[0] - by_hand.mean()) < 3 * spread


def test_each_posterior_of_hard_edges_is_that_of_a_grid():
    """On the same draws: nothing but the quadrature differs."""
    its = plan()
    law = likelihood(its)
    drawn = draw(its, law, 2, REPLICATES, 0)
    nodes = nodes_of(its, law, 500)
    mine = np.trace(posterior(law, nodes, drawn).covariance, axis1=1, axis2=2)
    theirs = np.array([posterior_variance(z) for z in drawn.measured[1]])
    assert mine.mean() == pytest.approx(theirs.mean(), rel=0.02)


@pytest.mark.parametrize(("half_width_m", "some"), [(3.0, False), (1.0, True)])
def test_draws_that_no_node_explains_are_counted_and_told(half_width_m, some):
    """With coarse nodes: none of them lies where all three ranges are possible, and the error found is too small."""
    noises = [lb.Uniform(-half_width_m, half_width_m)] * 3
    its = lb.toa(STATIONS, noises, prior=lb.GaussianPrior([0, 0], STD**2 * np.eye(2)))
    found = lb.mmse(its, draws=32, rtol=0.1)
    law = likelihood(its)
    drawn = draw(its, law, 2, REPLICATES, 0)
    nodes = nodes_of(its, law, 60)
    gap = drawn.measured[1][:, None] - nodes.features[1]
    none = ~np.any(np.all(np.abs(gap) <= half_width_m, axis=2), axis=1)
    np.testing.assert_array_equal(posterior(law, nodes, drawn).missed, none)
    missed = found.diagnostics["missed"]
    assert (missed > 0) == some
    assert any(f"no node is possible for {missed} of 32 draws" in w for w in found.verdict.warnings) == some


def test_unknown_clock_with_hard_edges_is_refused():
    """Not taken for a known clock."""
    unknown = plan().replace(clock_std_m=np.inf)
    for method in (lb.mmse, lb.ml, lb.ls):
        with pytest.raises(lb.RefusedError, match="clock offset is common"):
            method(unknown)

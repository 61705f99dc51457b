"""Figs. 7 and 8: the geometry in closed form, the bounds and the least error by brute force."""

import numpy as np
import pytest

from locbounds.papers.mcguire2009 import figure_csv
from locbounds.papers.mcguire2009 import streets as study
from locbounds.propagation import street_links

INSIDE_M = 10.0  # half a street


def lengths(p):
    """Path lengths on the stretch, by hand: the street itself, and d_c + d_r around the corners (310, +-10)."""
    x, y = p.T
    out = [np.hypot(x, y)]
    for sign in (-1, 1):
        corner, station = np.array([310.0, sign * 10.0]), np.array([320.0, sign * 320.0])
        bent = np.linalg.norm(p - corner, axis=1) + np.linalg.norm(station - corner)
        free = x >= 320 - 10 * (320 - sign * y) / 310  # right of the line from the station past the corner
        out.append(np.where(free, np.linalg.norm(p - station, axis=1), bent))
    return np.stack(out, axis=1)


def inside(p):
    x, y = p.T
    return (np.abs(y) <= INSIDE_M) & (x >= np.abs(y)) & (320 - x >= np.abs(y))


def grid(nx=640, ny=40):
    x, y = (np.arange(nx) + 0.5) * 320 / nx, (np.arange(ny) + 0.5) * 20 / ny - 10
    p = np.stack(np.meshgrid(x, y, indexing="ij"), -1).reshape(-1, 2)
    return p[inside(p)]


def test_the_layout():
    cell, places = study.stretch()
    assert cell.share == pytest.approx(1 / 8)
    assert cell.region.area == pytest.approx(6200)
    points = grid(160, 20)
    links = street_links(study.city(3), places, points)
    np.testing.assert_allclose(links.length_m, lengths(points), atol=1e-9)
    np.testing.assert_allclose(study.plan().means(points), lengths(points), atol=1e-9)


def test_the_texts_statements():
    found = study.sight_shares(24)
    assert found.nearest_los == 1.0
    assert found.corners == 1.0
    x = np.linspace(300, 320, 2001)  # sight of a second station: only inside the crossing
    p = np.stack(np.meshgrid(x, np.linspace(-10, 10, 401), indexing="ij"), -1).reshape(-1, 2)
    p = p[inside(p)]
    free = np.linalg.norm(p - [320.0, 320.0], axis=1) == lengths(p)[:, 2]
    area = free.sum() * 0.01 * 0.05
    assert found.other_los == pytest.approx(area / 6200, abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("case", ["ToA", pytest.param("TDoA", marks=pytest.mark.slow)])
def test_bounds_and_least_error_by_brute_force(case, monkeypatch):
    monkeypatch.setattr(study, "GRID", (6, 4))  # a coarser search finds a bound that is valid too
    monkeypatch.setattr(study, "ZOOMS", 3)
    sigma = 20.0
    F = np.eye(3) if case == "ToA" else np.array([[-1.0, 1, 0], [-1, 0, 1]])
    W = np.linalg.inv(sigma**2 * F @ F.T)

    def rho(a, b):
        d = (lengths(a) - lengths(b)) @ F.T
        return np.exp(-np.einsum("ni,ij,nj->n", d, W, d) / 8)

    ((value, h, _),) = study.weiss_weinstein(case, [sigma])
    p = grid()
    zero, steps = np.zeros(2), np.diag(h)

    def term(u, v):
        keep = inside(p) & inside(p + u) & inside(p + v)
        return np.sum(rho(p[keep] + u, p[keep] + v)) / len(p)

    mu = np.array([term(zero, u) for u in steps])
    q = np.array([[term(u, v) + term(-u, -v) - term(u, -v) - term(-u, v) for v in steps] for u in steps])
    by_hand = np.sqrt(np.trace((steps.T * mu) @ np.linalg.inv(q) @ (steps.T * mu).T))
    assert value == pytest.approx(by_hand, rel=5e-3)  # edges of the support on a grid of half a metre

    rng = np.random.default_rng(0)
    truth = p[rng.integers(0, len(p), 4000)]
    z = (lengths(truth) + sigma * rng.normal(size=(4000, 3))) @ F.T
    m, square = lengths(p) @ F.T, []
    for k in range(0, 4000, 100):
        d = z[k : k + 100, None] - m
        weight = np.exp(-0.5 * np.einsum("nki,ij,nkj->nk", d, W, d))
        mean = weight @ p / weight.sum(1, keepdims=True)
        square.append(np.sum((mean - truth[k : k + 100]) ** 2, axis=1))
    square = np.concatenate(square)
    mean, error = square.mean(), square.std() / np.sqrt(len(square))
    rows = {row.method: row for row in study.fig8([sigma], cases=[case])}
    assert abs(rows["MMSE"].rmse_m ** 2 - mean) < 4 * error
    for method in ("WWB", "WWB, one length", "EZZB"):
        assert rows[method].valid == "valid"
        assert rows[method].rmse_m < rows["MMSE"].rmse_m + 3 * rows["MMSE"].stderr_m
    assert rows["WWB, one length"].rmse_m <= rows["WWB"].rmse_m * 1.01


def test_figures():
    rows = [study.Row(c, s, m, 5.0, 0.1, "valid") for c in study.STREET_CASES for s in (1.0, 10.0) for m in study.LOOKS]
    assert figure_csv(rows).splitlines()[:2] == ["case,sigma,method,rmse_m,stderr_m,valid", "ToA,1,MMSE,5,0.1,valid"]
    assert len(study.fig8_figure(rows).axes) == 2
    assert study.fig7_figure().axes[0].get_xlabel() == "x in m"

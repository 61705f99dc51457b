"""Bounds of a static position written down once more, slowly: sums over grids, straight from their definitions."""

import numpy as np
from scipy.special import erfc


def grid(inside, low, high, step):
    """Centres of cells in a box that are inside."""
    axes = [np.arange(a + step / 2, b, step) for a, b in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, len(low))
    return points[inside(points)]


def gaussian(means):
    """Bhattacharyya coefficient and error probability of unit Gaussian noise, as functions of two sets of places."""

    def squares(a, b):
        return np.square(means(a) - means(b)).sum(-1)

    return lambda a, b: np.exp(-squares(a, b) / 8), lambda a, b: 0.5 * erfc(np.sqrt(squares(a, b) / 8))


def wrapped(angles, std, cells=400):
    """The same of angles with wide normal noise; for the error the lower bound from their shorter difference."""
    w = -np.pi + 2 * np.pi * np.arange(cells) / cells
    turns = 2 * np.pi * np.arange(-8, 9)

    def density(x):
        return np.exp(-0.5 * ((x[:, None] + turns) / std) ** 2).sum(1) / (std * np.sqrt(2 * np.pi))

    at = np.linspace(0, np.pi, 200)
    table = np.array([np.sum(np.sqrt(density(w) * density(w - d))) * 2 * np.pi / cells for d in at])

    def gaps(a, b):
        return np.abs(np.angle(np.exp(1j * (angles(a) - angles(b)))))

    return (
        lambda a, b: np.interp(gaps(a, b), at, table).prod(-1),
        lambda a, b: 0.5 * erfc(np.linalg.norm(gaps(a, b), axis=-1) / std / np.sqrt(8)),
    )


def weiss_weinstein(points, step, inside, affinity, H):
    """WWB matrix of a uniform prior, all expectations over the same cells."""
    area = len(points) * step ** points.shape[1]
    tests = list(H.T)

    def integral(u, v):
        both = points[inside(points + u) & inside(points + v)]
        return np.sum(affinity(both + u, both + v)) * step ** points.shape[1] / area

    mu = np.array([integral(0 * h, h) for h in tests])
    q = np.array(
        [[integral(h, g) + integral(-h, -g) - integral(h, -g) - integral(-h, g) for g in tests] for h in tests]
    )
    return (H * mu) @ np.linalg.inv(q) @ (H * mu).T


def ziv_zakai(points, inside, error, a, longest, cells=400):
    """EZZB along a, shifts along a, a uniform prior."""
    h = (np.arange(cells) + 0.5) * longest / cells
    A = []
    for k in h:
        both = points[inside(points + k * a)]
        A.append(np.sum(2 * error(both, both + k * a)) / len(points))
    filled = np.maximum.accumulate(np.array(A)[::-1])[::-1]
    return 0.5 * np.sum(h * filled) * longest / cells


def joint_in_one_dimension(prior, mean, std, theta, z):
    """Joint density [theta, z] of a position on a line and one measurement."""
    return prior(theta)[:, None] * np.exp(-0.5 * ((z - mean(theta)[:, None]) / std) ** 2) / (std * np.sqrt(2 * np.pi))


def least_error_of_two_ranges(points, anchors, std, dz):
    """Least mean square error of a uniform prior and two ranges: every posterior on a grid of measurements."""
    r = np.linalg.norm(points[:, None] - anchors, axis=-1)
    one, two = (
        np.exp(-0.5 * ((np.arange(c.min() - 5 * std, c.max() + 5 * std, dz)[:, None] - c) / std) ** 2) for c in r.T
    )
    moments = [(one * w) @ two.T for w in (np.ones(len(points)), *points.T)]
    known = sum(m**2 for m in moments[1:]) / moments[0]
    share = dz**2 / (2 * np.pi * std**2 * len(points))
    return np.mean(np.square(points).sum(1)) - np.sum(known) * share


def weiss_weinstein_from_densities(joint, shifts, exponent, step, dz):
    """(13) to (16) with L^(1-s), from the joint density on a grid; shifts in whole cells."""
    f = joint
    there = f > 0

    def moved(k):
        out = np.zeros_like(f)
        if k >= 0:
            out[: len(f) - k] = f[k:]
        else:
            out[-k:] = f[:k]
        return out

    with np.errstate(divide="ignore", invalid="ignore"):
        psi = [np.where(there, (moved(k) / f) ** exponent - (moved(-k) / f) ** (1 - exponent), 0.0) for k in shifts]
        mu = [np.sum(np.where(there, (moved(k) / f) ** exponent * f, 0.0)) * step * dz for k in shifts]
    G = np.array([[np.sum(p * q * f) * step * dz / (m * n) for q, n in zip(psi, mu, strict=True)]
                  for p, m in zip(psi, mu, strict=True)])  # fmt: skip
    H = np.array(shifts)[None] * step
    return (H @ np.linalg.inv(G) @ H.T)[0, 0]


def least_error(joint, theta, step, dz):
    """Mean square error of the posterior mean."""
    weight = joint.sum(0)
    mean = np.divide(theta @ joint, weight, out=np.zeros_like(weight), where=weight > 0)
    return np.sum(joint * (theta[:, None] - mean) ** 2) * step * dz

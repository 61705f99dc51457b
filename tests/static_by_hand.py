"""Bounds of a static position written down once more, slowly: sums over grids, straight from their definitions."""

import numpy as np
from scipy.special import erfc


def grid(inside, low, high, step):
    """Centres of cells in a box that are inside."""
    axes = [np.arange(a + step / 2, b, step) for a, b in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, len(low))
    return points[inside(points)]


def weiss_weinstein(points, step, inside, means, H):
    """WWB matrix of a uniform prior and unit Gaussian noise, all expectations over the same cells."""
    area = len(points) * step ** points.shape[1]
    tests = list(H.T)

    def root(u):
        return inside(points + u) / np.sqrt(area)

    def affinity(u, v):
        return np.exp(-np.square(means(points + u) - means(points + v)).sum(-1) / 8)

    def integral(u, v):
        return np.sum(root(u) * root(v) * affinity(u, v)) * step ** points.shape[1]

    mu = np.array([integral(0 * h, h) for h in tests])
    q = np.array(
        [[integral(h, g) + integral(-h, -g) - integral(h, -g) - integral(-h, g) for g in tests] for h in tests]
    )
    return (H * mu) @ np.linalg.inv(q) @ (H * mu).T


def ziv_zakai(points, step, inside, means, a, longest, cells=400):
    """EZZB along a, shifts along a, a uniform prior and unit Gaussian noise."""
    h = (np.arange(cells) + 0.5) * longest / cells
    A = []
    for k in h:
        both = inside(points + k * a)
        d = np.linalg.norm(means(points[both] + k * a) - means(points[both]), axis=-1)
        A.append(np.sum(erfc(d / np.sqrt(8))) / len(points))
    filled = np.maximum.accumulate(np.array(A)[::-1])[::-1]
    return 0.5 * np.sum(h * filled) * longest / cells


def joint_in_one_dimension(prior, mean, std, theta, z):
    """Joint density [theta, z] of a position on a line and one measurement."""
    return prior(theta)[:, None] * np.exp(-0.5 * ((z - mean(theta)[:, None]) / std) ** 2) / (std * np.sqrt(2 * np.pi))


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

"""Independent oracles: the least error by quadrature, and the best assignment by trying all."""

import itertools

import numpy as np

from locbounds.survey import Fingerprints, survey_model


def small_survey(rng, *, points=None, columns=None, space=None, noise_db=1.0):
    """A random survey of few points with one or two access points, from hopeless to clear."""
    n = points or int(rng.integers(2, 8))
    m = columns or (2 if rng.random() < 0.2 else 1)
    s = space or int(rng.integers(1, 4))
    place = rng.integers(0, 4, (n, s)) if rng.random() < 0.3 else rng.normal(size=(n, s)) * rng.choice([0.3, 1, 5])
    place = place + 1e-3 * np.arange(n)[:, None]  # no two equal
    heard = -60 + rng.normal(size=(n, m)) * rng.choice([0.2, 1.0, 3.0, 8.0])
    if rng.random() < 0.3:  # a line of fingerprints along the first axis
        heard[:, 0] = -60 + rng.choice([0.3, 1.0, 3.0]) * place[:, 0]
    heard = heard + 1e-6 * np.arange(n)[:, None]
    return survey_model(Fingerprints.at(place.astype(float), heard), noise_db=noise_db, twins=True)


def exact_mmse(model, scale=1.0):
    """Least mean square error per axis, and what the rule may be wrong by: trapezoidal rule over all fingerprints.

    A pair of points contributes f_i f_j / sum f, a Gaussian over a hyperbolic cosine with poles at pi / d_ij: the rule
    with the step h errs by about exp(-2 pi^2 / (d h) - d^2 / 8). In one column h = 0.02, relative 1e-9 up to d = 47; in
    two columns h = 0.2, at most 2e-9 of the squared extent (near d = 7).
    """
    x = np.asarray(model.mean) / (model.noise.deviation * scale)
    step, wrong = (0.02, 0.0) if x.shape[1] == 1 else (0.2, 1e-8)
    axes = [np.arange(column.min() - 8, column.max() + 8 + step, step) for column in x.T]
    z = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, x.shape[1])
    density = np.exp(-np.sum((z[:, None] - x) ** 2, -1) / 2) / (2 * np.pi) ** (x.shape[1] / 2)
    total = density.sum(1)
    seen = total > 0
    density, total = density[seen], total[seen]
    both = density.T @ (density / total[:, None]) * step ** x.shape[1] / len(x)  # int f_i f_j / (N sum f)
    apart2 = (model.position_m[:, None] - model.position_m) ** 2
    return np.einsum("ij,ijk->k", both, apart2) / 2, wrong * apart2.max(axis=(0, 1))


def best_injection(weight, allowed):
    """The largest sum of weights over all partial injections."""
    n = len(weight)
    return max(sum(weight[i, j] for i, j in enumerate(p) if allowed[i, j]) for p in itertools.permutations(range(n)))

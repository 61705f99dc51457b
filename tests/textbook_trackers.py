"""The trackers of Chen 2010 as a textbook writes them: one track, plain NumPy, matrix inverses, loops."""

import itertools

import numpy as np

from textbook_filters import ekf_update, gain_form, moment_match, ranges


def noise(model, link, mode):
    return model.weights[link, mode], model.means[link, mode], model.variances[link, mode]


def ekf_banks(model, z):
    """Fusion by inverses of covariances; the negative eigenvalue of an information is set to zero."""
    links, modes, _ = model.means.shape
    x, P, mu = model.m0, model.P0, model.start.copy()
    means, covariances, clipped = [x], [P], 0
    for k in range(len(z)):
        x, P = model.F[k] @ x, model.F[k] @ P @ model.F[k].T + model.Q[k]
        prior = np.linalg.inv(P)
        J, b = prior.copy(), np.zeros(len(x))
        for m in range(links):
            c = mu[m] @ model.transitions[m, k]
            mu[m] = c
            if np.isnan(z[k, m]):
                continue
            bank = [ekf_update(x, P, z[k, [m]], model.anchors[[m]], [noise(model, m, j)]) for j in range(modes)]
            mu[m] = c * [part[2] for part in bank]
            mu[m] /= mu[m].sum()
            x_m, P_m = moment_match(mu[m], np.array([part[0] for part in bank]), np.array([part[1] for part in bank]))
            added = np.linalg.inv(P_m) - prior
            if np.trace(added @ P) < 0:
                clipped += 1
                added = 0 * added
            J += added
            b += (prior + added) @ (x_m - x)
        P = np.linalg.inv(J)
        x = x + P @ b
        means.append(x)
        covariances.append(P)
    return np.array(means), np.array(covariances), clipped


def decentralised_ekf(model, z, sight, *, printed):
    """Eqs. (22)-(26), with one component per noise."""
    x, P = model.m0, model.P0
    means, covariances = [x], [P]
    for k in range(len(z)):
        x, P = model.F[k] @ x, model.F[k] @ P @ model.F[k].T + model.Q[k]
        h, H = ranges(x[: model.anchors.shape[1]], model.anchors, len(x))
        seen = np.flatnonzero(~np.isnan(z[k]))
        mean, R = (np.array([a[m, sight[k, m], 0] for m in range(len(h))]) for a in (model.means, model.variances))
        prior = np.linalg.inv(P)
        P = np.linalg.inv(prior + sum((np.outer(H[m], H[m]) / R[m] for m in seen), np.zeros_like(P)))
        step = np.zeros(len(x))
        for m in seen:
            alone = np.linalg.inv(prior + np.outer(H[m], H[m]) / R[m])
            step += (alone if printed else P) @ H[m] / R[m] * (z[k, m] - h[m] - mean[m])
        x = x + step
        means.append(x)
        covariances.append(P)
    return np.array(means), np.array(covariances)


def every_sequence(model, z):
    """The mixture over all sight sequences, each with its own EKF: exact where the ranges are linear."""
    links, modes, _ = model.means.shape
    joint = list(itertools.product(range(modes), repeat=links))
    tracks = [(None, 1.0, model.m0, model.P0)]
    result = [moment_match(np.ones(1), model.m0[None], model.P0[None])]
    for k in range(len(z)):
        longer = []
        for before, w, x, P in tracks:
            x, P = model.F[k] @ x, model.F[k] @ P @ model.F[k].T + model.Q[k]
            for r in joint:
                T = model.transitions[:, k]
                law = [model.start[m] @ T[m] if before is None else T[m, before[m]] for m in range(links)]
                noises = [noise(model, m, r[m]) for m in range(links)]
                x_r, P_r, likelihood = ekf_update(x, P, z[k], model.anchors, noises)
                longer.append((r, w * likelihood * np.prod([law[m][r[m]] for m in range(links)]), x_r, P_r))
        total = sum(w for _, w, _, _ in longer)
        tracks = [(r, w / total, x, P) for r, w, x, P in longer]
        w, x, P = (np.array([track[i] for track in tracks]) for i in (1, 2, 3))
        result.append(moment_match(w, x, P))
    return np.array([a for a, _ in result]), np.array([b for _, b in result])


def rbpf(model, z, particles, rng):
    """Rao-Blackwellised particle filter: particles one after the other."""
    links, modes, _ = model.means.shape
    x, P = np.tile(model.m0, (particles, 1)), np.tile(model.P0, (particles, 1, 1))
    sight = np.array([[rng.choice(modes, p=model.start[m]) for m in range(links)] for _ in range(particles)])
    log_w = np.zeros(particles)
    means = [model.m0]
    for k in range(len(z)):
        for i in range(particles):
            x_i, P_i = model.F[k] @ x[i], model.F[k] @ P[i] @ model.F[k].T + model.Q[k]
            h, H = ranges(x_i[: model.anchors.shape[1]], model.anchors, len(x_i))
            start = x_i
            for m in range(links):
                T = model.transitions[m, k, sight[i, m]]
                if np.isnan(z[k, m]):
                    sight[i, m] = rng.choice(modes, p=T)
                    continue
                predicted = h[[m]] + H[[m]] @ (x_i - start)
                parts = [
                    gain_form(x_i, P_i, z[k, [m]], predicted + model.means[m, j], H[[m]], model.variances[m, j][None])
                    for j in range(modes)
                ]
                q = T * [part[2] for part in parts]
                log_w[i] += np.log(q.sum())
                sight[i, m] = rng.choice(modes, p=q / q.sum())
                x_i, P_i, _ = parts[sight[i, m]]
            x[i], P[i] = x_i, P_i
        w = np.exp(log_w - log_w.max())
        w /= w.sum()
        means.append(w @ x)
        if 1 / np.sum(w**2) < particles / 2:
            index = np.searchsorted(np.cumsum(w), (np.arange(particles) + rng.random()) / particles)
            index = np.minimum(index, particles - 1)
            x, P, sight, log_w = x[index], P[index], sight[index], np.zeros(particles)
    return np.array(means)


def kim_smoother(F, Q, transitions, start, x0, P0, means, variances, z):
    """Kim's smoother on [range, range rate] of one link; smoothed mean and covariance at steps 1..K."""
    modes, H = len(start), np.array([[1.0, 0.0]])
    x, P, mu = np.tile(x0, (modes, 1)), np.tile(P0, (modes, 1, 1)), start
    filtered = []
    for k in range(len(z)):
        T = transitions[k]
        c = mu @ T
        mixed = [moment_match(T[:, j] * mu / c[j], x, P) for j in range(modes)]
        parts = []
        for j, (a, b) in enumerate(mixed):
            a, b = F[k] @ a, F[k] @ b @ F[k].T + Q[k]
            parts.append(
                (a, b, 1.0) if np.isnan(z[k]) else gain_form(a, b, z[[k]], a[:1] + means[j], H, variances[[j]][None])
            )
        x, P = np.array([p[0] for p in parts]), np.array([p[1] for p in parts])
        mu = c * [p[2] for p in parts]
        mu = mu / mu.sum()
        filtered.append((mu, x, P))
    smoothed = [filtered[-1]]
    for k in reversed(range(len(z) - 1)):
        (mu, x, P), (mu_s, x_s, P_s) = filtered[k], smoothed[0]
        joint = mu[:, None] * transitions[k + 1]
        joint = joint / joint.sum(0) * mu_s
        new_x, new_P = [], []
        for i in range(modes):
            S = F[k + 1] @ P[i] @ F[k + 1].T + Q[k + 1]
            G = P[i] @ F[k + 1].T @ np.linalg.inv(S)
            pairs = [(x[i] + G @ (x_s[j] - F[k + 1] @ x[i]), P[i] + G @ (P_s[j] - S) @ G.T) for j in range(modes)]
            a, b = moment_match(
                joint[i] / joint[i].sum(), np.array([p[0] for p in pairs]), np.array([p[1] for p in pairs])
            )
            new_x.append(a)
            new_P.append(b)
        smoothed.insert(0, (joint.sum(1), np.array(new_x), np.array(new_P)))
    return [moment_match(*part) for part in smoothed]

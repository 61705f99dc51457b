"""The filters as textbooks write them: one track, plain NumPy, gain form, loops. Independent of the library."""

import itertools

import numpy as np


def gain_form(x, P, z, h, H, R):
    """Kalman update by all measurements at once (Bar-Shalom, Li, Kirubarajan 2001, section 5.2)."""
    S = H @ P @ H.T + R
    W = P @ H.T @ np.linalg.inv(S)
    nu = z - h
    likelihood = np.exp(-0.5 * nu @ np.linalg.solve(S, nu)) / np.sqrt(np.linalg.det(2 * np.pi * S))
    return x + W @ nu, P - W @ S @ W.T, likelihood


def moment_match(w, x, P):
    """Mean and covariance of a Gaussian mixture."""
    mean = np.einsum("i,is->s", w, x)
    d = x - mean
    return mean, np.einsum("i,ist->st", w, P) + np.einsum("i,is,it->st", w, d, d)


def ranges(position, anchors, n):
    """Distances and their Jacobian with respect to a state of n components, positions first."""
    offset = position - anchors
    h = np.linalg.norm(offset, axis=1)
    H = np.zeros((len(anchors), n))
    H[:, : offset.shape[1]] = offset / h[:, None]
    return h, H


def ekf_update(x, P, z, anchors, noises):
    """EKF update by the ranges that exist; ``noises[link]`` is (weights, means, variances) of its components.

    One component each: the gain form. Otherwise link after link at one linearisation point, matching moments.
    """
    h, H = ranges(x[: anchors.shape[1]], anchors, len(x))
    seen = np.flatnonzero(~np.isnan(z))
    if not seen.size:
        return x, P, 1.0
    if all(len(weights) == 1 for weights, _, _ in noises):
        mu, R = (np.array([noises[m][k][0] for m in seen]) for k in (1, 2))
        return gain_form(x, P, z[seen], h[seen] + mu, H[seen], np.diag(R))
    x0, likelihood = x, 1.0
    for m in seen:
        parts = [
            gain_form(x, P, z[[m]], h[[m]] + H[[m]] @ (x - x0) + mu, H[[m]], np.array([[R]]))
            for mu, R in zip(*noises[m][1:], strict=True)
        ]
        w = noises[m][0] * np.array([part[2] for part in parts])
        x, P = moment_match(w / w.sum(), np.array([p[0] for p in parts]), np.array([p[1] for p in parts]))
        likelihood *= w.sum()
    return x, P, likelihood


def imm_ekf(model, z):
    """IMM of EKFs over the joint modes, one track z [steps, links] (Bar-Shalom et al. 2001, section 11.6.6)."""
    links, modes, _ = model.means.shape
    joint = list(itertools.product(range(modes), repeat=links))
    mu = np.array([np.prod([model.start[m, r[m]] for m in range(links)]) for r in joint])
    x, P = np.tile(model.m0, (len(joint), 1)), np.tile(model.P0, (len(joint), 1, 1))
    means, covariances = [model.m0], [model.P0]
    for k in range(len(z)):
        T = model.transitions[:, k]
        T = np.array([[np.prod([T[m, i[m], j[m]] for m in range(links)]) for j in joint] for i in joint])
        c = mu @ T
        mixed = [moment_match(T[:, j] * mu / c[j], x, P) for j in range(len(joint))]
        F, Q = model.F[k], model.Q[k]
        updated = [
            ekf_update(
                F @ xj,
                F @ Pj @ F.T + Q,
                z[k],
                model.anchors,
                [(model.weights[m, r[m]], model.means[m, r[m]], model.variances[m, r[m]]) for m in range(links)],
            )
            for r, (xj, Pj) in zip(joint, mixed, strict=True)
        ]
        x, P = np.array([u[0] for u in updated]), np.array([u[1] for u in updated])
        mu = c * np.array([u[2] for u in updated])
        mu /= mu.sum()
        mean, covariance = moment_match(mu, x, P)
        means.append(mean)
        covariances.append(covariance)
    return np.array(means), np.array(covariances)


def imm_ekf_factorised(model, z):
    """The factorised filter with its quadratic cost: every link's map applied to every other link at once."""
    links, modes, _ = model.means.shape
    dim, n = model.anchors.shape[1], len(model.m0)
    m, P, w = model.m0, model.P0, model.start.copy()
    s, D = np.zeros((links, modes, n)), np.zeros((links, modes, n, n))
    means, covariances = [m], [P]
    for k in range(len(z)):
        F, Q, T = model.F[k], model.Q[k], model.transitions[:, k]
        for link in range(links):
            c = w[link] @ T[link]
            mixed = [moment_match(T[link][:, j] * w[link] / c[j], s[link], D[link]) for j in range(modes)]
            s[link] = [F @ a for a, _ in mixed]
            D[link] = [F @ b @ F.T for _, b in mixed]
            w[link] = c
        m, P = F @ m, F @ P @ F.T + Q
        for link in np.flatnonzero(~np.isnan(z[k])):
            anchor = model.anchors[[link]]
            parts = [
                ekf_update(
                    m + s[link, j],
                    P + D[link, j],
                    z[k, [link]],
                    anchor,
                    [(model.weights[link, j], model.means[link, j], model.variances[link, j])],
                )
                for j in range(modes)
            ]
            w[link] *= [part[2] for part in parts]
            w[link] /= w[link].sum()
            x, Pj = np.array([part[0] for part in parts]), np.array([part[1] for part in parts])
            _, H = ranges(m[:dim], anchor, n)
            before = (H @ P @ H.T).item()
            m, P_new = moment_match(w[link], x, Pj)
            after = (H @ P_new @ H.T).item()
            A = np.eye(n) - P @ H.T @ H * max(before - after, 0.0) / before**2
            s, D, P = s @ A.T, A @ D @ A.T, P_new
            s[link], D[link] = x - m, Pj - P
        means.append(m)
        covariances.append(P)
    return np.array(means), np.array(covariances)

"""SoftPOSIT (David, DeMenthon, Duraiswami and Samet, IJCV 2004), written from the paper: softassign and POSIT in turn while the
annealing parameter rises, from 20 random rotations at the trial's or a plausible depth; the pose with the most matches wins. At
most 100 points a side, as the method needs all pairs.
"""

import numpy as np
from scipy.spatial.transform import Rotation

MOST = 100
STARTS = 20
FOCAL = 800.0
BETA = (2e-4, 0.5, 1.1)
ALPHA = 9.21 * 1.0 + 1.0


def sinkhorn(matrix):
    """Make all rows and columns but the last of each sum to 1."""
    for _ in range(30):
        matrix[:-1] /= matrix[:-1].sum(1, keepdims=True)
        matrix[:, :-1] /= matrix[:, :-1].sum(0, keepdims=True)
    return matrix


def anneal(world, image, rotation, translation):
    """Return rotation, translation and the sum of assignments."""
    homogeneous = np.c_[world, np.ones(len(world))]
    w = world @ rotation[2] / translation[2] + 1.0
    scale = FOCAL / translation[2]
    q = np.stack([np.r_[rotation[i], translation[i]] * scale for i in range(2)])
    beta, matches = BETA[0], 0.0
    while beta < BETA[1]:
        difference = (homogeneous @ q.T)[None] - w[None, :, None] * image[:, None]
        distance = (difference**2).sum(2)
        assign = np.full((len(image) + 1, len(world) + 1), 1.0 / (max(len(image), len(world)) + 1))
        assign[:-1, :-1] *= np.exp(-beta * (distance - ALPHA)).clip(1e-30, 1e30)
        m = sinkhorn(assign)[:-1, :-1]
        matches = m.sum()
        weights = m.sum(0)
        normal = (homogeneous * weights[:, None]).T @ homogeneous
        right = np.einsum("jk,k,ji,kc->ic", m, w, image, homogeneous)
        q = np.linalg.solve(normal + 1e-12 * np.trace(normal) * np.eye(4), right.T).T
        u, s, vt = np.linalg.svd(q[:, :3].T, full_matrices=False)
        rows = (u @ vt).T
        scale = s.mean()
        rotation = np.stack([rows[0], rows[1], np.cross(rows[0], rows[1])])
        translation = np.array([q[0, 3] / scale, q[1, 3] / scale, FOCAL / scale])
        w = world @ rotation[2] / translation[2] + 1.0
        beta *= BETA[2]
    return rotation, translation, matches


def solve(trial):
    generator = np.random.default_rng(trial.seed)
    thin = lambda p: p if len(p) <= MOST else p[generator.choice(len(p), MOST, replace=False)]
    world, image = thin(trial.source), FOCAL * thin(trial.target)
    centre = world.mean(0)
    world = world - centre
    depth = FOCAL * np.sqrt((world**2).sum(1).mean() * 2 / 3) / np.sqrt(((image - image.mean(0)) ** 2).sum(1).mean())
    best = None
    for k in range(STARTS):
        if k == 0 and trial.start is not None:
            rotation = Rotation.from_rotvec(trial.start[:3]).as_matrix()
            translation = trial.start[3:] + rotation @ centre
        else:
            rotation = Rotation.random(random_state=int(generator.integers(2**31))).as_matrix()
            translation = np.r_[image.mean(0) / FOCAL * depth, depth]
        try:
            found = anneal(world, image, rotation, translation)
        except np.linalg.LinAlgError:
            continue
        if np.all(np.isfinite(found[1])) and (best is None or found[2] > best[2]):
            best = found
    if best is None:
        return None, "no start converged"
    rotation, translation, matches = best
    vector = Rotation.from_matrix(rotation).as_rotvec()
    return np.r_[vector, translation - rotation @ centre], f"{matches:.1f} matches"

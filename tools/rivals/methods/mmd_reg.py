"""MMD-Reg's residual, written from its description (arXiv 2606.27818): means of random Fourier features of both sets, matched over
SE(3) by Levenberg-Marquardt, from the trial's start. Local. The implicit gradients of the paper are for learning and play no
part here; the number of features and the bandwidths (the target's size, then half and a quarter of it) are ours.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from .shared import start_of, theta_of

FEATURES = 256
BANDWIDTHS = (1.0, 0.5, 0.25)
ITERATIONS = 50


def residual_and_jacobian(pose, source, w, phases, goal):
    """Residual of the means, and its Jacobian for a turn about the middle of the moved source and a shift."""
    moved = source @ pose[:3, :3].T + pose[:3, 3]
    arm = moved - moved.mean(0)
    angle = moved @ w.T + phases
    scale = np.sqrt(2.0 / len(w))
    sine = np.sin(angle) / len(moved)
    # d cos(w . x) = -sin(w . x) w . (turn x arm + shift), and w . (turn x arm) = turn . (arm x w).
    shift = -sine.sum(0)[:, None] * w
    turn = -np.cross(sine.T @ arm, w)
    return scale * (np.cos(angle).mean(0) - goal), scale * np.hstack([turn, shift]), moved.mean(0)


def solve(trial):
    generator = np.random.default_rng(trial.seed)
    frequencies = generator.standard_normal((FEATURES, 3))
    phases = generator.uniform(0.0, 2.0 * np.pi, FEATURES)
    centre = trial.target.mean(0)
    source, target = trial.source - centre, trial.target - centre
    size = np.sqrt((target**2).sum(1).mean())
    # Both sets relative to the target's middle: x -> R x + (T + R c - c).
    pose = start_of(trial)
    pose[:3, 3] += pose[:3, :3] @ centre - centre
    for bandwidth in BANDWIDTHS:
        w = frequencies / (bandwidth * size)
        goal = np.cos(target @ w.T + phases).mean(0)
        damping = 1e-3
        r, j, middle = residual_and_jacobian(pose, source, w, phases, goal)
        for _ in range(ITERATIONS):
            normal = j.T @ j
            step = -np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12), j.T @ r)
            turn = np.eye(4)
            turn[:3, :3] = Rotation.from_rotvec(step[:3]).as_matrix()
            turn[:3, 3] = middle + step[3:] - turn[:3, :3] @ middle
            next_r, next_j, next_middle = residual_and_jacobian(turn @ pose, source, w, phases, goal)
            if next_r @ next_r < r @ r:
                gain = 1.0 - (next_r @ next_r) / (r @ r)
                pose, r, j, middle, damping = turn @ pose, next_r, next_j, next_middle, damping / 5.0
                if gain < 1e-10:
                    break
            else:
                damping *= 4.0
                if damping > 1e8:
                    break
    pose[:3, 3] += centre - pose[:3, :3] @ centre
    return theta_of(pose), None

"""pycpd: rigid coherent point drift (scale fixed to 1 after the fact), from the trial's start. Local; at most 300 points a side."""

import numpy as np
from pycpd import RigidRegistration

from .shared import start_of, theta_of

MOST = 300


def solve(trial):
    generator = np.random.default_rng(trial.seed)
    thin = lambda p: p if len(p) <= MOST else p[generator.choice(len(p), MOST, replace=False)]
    start = start_of(trial)
    moved = thin(trial.source) @ start[:3, :3].T + start[:3, 3]
    registration = RigidRegistration(X=thin(trial.target), Y=moved, scale=False, max_iterations=150, w=0.1)
    registration.register()
    # pycpd moves rows: y R + t.
    step = np.eye(4)
    step[:3, :3], step[:3, 3] = np.asarray(registration.R).T, np.asarray(registration.t).ravel()
    return theta_of(step @ start), f"sigma2 {registration.sigma2:.3g}"

"""small_gicp: generalised ICP from the trial's start (identity with equal centroids where there is none). Local."""

import numpy as np
import small_gicp

from .shared import spacing, start_of, theta_of


def solve(trial):
    reach = 5.0 * spacing(trial.target)
    result = small_gicp.align(
        np.ascontiguousarray(trial.target),
        np.ascontiguousarray(trial.source),
        init_T_target_source=start_of(trial),
        registration_type="GICP",
        downsampling_resolution=0.5 * spacing(trial.target),
        max_correspondence_distance=max(reach, 0.2),
        num_threads=1,
    )
    return theta_of(result.T_target_source), f"converged {result.converged}, error {result.error:.3g}"

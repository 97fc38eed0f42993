"""KISS-Matcher: Faster-PFH features, graph-based pruning, graduated non-convexity. Global."""

import kiss_matcher
import numpy as np

from .shared import spacing, theta_of


def solve(trial):
    config = kiss_matcher.KISSMatcherConfig(max(2.0 * spacing(trial.target), 1e-6))
    matcher = kiss_matcher.KISSMatcher(config)
    result = matcher.estimate(
        np.ascontiguousarray(trial.source, dtype=np.float32), np.ascontiguousarray(trial.target, dtype=np.float32)
    )
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = np.asarray(result.rotation), np.asarray(result.translation).ravel()
    inliers = matcher.get_num_final_inliers()
    return theta_of(matrix), f"{inliers} inliers"

"""OpenCV solvePnPRansac, then refinement, with *given matches*: every image point is matched with the source point whose image under
the truth is nearest. An upper bound for methods without matches, not a rival on equal terms.
"""

import cv2
import numpy as np
from scipy.spatial import cKDTree

from .shared import matrix_of


def solve(trial):
    truth = matrix_of(trial.truth)
    seen = trial.source @ truth[:3, :3].T + truth[:3, 3]
    nearest = cKDTree(seen[:, :2] / seen[:, 2:]).query(trial.target)[1]
    cv2.setRNGSeed(trial.seed)
    extent = np.ptp(trial.target, axis=0).max()
    found, rotation, translation, inliers = cv2.solvePnPRansac(
        trial.source[nearest].astype(np.float64),
        trial.target.astype(np.float64),
        np.eye(3),
        None,
        iterationsCount=1000,
        reprojectionError=0.02 * extent,
    )
    if not found:
        return None, "no pose"
    keep = inliers.ravel()
    rotation, translation = cv2.solvePnPRefineLM(
        trial.source[nearest][keep], trial.target[keep], np.eye(3), None, rotation, translation
    )
    return np.concatenate([rotation.ravel(), translation.ravel()]), f"{len(keep)} inliers of {len(trial.target)}"

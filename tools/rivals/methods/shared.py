"""Rotations and poses."""

import numpy as np
from scipy.spatial.transform import Rotation


def theta_of(matrix):
    """Return (rotation vector, translation) of a 4 x 4 matrix."""
    matrix = np.asarray(matrix)
    return np.concatenate([Rotation.from_matrix(matrix[:3, :3]).as_rotvec(), matrix[:3, 3]])


def matrix_of(theta):
    """Return the 4 x 4 matrix of (rotation vector, translation)."""
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_rotvec(theta[:3]).as_matrix()
    matrix[:3, 3] = theta[3:6]
    return matrix


def start_of(trial):
    """Return the start of a local method as a matrix: the trial's, else the identity with equal centroids."""
    if trial.start is not None:
        return matrix_of(trial.start)
    matrix = np.eye(4)
    matrix[:3, 3] = trial.target.mean(0) - trial.source.mean(0)
    return matrix


def spacing(points):
    """Return the median distance to the nearest neighbour."""
    from scipy.spatial import cKDTree

    return float(np.median(cKDTree(points).query(points, k=2)[0][:, 1]))

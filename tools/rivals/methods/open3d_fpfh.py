"""Open3D: FPFH features, RANSAC on matched features, point-to-plane ICP. Global; its fitness is no verdict."""

import numpy as np
import open3d as o3d

from .shared import spacing, theta_of


def solve(trial):
    o3d.utility.random.seed(trial.seed)
    voxel = max(2.0 * spacing(trial.target), 1e-6)
    clouds, features = [], []
    for points in (trial.source, trial.target):
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.ascontiguousarray(points)))
        cloud.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(radius=2 * voxel, max_nn=30))
        parameters = o3d.geometry.KDTreeSearchParamHybrid(radius=5 * voxel, max_nn=100)
        clouds.append(cloud)
        features.append(o3d.pipelines.registration.compute_fpfh_feature(cloud, parameters))
    registration = o3d.pipelines.registration
    coarse = registration.registration_ransac_based_on_feature_matching(
        clouds[0],
        clouds[1],
        features[0],
        features[1],
        True,
        1.5 * voxel,
        registration.TransformationEstimationPointToPoint(False),
        3,
        [
            registration.CorrespondenceCheckerBasedOnEdgeLength(0.9),
            registration.CorrespondenceCheckerBasedOnDistance(1.5 * voxel),
        ],
        registration.RANSACConvergenceCriteria(100_000, 0.999),
    )
    fine = registration.registration_icp(
        clouds[0], clouds[1], voxel, coarse.transformation, registration.TransformationEstimationPointToPlane()
    )
    return theta_of(fine.transformation), f"fitness {fine.fitness:.3f}"

//! What several models share. A model imports from here, never from another model.

pub mod affine;
pub mod pose2;
pub mod pose3;
pub mod projective;
pub mod scene;
pub mod warp;

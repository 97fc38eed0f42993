//! The table of transformation models. A new model is one file here and one line in [`ALL`].

mod affine2;
mod affine3;
mod bearing3;
mod camera3;
mod epipolar;
mod gain1;
mod homography;
mod plane_bearing;
mod plane_homography;
mod polynomial2;
mod rigid2;
mod rigid3;
mod shared;
mod similarity2;
mod similarity3;
mod thin_plate2;

use crate::model::ModelEntry;

/// All models of the library.
pub const ALL: &[&ModelEntry] = &[
    &gain1::ENTRY,
    &rigid2::ENTRY,
    &rigid3::ENTRY,
    &similarity2::ENTRY,
    &similarity3::ENTRY,
    &affine2::ENTRY,
    &affine3::ENTRY,
    &polynomial2::ENTRY,
    &thin_plate2::ENTRY,
    &bearing3::ENTRY,
    &camera3::ENTRY,
    &plane_bearing::ENTRY,
    &plane_homography::ENTRY,
    &homography::ENTRY,
    &epipolar::ENTRY,
];

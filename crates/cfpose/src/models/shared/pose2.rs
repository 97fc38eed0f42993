//! What the models of a plane pose share.

/// Return the angle of a plane rotation (or of a positive multiple of one), row by row.
pub fn angle_of(a: &[f64]) -> f64 {
    (a[2] - a[1]).atan2(a[0] + a[3])
}

//! What several families share. A family imports from here, never from another family.

pub mod polynomials;
pub mod trig;
pub mod waves;

//! Numbers of the 27 problems: starts, certified values and observations, as published by NIST, by its levels of difficulty.
//!
//! Rows of `DATA` arrays are y, x (Nelson: y, x1, x2). Roszman1's first certified parameter is the one that belongs to
//! the plain arctangent, 0.20196866396.

mod average;
mod higher;
mod lower;

pub(super) use average::{ENSO, GAUSS3, HAHN1, KIRBY2, LANCZOS1, LANCZOS2, MGH17, MISRA1C, MISRA1D, NELSON, ROSZMAN1};
pub(super) use higher::{BENNETT5, BOXBOD, ECKERLE4, MGH09, MGH10, RAT42, RAT43, THURBER};
pub(super) use lower::{CHWIRUT1, CHWIRUT2, DANWOOD, GAUSS1, GAUSS2, LANCZOS3, MISRA1A, MISRA1B};

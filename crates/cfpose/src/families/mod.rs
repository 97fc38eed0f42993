//! The table of feature families. A new family is one file here and one line in [`ALL`].

mod angular;
mod chebyshev;
mod coordinates;
mod fourier;
mod hermite;
pub mod learned;
mod legendre;
mod monomial;
pub mod orthonormalised;
pub mod quadrature_blur;
mod random_fourier;
mod rbf;
mod shared;
mod trig18;

pub use cfpose_kernel::family::polynomial;

use crate::entry::FamilyEntry;

/// All families of the library.
pub const ALL: &[&FamilyEntry] = &[
    &coordinates::ENTRY,
    &monomial::ENTRY,
    &trig18::ENTRY,
    &orthonormalised::ENTRY,
    &hermite::ENTRY,
    &legendre::ENTRY,
    &chebyshev::ENTRY,
    &fourier::ENTRY,
    &random_fourier::ENTRY,
    &rbf::ENTRY,
    &angular::ENTRY,
    &quadrature_blur::ENTRY,
    &learned::ENTRY,
];

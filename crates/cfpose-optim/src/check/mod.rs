//! Public checks: derivatives of a problem against finite differences, and the conformance suite that every solver of the
//! table inherits.

mod conformance;
mod derivatives;
mod witness;

pub use conformance::{Finding, conformance};
pub use derivatives::{DerivativeReport, EntryCheck, check_derivatives};
pub use witness::Witness;

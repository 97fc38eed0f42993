//! What several scenarios share. A scenario imports from here, never from another scenario.

pub mod curves;
pub mod sampling;

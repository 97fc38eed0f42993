//! The model's neutral theta.

use super::{StartContext, StartEntry, StartStrategy};
use crate::error::Error;

struct Identity;

impl StartStrategy for Identity {
    fn name(&self) -> &'static str {
        "identity"
    }
    fn starts(&self, context: &StartContext<'_>) -> Result<Vec<Vec<f64>>, Error> {
        Ok(vec![context.model.identity.clone()])
    }
}

pub(super) const ENTRY: StartEntry = StartEntry {
    name: "identity",
    summary: "no motion: identity rotation, zero translation, gain 1",
    parameters: &[],
    source: "-",
    build: |_| Ok(Box::new(Identity)),
};

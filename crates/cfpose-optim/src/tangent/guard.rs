//! Panics inside a foreign back-end become failures of a round.

use std::panic::{AssertUnwindSafe, catch_unwind};

/// Call into a foreign crate; `None` when it panics.
///
/// argmin's trust-region step and line searches index and unwrap on values that are not numbers. The evaluations they make
/// go through the session, whose state stays whole at any point where they can panic.
pub fn guarded<T>(call: impl FnOnce() -> T) -> Option<T> {
    catch_unwind(AssertUnwindSafe(call)).ok()
}

//! When to end early: a flag that another thread raises, and a time.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::outcome::Status;

/// A cancel flag and a deadline that hold for several solves and what is done between them.
///
/// ```
/// use std::sync::atomic::AtomicBool;
/// use std::time::Duration;
/// use cfpose_optim::{Interrupt, Status};
/// let flag = AtomicBool::new(false);
/// assert_eq!(Interrupt::new(Some(&flag), Some(Duration::from_secs(3600))).status(), None);
/// assert_eq!(Interrupt::new(Some(&flag), Some(Duration::ZERO)).status(), Some(Status::Deadline));
/// flag.store(true, std::sync::atomic::Ordering::Relaxed);
/// assert_eq!(Interrupt::new(Some(&flag), None).status(), Some(Status::Cancelled));
/// ```
#[derive(Debug, Clone, Copy, Default)]
pub struct Interrupt<'a> {
    cancel: Option<&'a AtomicBool>,
    /// Beginning and limit.
    deadline: Option<(Instant, Duration)>,
}

impl<'a> Interrupt<'a> {
    /// Begin now; `deadline` is counted from here.
    #[must_use]
    pub fn new(cancel: Option<&'a AtomicBool>, deadline: Option<Duration>) -> Self {
        Self { cancel, deadline: deadline.map(|limit| (Instant::now(), limit)) }
    }

    /// Return why to end now: [`Status::Cancelled`] or [`Status::Deadline`]; `None` while there is no reason.
    #[must_use]
    pub fn status(&self) -> Option<Status> {
        if self.cancel.is_some_and(|flag| flag.load(Ordering::Relaxed)) {
            return Some(Status::Cancelled);
        }
        self.left().is_some_and(|left| left.is_zero()).then_some(Status::Deadline)
    }

    /// Say whether there is a reason to end now.
    #[must_use]
    pub fn is_raised(&self) -> bool {
        self.status().is_some()
    }

    /// Return the time that is left, `None` without a deadline.
    #[must_use]
    pub fn left(&self) -> Option<Duration> {
        self.deadline.map(|(began, limit)| limit.saturating_sub(began.elapsed()))
    }

    /// Return the cancel flag.
    #[must_use]
    pub fn cancel(&self) -> Option<&'a AtomicBool> {
        self.cancel
    }

    /// Say in words why a computation ended.
    #[must_use]
    pub fn words(&self) -> &'static str {
        match self.status() {
            Some(Status::Cancelled) => "cancelled: the best so far",
            Some(_) => "the deadline passed: the best so far",
            None => "no interruption",
        }
    }
}

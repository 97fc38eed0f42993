//! Ctrl-C and SIGTERM: the first one asks a command to stop in order, a second one ends the program at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

/// Signals that are caught, with their names.
const CAUGHT: [(i32, &str); 2] = [(SIGINT, "SIGINT"), (SIGTERM, "SIGTERM")];

/// Whether a signal has come.
pub struct Signals {
    raised: Arc<AtomicBool>,
    number: Arc<AtomicUsize>,
}

impl Signals {
    /// Begin to catch signals; where the system does not allow that they end the program as before.
    pub fn watch() -> Self {
        let signals = Self { raised: Arc::default(), number: Arc::default() };
        for (signal, _) in CAUGHT {
            // In this order: the second signal finds the flag up and ends the program with 128 + its number.
            let number = usize::try_from(signal).unwrap_or(0);
            let _ = flag::register_conditional_shutdown(signal, 128 + signal, Arc::clone(&signals.raised))
                .and_then(|_| flag::register_usize(signal, Arc::clone(&signals.number), number))
                .and_then(|_| flag::register(signal, Arc::clone(&signals.raised)));
        }
        signals
    }

    /// Return the flag that goes up with the first signal.
    pub fn flag(&self) -> &AtomicBool {
        &self.raised
    }

    /// Return exit code and name of the signal that has come.
    pub fn caught(&self) -> Option<(u8, &'static str)> {
        if !self.raised.load(Ordering::Relaxed) {
            return None;
        }
        let number = self.number.load(Ordering::Relaxed);
        let (signal, name) = CAUGHT.into_iter().find(|(signal, _)| usize::try_from(*signal) == Ok(number))?;
        Some((u8::try_from(128 + signal).ok()?, name))
    }
}

//! What a run shows while it lasts: nothing when short or piped, a line on a terminal, every iteration with `-v`.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use cfpose_optim::{Observer, TraceRow};
use indicatif::{ProgressBar, ProgressStyle};

use crate::output;

/// A run shorter than this shows nothing.
const PATIENCE: Duration = Duration::from_secs(1);

/// Watches a solve.
pub struct Watch {
    verbose: bool,
    begun: Instant,
    start: usize,
    num_starts: usize,
    bar: Option<ProgressBar>,
}

impl Watch {
    /// Begin to watch solves from `num_starts` starts.
    pub fn new(verbose: bool, num_starts: usize) -> Self {
        Self { verbose, begun: Instant::now(), start: 0, num_starts, bar: None }
    }

    /// Show a line on a terminal once the run has lasted long enough.
    fn show(&mut self, row: &TraceRow) {
        if self.begun.elapsed() < PATIENCE || !std::io::stderr().is_terminal() {
            return;
        }
        let (start, num_starts) = (self.start, self.num_starts);
        let bar = self.bar.get_or_insert_with(|| {
            let bar = ProgressBar::new(num_starts as u64);
            if let Ok(style) = ProgressStyle::with_template("{bar:30} start {pos}/{len} {msg} [{elapsed}, left {eta}]")
            {
                bar.set_style(style);
            }
            bar
        });
        bar.set_position(start as u64);
        bar.set_message(format!("iteration {}, cost {:.3e}", row.iteration, row.cost));
    }
}

impl Observer for Watch {
    fn iteration(&mut self, row: &TraceRow, _theta: &[f64]) {
        if row.iteration == 0 {
            self.start += 1;
        }
        if self.verbose {
            let step = if row.accepted { "accepted" } else { "rejected" };
            output::note(&format!(
                "start {} iteration {:3}  cost {:.6e}  gradient {:.2e}  step {:.2e}  damping {:.2e}  {step}",
                self.start, row.iteration, row.cost, row.gradient_norm, row.step_norm, row.damping
            ));
        } else {
            self.show(row);
        }
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

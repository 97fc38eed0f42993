//! What a run shows while it lasts: nothing when short or piped, a line on a terminal, every iteration with `-v`.

use std::io::IsTerminal;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use cfpose_optim::{Observer, TraceRow};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::output;

/// A run shorter than this shows nothing.
const PATIENCE: Duration = Duration::from_secs(1);
/// How often the line moves, also where no iteration is reported: in the likelihood of the points.
const TICK: Duration = Duration::from_millis(200);

/// Watches a solve.
pub struct Watch {
    verbose: bool,
    start: usize,
    bar: Option<Line>,
}

/// A line on a terminal that appears once the run has lasted long enough.
struct Line {
    bar: ProgressBar,
    /// Dropped at the end, which the thread waits for.
    running: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Line {
    fn begin() -> Self {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden());
        if let Ok(style) = ProgressStyle::with_template("{spinner} {msg} [{elapsed}]") {
            bar.set_style(style);
        }
        let (running, ended) = channel::<()>();
        let shown = bar.clone();
        let thread = std::thread::spawn(move || {
            if ended.recv_timeout(PATIENCE) == Err(RecvTimeoutError::Timeout) {
                shown.set_draw_target(ProgressDrawTarget::stderr());
                shown.enable_steady_tick(TICK);
            }
        });
        Self { bar, running: Some(running), thread: Some(thread) }
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        self.running.take();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        self.bar.finish_and_clear();
    }
}

impl Watch {
    /// Begin to watch solves.
    pub fn new(verbose: bool) -> Self {
        let shows = !verbose && std::io::stderr().is_terminal();
        Self { verbose, start: 0, bar: shows.then(Line::begin) }
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
                "solve {} iteration {:3}  cost {:.6e}  gradient {:.2e}  step {:.2e}  damping {:.2e}  {step}",
                self.start, row.iteration, row.cost, row.gradient_norm, row.step_norm, row.damping
            ));
        } else if let Some(line) = &self.bar {
            line.bar.set_message(format!("solve {}, iteration {}, cost {:.3e}", self.start, row.iteration, row.cost));
        }
    }
}

//! What the laboratory itself costs: `cargo run --release --workspace --example harness -- [TRIALS]`.
//!
//! First the cost of a trial on one thread besides its solves (trivial solves: 20 points, one evaluation), then the time and the size of
//! the tables and the report of `TRIALS` trials, 100 000 when not given.
//! Times on a processor (Linux) do not count what others do on the machine; times by the clock do.

use std::time::Instant;

use cfpose_lab::{Experiment, Lab, RunOptions, folder, merge, run};

#[path = "../tests/common/synthetic.rs"]
mod synthetic;

/// Seconds of all threads on a processor (in ticks of 1/100 s); of the clock where the system does not tell.
fn processor(since: Instant) -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // Behind the name of the program in brackets: user and system time are fields 12 and 13.
    let fields: Vec<&str> = text.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    let ticks = |place: usize| fields.get(place).and_then(|word| word.parse::<f64>().ok());
    ticks(11).zip(ticks(12)).map_or_else(|| since.elapsed().as_secs_f64(), |(user, system)| 0.01 * (user + system))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let trials = std::env::args().nth(1).map_or(Ok(100_000), |text| text.parse())?;
    let lab = Lab::default();
    let place = std::env::temp_dir().join(format!("cfpose-harness-{}", std::process::id()));
    const TRIVIAL: usize = 4000;
    let text = format!(
        "trials = {TRIVIAL}\n[[scenario]]\nname = \"cloud3\"\npoints = 20\nstart = 10\n\
         [[method]]\nname = \"trivial\"\npreset = \"paper\"\nfeatures = \"hermite[degree=2]\"\nmax_evaluations = 1\n"
    );
    let experiment = Experiment::parse(&lab, &text, "trivial.toml")?;
    let (clock, begin) = (Instant::now(), processor(Instant::now()));
    run(&lab, &experiment, &RunOptions::new(place.join("run")))?;
    let (all, on_processor) = (clock.elapsed().as_secs_f64(), processor(clock) - begin);
    let solves: f64 =
        folder::read_records(&place.join("run").join("trials.jsonl"))?.iter().map(|(_, record)| record.seconds).sum();
    let ms = |seconds: f64| 1e3 * seconds / TRIVIAL as f64;
    println!(
        "a trivial trial: {:.3} ms of the processor with its solve; by the clock {:.3} ms, {:.3} ms besides preparing and solving",
        ms(on_processor),
        ms(all),
        ms(all - solves)
    );

    let folder = place.join("many");
    synthetic::write(&lab, &folder, trials);
    let (clock, begin) = (Instant::now(), processor(Instant::now()));
    let merged = merge(&lab, &folder)?;
    println!(
        "{} records merge in {:.2} s of the processor, {:.2} s by the clock",
        merged.records,
        processor(clock) - begin,
        clock.elapsed().as_secs_f64()
    );
    for name in ["results.csv", "statistics.json", "report.html"] {
        println!("{name}: {:.2} MB", std::fs::metadata(folder.join(name))?.len() as f64 / 1e6);
    }
    std::fs::remove_dir_all(place)?;
    Ok(())
}

//! What the laboratory itself costs: `cargo run --release --workspace --example harness -- [TRIALS]`.
//!
//! First the cost of a trial on one thread besides its solves (trivial solves: 20 points, one evaluation), then the time and the size of
//! the tables and the report of `TRIALS` trials, 100 000 when not given.

use std::time::Instant;

use cfpose_lab::{Experiment, Lab, RunOptions, folder, merge, run};

#[path = "../tests/common/synthetic.rs"]
mod synthetic;

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
    let begin = Instant::now();
    run(&lab, &experiment, &RunOptions::new(place.join("run")))?;
    let all = begin.elapsed().as_secs_f64();
    let solves: f64 =
        folder::read_records(&place.join("run").join("trials.jsonl"))?.iter().map(|(_, record)| record.seconds).sum();
    let ms = |seconds: f64| 1e3 * seconds / TRIVIAL as f64;
    println!("a trivial trial: {:.3} ms in all, {:.3} ms besides preparing and solving", ms(all), ms(all - solves));

    let folder = place.join("many");
    synthetic::write(&lab, &folder, trials);
    let begin = Instant::now();
    let merged = merge(&lab, &folder)?;
    println!("{} records merge in {:.2} s", merged.records, begin.elapsed().as_secs_f64());
    for name in ["results.csv", "statistics.json", "report.html"] {
        println!("{name}: {:.2} MB", std::fs::metadata(folder.join(name))?.len() as f64 / 1e6);
    }
    std::fs::remove_dir_all(place)?;
    Ok(())
}

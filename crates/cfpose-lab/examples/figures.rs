//! Draw the figures of the documents: `cargo run --release -p cfpose-lab --example figures -- FOLDER` (default
//! `docs/figures`). The same bytes every time.

use std::path::PathBuf;

use cfpose::entry::find;
use cfpose::{Estimator, Execution, Registry, Supervision};
use cfpose_lab::method::Method;
use cfpose_lab::plot::{overlay, panels};
use cfpose_lab::{scenarios, seed};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/figures");
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| default.to_string()));
    std::fs::create_dir_all(&folder)?;
    let figures = [
        ("planar-curve", "planar-curve[curve=heart,b_i=0.2,b_p=0.01]", "paper", "scenario"),
        ("cloud3", "cloud3[points=400,noise=0.005]", "paper", "pca"),
    ];
    let registry = Registry::default();
    for (name, spec, preset, start) in figures {
        let (entry, parameters) = find("scenario", scenarios::ALL, spec)?;
        let scenario = (entry.build)(&parameters)?;
        let trial = scenario.trial(&mut seed::data_stream(1, seed::fnv1a(spec.as_bytes())))?;
        let method = Method { start: start.to_string(), ..Method::of_preset(preset) };
        let settings = method.settings(scenario.model(), trial.start.as_deref(), 1)?;
        let estimator = Estimator::new(&registry, &settings, &trial.source, &trial.target, &Execution::default())?;
        let estimate = estimator.solve(Supervision::default())?;
        let error = scenario.error(&estimator.model().layout, &estimate.theta, &trial.truth);
        let title = error.map_or_else(String::new, |e| {
            format!("{name}: angle {:.2} deg, translation {:.4} after", e.angle.to_degrees(), e.translation)
        });
        let before = trial.start.as_ref().unwrap_or(&estimator.model().identity);
        let panels = panels(&estimator, &[("before", before), ("after", &estimate.theta)])?;
        let path = folder.join(format!("{name}.svg"));
        std::fs::write(&path, overlay(&title, &panels)?)?;
        println!("{}: {title}", path.display());
    }
    Ok(())
}

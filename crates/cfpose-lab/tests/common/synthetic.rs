//! A folder of results that nothing was solved for: as many trials as asked for, with everything that a report can show.

use std::fs;
use std::io::Write;
use std::path::Path;

use cfpose::Isa;
use cfpose_lab::rand::RngExt;
use cfpose_lab::record::{BUDGETS, VERSION};
use cfpose_lab::{Experiment, Lab, Plan, Record, seed};

/// Write the records of `trials` trials in 20 cells, two scenarios and four methods: about `trials` / 4 draws of the data.
pub fn write(lab: &Lab, folder: &Path, trials: usize) -> Plan {
    let text = format!(
        "trials = {}\npublished = [{{ table = \"Table\", method = \"plain\", points = 100, noise = 0, success = 60 }}]\n\
         [[scenario]]\nname = \"cloud3\"\nstart = 30\npoints = [100, 300, 1000, 3000, 10000]\nnoise = [0, 0.01]\n\
         [[scenario]]\nname = \"planar-curve\"\nb_i = [0.1, 0.15, 0.2, 0.25, 0.3]\nb_p = [0, 0.01]\n\
         [[method]]\nname = \"plain\"\n[[method]]\nname = \"better\"\n[[method]]\nname = \"plain again\"\n[[method]]\nname = \"slow <&>\"\n",
        trials / 80
    );
    let experiment = Experiment::parse(lab, &text, "synthetic.toml").unwrap();
    fs::create_dir_all(folder).unwrap();
    fs::write(folder.join("experiment.toml"), experiment.to_toml()).unwrap();
    let plan = Plan::new(lab, &experiment).unwrap();
    let mut file = std::io::BufWriter::new(fs::File::create(folder.join("trials.jsonl")).unwrap());
    let fingerprint = experiment.fingerprint();
    for trial in &plan.trials {
        let mut rng = seed::data_stream(1, trial.key);
        let hardness: f64 = rng.random();
        let offset: Vec<f64> = (0..6).map(|_| 0.6 * (rng.random::<f64>() - 0.5)).collect();
        for (method, name) in plan.methods.iter().enumerate() {
            let cell = &plan.cells[trial.cell];
            let mut record = blank(&fingerprint, cell, name, trial);
            let far = offset.iter().map(|v| v * v).sum::<f64>().sqrt();
            record.success = hardness + far < [1.1, 1.3, 1.1, 1.2][method];
            record.error = Some((0.01 + far * if record.success { 0.02 } else { 1.0 }) * (0.5 + rng.random::<f64>()));
            record.rotation_deg = record.error.map(f64::to_degrees);
            record.translation = record.error.map(|e| 0.5 * e);
            (record.success_sum, record.e_sum) = (record.success, record.error);
            record.theta = Some(offset.clone());
            record.evaluations = [12, 9, 12, 60][method] + rng.random_range(0..20_usize);
            record.num_source = cell.parameter("points").and_then(|text| text.parse().ok()).unwrap_or(3142);
            record.num_target = record.num_source;
            record.seconds =
                1e-6 * record.num_source as f64 * (1.0 + method as f64) * (0.9 + 0.2 * rng.random::<f64>());
            let directions = ["rx", "ry", "rz", "tx", "ty", "tz"].map(String::from);
            record.start_offset = directions.into_iter().zip(offset.clone()).collect();
            let budgets = BUDGETS.iter().take_while(|budget| **budget < record.evaluations);
            let rate = 2.0 + method as f64 + 0.05 * trial.cell as f64 + hardness;
            let cost = |budget: &usize| (1e6 * (*budget as f64).powf(-rate)).round() / 1e6;
            record.trace = budgets.map(cost).collect();
            record.seal();
            serde_json::to_writer(&mut file, &record).unwrap();
            file.write_all(b"\n").unwrap();
        }
    }
    file.flush().unwrap();
    plan
}

fn blank(fingerprint: &str, cell: &cfpose_lab::Cell, method: &str, trial: &cfpose_lab::plan::PlannedTrial) -> Record {
    let parameters: serde_json::Map<String, serde_json::Value> = cell
        .parameters
        .iter()
        .map(|(key, text)| (key.clone(), text.parse::<f64>().map_or_else(|_| text.as_str().into(), Into::into)))
        .collect();
    let value = serde_json::json!({
        "experiment": fingerprint, "scenario": cell.scenario, "parameters": parameters, "method": method,
        "repetition": trial.repetition, "key": format!("{:016x}", trial.key), "success": false, "success_sum": false,
        "status": "gradient-tolerance", "usable": true, "verdict": "good", "evaluations": 0, "iterations": 5, "starts": 1,
        "cost": 1.25e-7, "isa": Isa::detect().name(), "seconds": 0.0, "version": VERSION, "unknowns": 6,
    });
    serde_json::from_value(value).unwrap()
}

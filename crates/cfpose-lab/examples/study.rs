//! Compare the methods of a finished run pairwise: `cargo run --workspace --example study -- FOLDER PARAMETERS BASE [SPREAD]`, such as
//! `study out/learned b_i,b_p,b_m trig18 b_i`: tables of docs/learned.md.

use std::path::Path;

use cfpose_lab::folder::read_records;
use cfpose_lab::{LabError, Record, paired};

fn main() -> Result<(), LabError> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let text = |i: usize, default: &'static str| arguments.get(i).map_or(default, String::as_str);
    let records = read_records(&Path::new(text(0, "out/learned")).join("trials.jsonl"))?;
    let records: Vec<Record> = records.into_iter().map(|(_, record)| record).collect();
    let by: Vec<&str> = text(1, "b_i,b_p,b_m").split(',').collect();
    print!("{}", paired::study(&records, &by, text(2, "trig18"), text(3, "b_i")));
    Ok(())
}

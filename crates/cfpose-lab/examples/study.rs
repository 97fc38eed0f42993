//! Compare the methods of a finished run pairwise: `cargo run --workspace --example study -- FOLDER PARAMETERS BASE [SPREAD [PAGE.md]]`,
//! such as `study out/learned b_i,b_p,b_m trig18 b_i docs/learned.md`: tables of docs/learned.md, in the place of those of the folder's name.

use std::path::Path;

use cfpose_lab::folder::read_records;
use cfpose_lab::{LabError, Record, paired};

fn main() -> Result<(), LabError> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let text = |i: usize, default: &'static str| arguments.get(i).map_or(default, String::as_str);
    let records = read_records(&Path::new(text(0, "out/learned")).join("trials.jsonl"))?;
    let records: Vec<Record> = records.into_iter().map(|(_, record)| record).collect();
    let by: Vec<&str> = text(1, "b_i,b_p,b_m").split(',').collect();
    let tables = paired::study(&records, &by, text(2, "trig18"), text(3, "b_i"));
    print!("{tables}");
    let Some(page) = arguments.get(4).map(Path::new) else { return Ok(()) };
    let name = Path::new(text(0, "out/learned")).file_name().unwrap_or_default().to_string_lossy().into_owned();
    let failed = |action| move |source| LabError::Io { path: page.to_path_buf(), action, source };
    let current = std::fs::read_to_string(page).map_err(failed("read"))?;
    std::fs::write(page, paired::into_page(&current, &name, &tables)).map_err(failed("write"))
}

//! The pages and lists that are made from the tables are committed as the tables are.

use std::path::Path;
use std::process::Command;

#[test]
fn generated_pages_and_lists_are_those_of_the_tables() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let run = Command::new(env!("CARGO_BIN_EXE_cfpose")).args(["docs", "--check"]).current_dir(root).output();
    let run = run.expect("the program starts");
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
}

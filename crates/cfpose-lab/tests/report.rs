//! The report in a real browser: it renders, every selector changes its plots, every plot is there, nothing is written to the console.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use cfpose_lab::{Lab, merge, plots};
use serde_json::Value;

#[path = "common/synthetic.rs"]
mod synthetic;

/// Programs that are looked for; the variable `CFPOSE_BROWSER` names another one, or says `required`.
const BROWSERS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

/// What the test does in the page, in its own language.
const PROBE: &str = include_str!("browser/probe.js");

fn browser() -> Option<PathBuf> {
    let named = std::env::var("CFPOSE_BROWSER").unwrap_or_default();
    let required = named == "required";
    let names: Vec<&str> = if named.is_empty() || required { BROWSERS.to_vec() } else { vec![&named] };
    let path = std::env::var_os("PATH").unwrap_or_default();
    let mut places = std::env::split_paths(&path).flat_map(|folder| names.iter().map(move |name| folder.join(name)));
    let found = places.find(|place| place.is_file());
    assert!(found.is_some() || !required, "CFPOSE_BROWSER=required, and there is none of {BROWSERS:?}");
    found
}

/// Open a page; returns its elements after its scripts have run, and what the browser wrote.
fn open(browser: &Path, page: &Path, profile: &Path, more: &[&str]) -> (String, String) {
    let output = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"])
        .args(["--disable-background-networking", "--disable-component-update", "--disable-sync"])
        .args(["--disable-dev-shm-usage", "--enable-logging=stderr", "--window-size=1400,2600", "--timeout=60000"])
        .arg(format!("--user-data-dir={}", profile.display()))
        .args(more)
        .arg(format!("file://{}", page.display()))
        .stdin(Stdio::null())
        .output()
        .unwrap();
    (String::from_utf8_lossy(&output.stdout).into_owned(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn the_report_of_100_000_trials_works_in_a_browser() {
    let (lab, folder) = (Lab::default(), tempfile::tempdir().unwrap());
    let results = folder.path().join("results");
    let plan = synthetic::write(&lab, &results, 100_000);
    let merged = merge(&lab, &results).unwrap();
    assert_eq!((merged.records, plan.num_records()), (100_000, 100_000));
    let page = fs::read_to_string(results.join("report.html")).unwrap();
    let megabytes = page.len() as f64 / 1e6;
    assert!(megabytes < 10.0, "{megabytes} MB");
    // Nothing comes from elsewhere.
    assert!(!page.contains("http") && !page.contains("src=\"") && !page.contains("@import"));
    let Some(browser) = browser() else {
        // Past the test's own output, so that it is seen in every run.
        let _ =
            writeln!(std::io::stderr(), "SKIPPED: no browser ({BROWSERS:?}) is installed, the report was not opened");
        return;
    };
    let profile = folder.path().join("profile");
    let probed = results.join("probed.html");
    fs::write(&probed, page.replace("</body>", &format!("<script>\n{PROBE}\n</script></body>"))).unwrap();
    let (text, log) = open(&browser, &probed, &profile, &["--dump-dom"]);
    let found = text.split("<pre id=\"probe\">").nth(1).and_then(|rest| rest.split("</pre>").next());
    let found: Value = serde_json::from_str(found.unwrap_or_else(|| panic!("the page did not run:\n{log}"))).unwrap();
    assert!(!log.contains("CONSOLE"), "{log}");
    assert_eq!(found["errors"], serde_json::json!([]));
    let milliseconds = found["opened"].as_f64().unwrap();
    println!("{megabytes:.2} MB, open after {milliseconds:.0} ms");
    assert!(milliseconds < 3000.0, "{milliseconds} ms");
    // Every plot of the table is somewhere in the page, drawn with more than its axes.
    for entry in plots::ALL {
        let count = found["plots"][entry.name].as_u64().unwrap_or(0);
        assert!(count > 0, "{}: {found}", entry.name);
    }
    // The intervals are drawn: bands of curves, bars of dots.
    assert!(
        found["bands"].as_u64() > Some(0) && found["bars"].as_u64() > Some(0) && found["fields"].as_u64() > Some(50)
    );
    for name in ["scenario", "cell", "method", "theme", "hint", "csv", "trials"] {
        assert_eq!(found["changes"][name], true, "{name}: {found}");
    }
}

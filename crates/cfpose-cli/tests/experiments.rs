//! `run`, `status`, `merge`, `report` and `demo` from the command line.

mod common;

use common::Desk;
use serde_json::json;

const EXPERIMENT: &str = "seed = 3\ntrials = 2\n[[scenario]]\nname = \"planar-curve\"\ncurve = [\"heart\", \"fish\"]\nb_p = 0.01\n\
                          [[method]]\nname = \"paper\"\npreset = \"paper\"\n\
                          [[method]]\nname = \"hermite\"\nfeatures = \"hermite[degree=3]\"\n";

fn desk() -> Desk {
    let desk = Desk::new();
    desk.write("e.toml", EXPERIMENT);
    desk
}

#[test]
fn shards_merge_into_what_one_run_writes() {
    let desk = desk();
    let whole = desk.json("run e.toml --out whole --threads 2");
    assert_eq!((&whole["computed"], &whole["complete"]), (&json!(8), &json!(true)));
    assert_eq!(whole["summary"].as_array().unwrap().len(), 4);

    let first = desk.json("run e.toml --out parts --shard 0/2");
    assert_eq!((&first["computed"], &first["complete"], &first["summary"]), (&json!(4), &json!(false), &json!(null)));
    assert_eq!(desk.json("status parts")["records"], 4);
    let last = desk.json("run e.toml --out parts --shard 1/2 --threads 1");
    assert_eq!(last["complete"], true);
    assert_eq!(desk.read("parts/results.csv"), desk.read("whole/results.csv"));

    // Merging again changes nothing, and a folder that is full is not overwritten.
    let before = desk.read("parts/results.csv");
    let rows = desk.json("merge parts");
    assert_eq!(rows, desk.json("report parts"));
    assert_eq!(desk.read("parts/results.csv"), before);
    let names: Vec<&str> = rows[0].as_object().unwrap().keys().map(String::as_str).take(12).collect();
    let expected = "scenario parameters method trials successes success_rate wilson95 median_rotation_deg median_translation \
                    median_error wrong_but_good median_seconds";
    assert_eq!(names, expected.split_whitespace().collect::<Vec<_>>());
    assert!(desk.fails(2, "run e.toml --out parts --shard 0/2").contains("already holds 4 record(s)"));
    assert_eq!(desk.json("run e.toml --out parts --shard 0/2 --resume")["computed"], 0);
    assert!(desk.read("parts/report.html").contains("planar-curve"));
}

#[test]
fn a_report_writes_for_papers_and_pages() {
    let desk = desk();
    desk.write("page.md", "# Results\n\nBefore.\n");
    desk.json("run e.toml --out e");
    let rows = desk.json("report e --svg figures --latex tables --docs page.md");
    assert_eq!(rows, desk.json("merge e"));
    let names = |folder: &str| -> Vec<String> {
        let files = std::fs::read_dir(desk.path(folder)).unwrap();
        files.map(|file| file.unwrap().file_name().into_string().unwrap()).collect()
    };
    // All cells together, then each.
    for name in ["000-planar-curve-all", "001-planar-curve-curve-heart", "002-planar-curve-curve-fish"] {
        for plot in
            ["success", "performance-profile", "data-profile", "mcnemar", "wilcoxon", "convergence", "median-error"]
        {
            let file = format!("{name}--{plot}.svg");
            assert!(names("figures").contains(&file), "{file}");
            assert!(desk.read(&format!("figures/{file}")).starts_with("<svg"));
        }
        let table = desk.read(&format!("tables/{name}--mcnemar.tex"));
        assert!(table.contains("\\begin{tabular}") && table.contains("paper & hermite & "), "{table}");
    }
    let page = desk.read("page.md");
    assert!(page.starts_with("# Results\n\nBefore.\n\n<!-- results of e:"), "{page}");
    assert!(page.contains("cfpose run experiments/e.toml --trials 2") && page.contains("McNemar"), "{page}");
    // Again: the section is replaced, what stands around it stays.
    desk.write("page.md", format!("{page}\nAfter.\n"));
    desk.json("report e --docs page.md");
    assert_eq!(desk.read("page.md"), format!("{page}\nAfter.\n"));
    assert!(desk.fails(2, "report e --docs e/results.csv").contains("would overwrite"));
    // Cells that agree in what `[page]` names are pooled: both curves of 2 trials make a row of 4; across them a column each.
    let file = desk.read("e.toml");
    for (keys, header, row) in [
        ("by = [\"scenario\"]", "| scenario | method | trials |", "| planar-curve | paper | 4 |"),
        ("across = [\"curve\"]", "| method | heart | fish |", " of 2 ("),
    ] {
        desk.write("p.toml", format!("{file}\n[page]\n{keys}\n"));
        desk.json("run p.toml --out p");
        desk.json("report p --docs pooled.md");
        let page = desk.read("pooled.md").split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(page.contains(header) && page.contains(row), "{page}");
        std::fs::remove_dir_all(desk.path("p")).unwrap();
    }
    let statistics: serde_json::Value = serde_json::from_str(&desk.read("e/statistics.json")).unwrap();
    let wilcoxon = statistics.as_array().unwrap().iter().find(|entry| entry["statistic"] == "wilcoxon").unwrap();
    assert_eq!((&wilcoxon["cell"], &wilcoxon["rows"][0][2]), (&json!(""), &json!(4)));
}

#[test]
fn a_dry_run_counts_and_writes_nothing() {
    let desk = desk();
    let plan = desk.json("run e.toml --dry --trials 5 --shard 1/3");
    assert_eq!((&plan["records"], &plan["shard_records"]), (&json!(20), &json!(6)));
    assert_eq!(plan["cells"].as_array().unwrap().len(), 2);
    assert!(!desk.path("out").exists());
}

#[test]
fn mistakes_in_experiments_are_named() {
    let desk = desk();
    let replace = |from: &str, to: &str| desk.write("bad.toml", EXPERIMENT.replace(from, to));
    replace("planar-curve", "planar-curv");
    assert!(desk.fails(2, "run bad.toml").contains("did you mean planar-curve?"));
    replace("b_p", "bp");
    assert!(desk.fails(2, "run bad.toml").contains("`bp`"));
    replace("hermite[degree=3]", "hermit[degree=3]");
    assert!(desk.fails(2, "run bad.toml").contains("did you mean hermite?"));
    replace("seed = 3", "seed = ");
    assert!(desk.fails(3, "run bad.toml").starts_with("error: bad.toml: line 1: "));
    // A method that cannot apply is an error before the run, and leaves no folder.
    replace("features = \"hermite[degree=3]\"", "start = \"pca\"");
    let refused = desk.fails(2, "run bad.toml");
    assert!(refused.starts_with("error: method `hermite`, scenario planar-curve[curve=heart,"), "{refused}");
    assert!(
        refused.contains("start `pca` needs a rigid motion")
            && refused.ends_with("leave the method or the scenario out")
    );
    replace("features = \"hermite[degree=3]\"", "preset = \"paper\"\nfeatures = \"coordinates\"");
    assert!(desk.fails(2, "run bad.toml").contains("3 feature function(s) cannot determine 6 unknowns"));
    replace("b_p = 0.01", "theta = \"0 0 0 0 0 -3\"");
    assert!(desk.fails(2, "run bad.toml").contains("theta puts part of the curve behind the camera"));
    replace(
        "name = \"planar-curve\"\ncurve = [\"heart\", \"fish\"]\nb_p = 0.01",
        "name = \"cloud3\"\nshape = \"no.ply\"",
    );
    assert!(desk.fails(3, "run bad.toml").contains("there is no file no.ply beside the experiment"));
    assert!(!desk.path("out").exists());
    replace("\"heart\", \"fish\"", "\"hart\"");
    assert!(desk.fails(2, "run bad.toml").ends_with("did you mean heart?; `cfpose list curves` shows all"));
    assert_eq!(desk.json("list curves").as_array().unwrap().len(), 8);
    assert_eq!(
        desk.fails(3, "run absent.toml"),
        "error: absent.toml: cannot read: there is no such file; check the name and the folder"
    );
    assert!(desk.fails(2, "run e.toml --shard 2/2").contains("I counts from 0"));
    assert!(desk.fails(3, "status .").contains("holds no experiment.toml"));
}

#[test]
fn the_demo_finds_its_pose_and_draws_it() {
    let desk = Desk::new();
    let run = desk.run("demo");
    assert_eq!((run.code, run.err.as_str()), (0, ""));
    assert!(run.out.contains("truth") && run.out.contains("cfpose-demo/overlay.svg"), "{}", run.out);
    assert!(desk.read("cfpose-demo/overlay.svg").starts_with("<svg"));
    let result = desk.json("demo --seed 2 --out elsewhere");
    assert!(result["image"]["px"].as_f64().unwrap() < 0.3 && result["image"]["verdict"] == "good", "{result}");
    assert!(desk.path("elsewhere/registered.png").exists());
    assert!(result["rotation_error_deg"].as_f64().unwrap() < 2.0, "{result}");
    // The command it proposes finds the same pose in its files; so does a scenario that gives no start.
    for scenario in ["planar-curve[b_p=0.01]", "cloud3[points=500]"] {
        let run = desk.run(&format!("demo --scenario {scenario} --out tried --json r.json"));
        assert_eq!(run.code, 0, "{}{}", run.out, run.err);
        let proposed = run.out.lines().find_map(|line| line.strip_prefix("try     cfpose ")).unwrap().replace('\'', "");
        let again = desk.json(&proposed);
        let found: serde_json::Value = serde_json::from_str(&desk.read("r.json")).unwrap();
        for k in 0..6 {
            let [a, b] = [&again, &found].map(|result| result["theta"][k].as_f64().unwrap());
            assert!((a - b).abs() < 1e-4, "{proposed}: {a} {b}");
        }
    }
    assert!(desk.fails(2, "demo --scenario planar").contains("did you mean planar-curve?"));
}

//! Flags act or are refused; outputs spare inputs; what a message advises works.

mod common;

use common::{Desk, apply, cloud, euler_pose, shuffle};
use serde_json::json;

/// A desk with a cloud, its image in space, in the plane and in pixels, and what goes with them.
fn desk() -> Desk {
    let desk = Desk::new();
    let rows = cloud(300, 1);
    desk.write_rows("p.csv", &rows);
    desk.write_rows("q.csv", &apply(&euler_pose([0.1, -0.2, 0.15], [0.1, 0.05, 0.2]), &rows));
    let flat: Vec<Vec<f64>> = rows.iter().map(|row| row[..2].to_vec()).collect();
    desk.write_rows("p2.csv", &flat);
    let mirrored = |row: &Vec<f64>| vec![-1.1 * row[0] + 0.2 * row[1] + 0.3, 0.1 * row[0] + 0.8 * row[1] - 0.2];
    desk.write_rows("q2.csv", &flat.iter().map(mirrored).collect::<Vec<_>>());
    desk.write("pair.yaml", "cam0: {intrinsics: [500, 500, 320, 240]}\ncam1: {intrinsics: [600, 600, 320, 240]}\n");
    desk
}

#[test]
fn reflections_act_in_the_default_search() {
    let desk = desk();
    let line = "estimate --model affine2 --source p2.csv --target q2.csv";
    let forbidden = desk.run(&format!("{line} --json r.json"));
    let allowed = desk.json(&format!("{line} --reflections allow"));
    assert_eq!(allowed["verdict"], "good");
    for (k, expected) in [-1.1, 0.2, 0.1, 0.8, 0.3, -0.2].into_iter().enumerate() {
        assert!((allowed["theta"][k].as_f64().unwrap() - expected).abs() < 1e-6, "{allowed}");
    }
    let determinant = |theta: &serde_json::Value| {
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| theta[k].as_f64().unwrap());
        a * d - b * c
    };
    let other: serde_json::Value = serde_json::from_str(&desk.read("r.json")).unwrap();
    assert!(forbidden.code == 4 || other["verdict"] != "good" || determinant(&other["theta"]) > 0.0, "{other}");
    // Where they cannot act they are refused.
    let refused = |more: &str| desk.fails(2, &format!("{line} --reflections allow {more}"));
    assert!(refused("--start 1,0,0,1,0,0").contains("no effect beside a theta in --start"));
    assert!(refused("--preset paper").contains("start `identity` proposes no reflections"));
    assert!(refused("--start pca[reflections=forbid]").contains("says itself whether there are reflections"));
    let rigid = "estimate --model rigid3 --source p.csv --target q.csv --reflections forbid";
    assert!(desk.fails(2, rigid).contains("the maps of model `rigid3` are no general affine maps"));
}

#[test]
fn a_camera_is_one_sides_or_a_file() {
    let desk = Desk::new();
    let truth = euler_pose([0.1, -0.12, 0.2], [0.05, -0.04, 0.03]);
    let plane: Vec<Vec<f64>> = cloud(500, 6).iter().map(|p| vec![0.3 * p[0] - 0.2, 0.3 * p[1] - 0.1, 1.0]).collect();
    let seen = apply(&truth, &plane);
    desk.write_rows("p.csv", &plane.iter().map(|p| vec![p[0], p[1]]).collect::<Vec<_>>());
    let lens = cfpose_vision::Lens::polynomial(&[-0.28, 0.07, 0.0002, 0.000_017]).unwrap();
    let bent = |p: &Vec<f64>| {
        let [x, y] = lens.distort([p[0] / p[2], p[1] / p[2]]);
        vec![460.5 * x + 367.0, 457.25 * y + 248.5]
    };
    let mut pixels: Vec<Vec<f64>> = seen.iter().map(bent).collect();
    shuffle(&mut pixels, 3);
    desk.write_rows("q.csv", &pixels);
    desk.write(
        "chain.yaml",
        "cam0:\n  camera_model: pinhole\n  distortion_coeffs: [-0.28, 0.07, 0.0002, 1.7e-05]\n  distortion_model: radtan\n  \
         intrinsics: [460.5, 457.25, 367.0, 248.5]\ncam1:\n  intrinsics: [400, 400, 300, 200]\n",
    );
    let line = "estimate --model plane-bearing --source p.csv --target q.csv --target-camera chain.yaml#cam0";
    let result = desk.json(&format!("{line} --transformed-out moved.csv"));
    let found = common::pose_of(&result["pose"]);
    assert!(common::degrees_between(&found, &truth) < 1e-6, "{result}");
    // The transformed points are pixels behind the lens again.
    let moved = desk.read("moved.csv");
    let first: Vec<f64> = moved.lines().nth(1).unwrap().split(',').map(|v| v.parse().unwrap()).collect();
    let expected = bent(&seen[0]);
    assert!((first[0] - expected[0]).hypot(first[1] - expected[1]) < 1e-4, "{first:?} {expected:?}");

    assert!(desk.fails(3, &line.replace("#cam0", "")).contains("several cameras; write FILE#cam0 or #cam1"));
    assert!(desk.fails(3, &line.replace("chain", "chains")).contains("chains.yaml: there is no such file"));
    desk.write("rows.yaml", "camera_matrix: {rows: 3, cols: 3, data: [1, 2]}\n");
    assert!(
        desk.fails(3, &line.replace("chain.yaml#cam0", "rows.yaml"))
            .starts_with("error: rows.yaml: the camera matrix: ")
    );
    let both = format!("{line} --source-camera 500,500,0,0 --camera 500,500,0,0");
    assert!(desk.fails(2, &both).contains("--camera beside --source-camera and --target-camera has no effect"));
    desk.write_rows("far.csv", &[vec![367.0, 248.5], vec![9000.0, 1.0], vec![370.0, 240.0], vec![300.0, 200.0]]);
    desk.write("fold.json", r#"{"fx": 460, "fy": 460, "cx": 367, "cy": 248, "distortion": [-0.28, 0, 0, 0]}"#);
    let far = line.replace("q.csv", "far.csv").replace("chain.yaml#cam0", "fold.json");
    assert!(desk.fails(3, &far).starts_with("error: far.csv: point 2: the camera's lens shows nothing at this pixel"));
}

#[test]
fn flags_without_effect_are_refused() {
    let desk = desk();
    let line = "estimate --model rigid3 --source p.csv --target q.csv";
    for (flag, says) in [
        ("--camera 500,500,320,240", "--camera has no effect, no file has 2 columns of pixels"),
        ("--source-camera 500,500,320,240", "--source-camera has no effect, the file has 3 columns"),
        ("--threshold 100", "--threshold has no effect, no file is an image"),
        ("--foreground dark", "--foreground has no effect, no file is an image"),
    ] {
        let message = desk.fails(2, &format!("{line} {flag}"));
        assert!(message.contains(says) && message.ends_with("leave it out"), "{message}");
    }
}

#[test]
fn an_output_never_names_an_input() {
    let desk = desk();
    let line = "estimate --model rigid3 --source p.csv --target q.csv";
    let evaluate = "evaluate --model rigid3 --source p.csv --target q.csv --at";
    assert_eq!(desk.run(&format!("{line} --json r.json --pose-out pose.txt")).code, 0);
    desk.write("e.toml", "trials = 1\n[[scenario]]\nname = \"cloud3\"\npoints = 40\n[[method]]\nname = \"paper\"\n");
    assert_eq!(desk.run("run e.toml --out runs").code, 0);
    std::fs::create_dir(desk.path("folder")).unwrap();
    desk.write("stages.toml", "[[stage]]\nname = \"only\"\nfeatures = \"trig18\"\n");
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(desk.path("p.csv"), desk.path("link.csv")).unwrap();
        std::fs::hard_link(desk.path("q.csv"), desk.path("hard.csv")).unwrap();
    }
    let mut lines = vec![
        format!("{line} --json p.csv"),
        format!("{line} --json ./q.csv"),
        format!("{line} --json folder/../q.csv"),
        format!("{line} --pose-out p.csv"),
        format!("{line} --transformed-out q.csv"),
        format!("{line} --start pose.txt --pose-out pose.txt"),
        format!("{line} --pipeline stages.toml --json stages.toml"),
        "estimate --model affine2 --source p2.csv --target q2.csv --camera pair.yaml#cam0 --json pair.yaml".to_string(),
        format!("{evaluate} r.json --json r.json"),
        format!("{evaluate} 0,0,0,0,0,0 --json p.csv"),
        "check rigid3 --on p.csv --json p.csv".to_string(),
        "run e.toml --out elsewhere --json e.toml".to_string(),
        "run runs/experiment.toml --out runs --resume --trials 2".to_string(),
        "status runs --json runs/trials.jsonl".to_string(),
        "merge runs --json runs/results.csv".to_string(),
        "report runs --json runs/experiment.toml".to_string(),
        "demo --out folder --json folder/source.csv".to_string(),
    ];
    if cfg!(unix) {
        lines.extend([format!("{line} --json link.csv"), format!("{line} --json hard.csv")]);
    }
    let files = [
        "p.csv",
        "q.csv",
        "r.json",
        "pose.txt",
        "e.toml",
        "runs/trials.jsonl",
        "runs/results.csv",
        "runs/experiment.toml",
    ];
    let before = files.map(|name| desk.read(name));
    for line in lines {
        let message = desk.fails(2, &line);
        assert!(
            message.contains("would overwrite") && message.ends_with("give it a file of its own"),
            "{line}: {message}"
        );
    }
    assert_eq!(files.map(|name| desk.read(name)), before);
    let twice = format!("{line} --json new.txt --pose-out folder/../new.txt");
    assert!(desk.fails(2, &twice).contains("two outputs go to folder/../new.txt"));
    // What only looks alike is written.
    assert_eq!(desk.run(&format!("{line} --json p.json --pose-out folder/p.csv")).code, 0);
    assert_eq!(desk.json("run runs/experiment.toml --out runs --resume")["computed"], json!(0));
}

/// Follow the advice of a message on the command line that it was given for; `None` where there is none that a line can follow.
fn followed(line: &str, message: &str) -> Vec<String> {
    let (problem, advice) = message.rsplit_once("; ").unwrap_or((message, ""));
    let without = |flag: &str| {
        let mut words: Vec<&str> = line.split_whitespace().collect();
        let at = words
            .iter()
            .position(|word| *word == flag || word.starts_with(&format!("{flag}=")))
            .expect("a flag of the line");
        let valued = !words[at].contains('=') && words.get(at + 1).is_some_and(|next| !next.starts_with("--"));
        words.drain(at..=at + usize::from(valued));
        words.join(" ")
    };
    let flag_in = |text: &str| {
        let words =
            text.split([' ', ':', ',', '=']).map(|word| word.trim_matches('`')).find(|word| word.starts_with("--"));
        words.map(str::to_string)
    };
    let mut lines = Vec::new();
    for part in advice.split(", or ").flat_map(|part| part.split(" or ")) {
        let words: Vec<&str> = part.split_whitespace().collect();
        match words.as_slice() {
            ["leave", "it", "out"] => lines.push(without(&flag_in(problem).expect("the message names its flag"))),
            ["use" | "give", flag] | ["use" | "give", flag, ..] if flag.starts_with("--") => {
                let base = if line.contains(flag) { without(flag) } else { line.to_string() };
                let base = match flag_in(problem) {
                    Some(wrong) if wrong != *flag && !problem.contains("no effect") && line.contains(&wrong) => {
                        without(&wrong)
                    }
                    _ => base,
                };
                let value = words.get(2).copied().unwrap_or(if *flag == "--json" { "new.json" } else { "" });
                lines.push(format!("{base} {flag} {value}"));
            }
            ["write", target] if target.starts_with("FILE#") => {
                lines.push(line.replace("pair.yaml", &format!("pair.yaml{}", &target[4..])));
            }
            [choice] if choice.starts_with('#') => lines.push(line.replace("pair.yaml", &format!("pair.yaml{choice}"))),
            ["did", "you", "mean", name] => {
                let wrong = problem.rsplit('`').nth(1).expect("the message quotes the name");
                lines.push(line.replacen(wrong, name.trim_end_matches('?'), 1));
            }
            _ => {}
        }
    }
    lines
}

#[test]
fn advice_of_the_commands_works_when_it_is_followed() {
    let desk = desk();
    let rigid = "estimate --model rigid3 --source p.csv --target q.csv";
    let affine = "estimate --model affine2 --source p2.csv --target q2.csv";
    desk.write("e.toml", "trials = 2\n[[scenario]]\nname = \"cloud3\"\npoints = 40\n[[method]]\nname = \"paper\"\n");
    desk.write_rows("one.csv", &(1..9).map(|k| vec![f64::from(k * k)]).collect::<Vec<_>>());
    let gain = "estimate --model gain1 --source one.csv --target one.csv";
    let lines = [
        format!("{rigid} --camera 500,500,320,240"),
        format!("{rigid} --target-camera 500,500,320,240"),
        format!("{rigid} --threshold 100"),
        format!("{rigid} --foreground dark"),
        format!("{rigid} --depth 2"),
        format!("{rigid} --reflections allow"),
        format!("{affine} --reflections allow --preset paper"),
        format!("{affine} --reflections allow --start whitened-affine[reflections=forbid]"),
        format!("{affine} --camera pair.yaml"),
        format!("{gain} --pose-out pose.txt"),
        format!("{rigid} --features trig81"),
        format!("{rigid} --solver levenberg-marquart"),
        format!("{rigid} --preset papper"),
        "estimate --model rigd3 --source p.csv --target q.csv".to_string(),
        format!("{affine} --camera 1,2,3,4 --source-camera 1,2,3,4 --target-camera 1,2,3,4"),
    ];
    for line in lines {
        let run = desk.run(&line);
        assert!([2, 3].contains(&run.code), "{line}\n{}", run.err);
        let message = run
            .err
            .trim_end()
            .split(" shows all")
            .next()
            .unwrap()
            .rsplit_once("; `cfpose list")
            .map_or(run.err.trim_end(), |(a, _)| a);
        let better = followed(&line, message);
        assert!(!better.is_empty(), "no advice that a line can follow: {message}");
        for better in better {
            let again = desk.run(&better);
            assert!([0, 4].contains(&again.code), "{message}\nfollowed: {better}\ngives: {}", again.err);
        }
    }
}

#[test]
fn points_that_do_not_allow_a_choice_are_bad_input_of_their_file() {
    let desk = desk();
    desk.write_rows("line.csv", &(1..30).map(|k| vec![f64::from(k * k), 0.0]).collect::<Vec<_>>());
    for (files, name) in
        [("--source line.csv --target q2.csv", "line.csv"), ("--source p2.csv --target line.csv", "line.csv")]
    {
        let line = format!("estimate --model affine2 --preset paper --normalise none --start pca {files}");
        let message = desk.fails(3, &line);
        assert!(message.starts_with(&format!("error: {name}: start `pca` needs points with extent")), "{message}");
    }
    let spline = "estimate --model thin-plate2[points=5] --source line.csv --target q2.csv";
    assert!(desk.fails(3, spline).starts_with("error: line.csv: thin-plate2: the control points"));
    desk.write("zero.csv", "x,y,w\n1,2,1\n3,4,0\n5,6,0\n");
    let lonely = desk.fails(3, "estimate --model rigid2 --source zero.csv --target p2.csv");
    assert!(lonely.starts_with("error: zero.csv: only 1 distinct point(s)"), "{lonely}");
}

#[test]
fn threads_and_nesting_are_bounded_by_a_clear_error() {
    let desk = desk();
    let line = "estimate --model rigid3 --source p.csv --target q.csv";
    let run = desk.run(&format!("{line} --threads 60000"));
    assert!(run.code == 2 && run.err.contains("60000 is not in 1..=1024"), "{}", run.err);
    assert_eq!(desk.run(&format!("{line} --threads 1024")).code, 0);
    let nested = (0..12).fold("hermite".to_string(), |inner, _| format!("orthonormalised[basis={inner}]"));
    assert!(desk.fails(2, &format!("{line} --features {nested}")).contains("brackets are nested more than 8 deep"));
    let many = ["fourier[k=8]"; 40].join("+");
    assert!(desk.fails(2, &format!("{line} --features {many}")).contains("more than 16384; choose a smaller family"));
    desk.write("e.toml", "trials = 2\n[[scenario]]\nname = \"cloud3\"\npoints = 40\n[[method]]\nname = \"paper\"\n");
    assert_eq!(desk.json("run e.toml --threads 1024")["records"], 2);
}

#[test]
fn a_figure_shows_before_after_and_residuals() {
    let desk = desk();
    let line = "estimate --model rigid3 --source p.csv --target q.csv";
    assert_eq!(desk.run(&format!("{line} --plot figure.svg")).code, 0);
    let svg = desk.read("figure.svg");
    assert!(svg.starts_with("<svg"));
    for words in ["p.csv onto q.csv, rigid3", "before", "after: good", "residuals: nearest target point - moved point"]
    {
        assert!(svg.contains(words), "{words}");
    }
    assert_eq!(desk.run(&format!("{line} --plot figure.png")).code, 0);
    let png = std::fs::read(desk.path("figure.png")).unwrap();
    assert!(png.starts_with(b"\x89PNG") && png.len() > 5000);
    assert!(desk.fails(2, &format!("{line} --plot figure.pdf")).contains("give a name that ends in .svg or .png"));
    assert!(desk.fails(2, &format!("{line} --plot p.csv")).contains("would overwrite p.csv"));
    assert!(desk.fails(3, &format!("{line} --plot nowhere/figure.svg")).starts_with("error: nowhere/figure.svg: "));
}

#[test]
fn completions_and_manual_come_from_the_definitions() {
    let desk = Desk::new();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let run = desk.run(&format!("completions {shell}"));
        assert!(run.code == 0 && run.out.contains("estimate") && run.out.contains("target-camera"), "{shell}");
    }
    assert!(desk.run("completions tcsh").code == 2);
    let page = desk.run("man");
    assert!(page.code == 0 && page.out.contains(".TH cfpose 1") && page.out.contains("exit codes"), "{}", page.out);
    assert_eq!(desk.run("man --out pages").code, 0);
    assert!(desk.read("pages/cfpose-estimate.1").contains("\\-\\-source\\-camera"));
    assert!(desk.read("pages/cfpose-pose-convert.1").contains("cfpose\\-pose\\-convert"));
}

#[test]
fn one_trial_is_computed_again_with_its_files() {
    let desk = Desk::new();
    desk.write("e.toml", "trials = 3\n[[scenario]]\nname = \"planar-curve\"\nb_p = 0.01\n[[method]]\nname = \"paper\"\npreset = \"paper\"\n");
    desk.json("run e.toml --out r");
    let before = desk.read("r/trials.jsonl");
    let record: serde_json::Value = serde_json::from_str(before.lines().nth(1).unwrap()).unwrap();
    let key = record["key"].as_str().unwrap();
    let again = desk.json(&format!("run e.toml --out r --only {key}"));
    for field in ["theta", "cost", "status", "verdict", "rotation_deg", "evaluations"] {
        assert_eq!(again["records"][0][field], record[field], "{field}");
    }
    assert_eq!(again["repetition"], 1);
    // The files hold the trial: `estimate` finds the same in them.
    let start: Vec<String> = again["start"].as_array().unwrap().iter().map(|v| v.to_string()).collect();
    let files =
        format!("--source r/only-{key}/source.csv --target r/only-{key}/target.csv --start={}", start.join(","));
    let found = desk.json(&format!("estimate --model {} --preset paper {files}", again["model"].as_str().unwrap()));
    for k in 0..6 {
        let [a, b] = [&found["theta"], &record["theta"]].map(|theta| theta[k].as_f64().unwrap());
        assert!((a - b).abs() < 1e-6, "{a} {b}");
    }
    assert_eq!(desk.read("r/trials.jsonl"), before);
    assert!(desk.read(&format!("r/only-{key}/trial.json")).contains("\"truth\""));
    assert!(desk.fails(2, "run e.toml --out r --only 00ff").contains("no trial of this experiment has the key `00ff`"));
}

#[test]
fn other_advice_works_when_it_is_followed() {
    let desk = desk();
    desk.write("e.toml", "trials = 2\n[[scenario]]\nname = \"cloud3\"\npoints = 40\n[[method]]\nname = \"paper\"\n");
    desk.write_rows("one.csv", &(1..9).map(|k| vec![f64::from(k * k)]).collect::<Vec<_>>());
    desk.write_rows("many.csv", &cloud(1100, 5));
    let rigid = "estimate --model rigid3 --source p.csv --target q.csv";
    assert_eq!(desk.run(&format!("{rigid} --json r.json")).code, 0);
    assert_eq!(desk.run("run e.toml --out full").code, 0);
    let many = "estimate --model rigid3 --source many.csv --target many.csv --start 0,0,0,0,0,0";
    let evaluate = "evaluate --model rigid3 --source p.csv --target q.csv --at r.json";
    let gain = "estimate --model gain1 --source one.csv --target one.csv --start";
    // A line, what its message advises, and the line that follows it.
    let cases: Vec<(String, &str, String)> = vec![
        (format!("{rigid} --json p.csv"), "give it a file of its own", format!("{rigid} --json own.json")),
        (
            format!("{rigid} --json a.txt --pose-out a.txt"),
            "give each a file of its own",
            format!("{rigid} --json b --pose-out a.txt"),
        ),
        (
            format!("{rigid} --plot figure.pdf"),
            "give a name that ends in .svg or .png",
            format!("{rigid} --plot figure.svg"),
        ),
        (format!("{rigid} --transformed-out t.las"), "use csv", format!("{rigid} --transformed-out t.csv")),
        (format!("{many} --correspondence=one-to-one"), "use --correspondence", format!("{many} --correspondence")),
        (format!("{gain} pca"), "use identity, grid or a theta", format!("{gain} identity")),
        (format!("{gain} pca"), "use identity, grid or a theta", format!("{gain} 1.5")),
        (format!("{rigid} --start 1,2,3"), "theta needs 6 numbers", format!("{rigid} --start 1,2,3,0,0,0")),
        (format!("{rigid} --free rx,w"), "it has rx, ry, rz, tx, ty, tz", format!("{rigid} --free rx,ry,rz,tx,ty,tz")),
        (
            format!("{rigid} --preset paper --features coordinates"),
            "use a larger family",
            format!("{rigid} --preset paper --features trig18"),
        ),
        (
            format!("{rigid} --preset paper --features coordinates"),
            "or fix parameters",
            format!("{rigid} --preset paper --features coordinates --free tx,ty,tz"),
        ),
        (format!("{evaluate} --features trig18"), "leave it out", evaluate.to_string()),
        (
            format!("{evaluate} --features trig18"),
            "or give numbers",
            format!("{} --features trig18", evaluate.replace("r.json", "0,0,0,0,0,0")),
        ),
        ("run e.toml --out full".to_string(), "resume", "run e.toml --out full --resume".to_string()),
        ("run e.toml --out full".to_string(), "or choose another folder", "run e.toml --out another".to_string()),
        (
            "run e.toml --trials 3 --out full".to_string(),
            "choose another folder",
            "run e.toml --trials 3 --out third".to_string(),
        ),
        ("run e.toml --out x --shard 2/2".to_string(), "for example 0/4", "run e.toml --out x --shard 0/4".to_string()),
        (
            "run e.toml --out y --shard auto".to_string(),
            "give --shard I/N",
            "run e.toml --out y --shard 1/2".to_string(),
        ),
        ("merge folder".to_string(), "give the folder that `run` wrote", "merge full".to_string()),
        ("check rigid4".to_string(), "or rigid3?", "check rigid3".to_string()),
    ];
    std::fs::create_dir(desk.path("folder")).unwrap();
    for (line, advice, better) in cases {
        let run = desk.run(&line);
        assert!([2, 3].contains(&run.code), "{line}: {}", run.code);
        assert!(run.err.contains(advice), "{line}\n{}\nin place of: {advice}", run.err);
        let again = desk.run(&better);
        assert!([0, 4].contains(&again.code), "{}\nfollowed: {better}\ngives: {}", run.err, again.err);
    }
}

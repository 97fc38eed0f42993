//! `cfpose learn`, and weight files wherever a family is named.

mod common;

use common::Desk;

const TRAINING: &str = r#"
kind = "linear"
basis = "hermite[degree=3]"
features = 12
seed = 3
[sampling]
trials = 6
states = 6
validation-trials = 3
rounds = 1
round-trials = 2
[training]
steps = 20
look = 10
batch = 32
[[objective]]
name = "contraction"
[[data]]
scenario = "cloud3"
shape = "{seed}"
points = 60
"#;

const EXPERIMENT: &str = r#"
trials = 2
[[scenario]]
name = "cloud3"
points = 60
start = 20
[[method]]
name = "own"
preset = "paper"
features = "learned[file=w.safetensors]"
"#;

#[test]
fn weights_are_trained_used_and_refused_by_name() {
    let desk = Desk::new();
    desk.write("t.toml", TRAINING);
    desk.write("e.toml", EXPERIMENT);
    let run = desk.run("learn t.toml --out w.safetensors --threads 1");
    assert!(run.code == 0 && run.out.contains("--features learned[file=w.safetensors]"), "{}", run.err);
    desk.run("learn t.toml --out v.safetensors --threads 2");
    assert_eq!(std::fs::read(desk.path("w.safetensors")).unwrap(), std::fs::read(desk.path("v.safetensors")).unwrap());
    let run = desk.json("run e.toml --out out");
    assert_eq!(run["summary"][0]["successes"], 2, "{run}");
    weights_are_part_of_records(&desk);
    desk.write("p.csv", "0,0,0\n1,0,0\n0,2,0\n0,0,3\n1,1,1\n2,1,0\n");
    let estimate = "estimate --model rigid3 --preset paper --source p.csv --target p.csv --features";
    assert_eq!(desk.json(&format!("{estimate} learned[file=w.safetensors]"))["usable"], true);
    assert_eq!(desk.json(&format!("{estimate} learned"))["usable"], true);
    // What is wrong, where, with the exit code of bad input.
    desk.write("x.safetensors", "nothing of that kind");
    let message = desk.fails(3, &format!("{estimate} learned[file=x.safetensors]"));
    assert!(message.contains("x.safetensors: not a safetensors file"), "{message}");
    let message = desk.fails(3, &format!("{estimate} hermite+2*learned[file=absent]"));
    assert!(message.contains("absent: there is no such file; check the name and the folder"), "{message}");
    let message = desk.fails(3, "learn absent.toml");
    assert!(
        message.ends_with("absent.toml: cannot read: there is no such file; check the name and the folder"),
        "{message}"
    );
    let message = desk.fails(2, "learn t.toml --out t.toml");
    assert!(message.contains("would overwrite t.toml"), "{message}");
    desk.write("u.toml", TRAINING.replace("contraction", "contractoin"));
    assert!(desk.fails(2, "learn u.toml").contains("did you mean contraction"));
}

/// Records name the hash of the weights of their method, in a stage too, and go on with no others.
fn weights_are_part_of_records(desk: &Desk) {
    let stages = "\n[[method]]\nname = \"staged\"\npipeline = \"s.toml\"\n";
    desk.write("s.toml", "[[stage]]\nname = \"only\"\nfeatures = \"learned[file=v.safetensors]\"\n");
    desk.write("f.toml", format!("{EXPERIMENT}{stages}"));
    let run = desk.json("run f.toml --out staged");
    // Both files hold the same weights and the printed method is one stage: the same answers.
    assert_eq!(run["summary"][0]["median_error"], run["summary"][1]["median_error"], "{run}");
    let hash = |name: &str| format!("{:016x}", cfpose_lab::seed::fnv1a(&std::fs::read(desk.path(name)).unwrap()));
    let (own, before) = (hash("w.safetensors"), hash("v.safetensors"));
    let records = std::fs::read_to_string(desk.path("staged/trials.jsonl")).unwrap();
    let names = ["w", "v"].map(|name| format!("\"data\":{{\"weights:{name}.safetensors\":\"{own}\"}}"));
    assert!(own == before && names.iter().all(|name| records.matches(name.as_str()).count() == 2), "{records}");
    // Weights that were trained again otherwise are seen, whoever names them.
    desk.run("learn t.toml --seed 4 --out v.safetensors");
    let message = desk.fails(3, "run f.toml --out staged --resume --trials 3");
    assert!(hash("v.safetensors") != before && message.contains("method staged"), "{message}");
    assert!(message.contains(&before) && message.contains(&hash("v.safetensors")), "{message}");
    std::fs::copy(desk.path("w.safetensors"), desk.path("v.safetensors")).unwrap();
    assert_eq!(desk.json("run f.toml --out staged --resume --trials 3")["records"], 6);
}

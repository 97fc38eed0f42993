//! The rules of the house: arrows between rooms point one way, leaves stand alone, pointers lead somewhere.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

#[path = "house/source.rs"]
mod source;

use source::{Tree, module, tokens};

/// Tables whose entries are one file each.
const TABLES: [&[&str]; 8] = [
    &["models"],
    &["families"],
    &["start"],
    &["statistics", "weighting"],
    &["scenarios"],
    &["objectives"],
    &["statistics", "entries"],
    &["plots"],
];

/// Rooms of `cfpose`, at most.
const MAX_ROOMS: usize = 16;

/// The random generator that earlier versions drew from beside ChaCha12.
const OLD_GENERATOR: &str = concat!("ChaCha", "8");

/// Return the root of the repository.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Return name and source of every crate.
fn crates() -> Vec<(String, Tree)> {
    let mut all: Vec<_> = fs::read_dir(root().join("crates"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.join("src").is_dir())
        .map(|path| (path.file_name().unwrap().to_str().unwrap().to_string(), Tree::read(&path.join("src"))))
        .collect();
    all.sort_by(|a, b| a.0.cmp(&b.0));
    assert!(all.len() >= 6, "only {} crates were found", all.len());
    all
}

/// Return all Rust files and pages of the repository by path.
fn files(extension: &str) -> BTreeMap<PathBuf, String> {
    let mut found = BTreeMap::new();
    let mut open: Vec<PathBuf> = ["crates", "examples", "benches", "docs"].map(|name| root().join(name)).into();
    while let Some(directory) = open.pop() {
        for entry in fs::read_dir(directory).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|found| found == extension) {
                let text = fs::read_to_string(&path).unwrap();
                found.insert(path, text);
            }
        }
    }
    found
}

/// Return a circle of rooms in words, if there is one.
fn circle(tree: &Tree) -> Option<String> {
    let rooms = tree.rooms();
    let mut next: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    let mut place = BTreeMap::new();
    for arrow in tree.arrows() {
        let (from, Some(to)) = (arrow.from[0].clone(), arrow.to.first().cloned()) else { continue };
        if from != to && rooms.contains(&to) {
            place.entry((from.clone(), to.clone())).or_insert(arrow.from.join("/"));
            next.entry(from).or_default().insert(to);
        }
    }
    rooms.iter().find_map(|start| {
        let way = way_back(start, &next)?;
        let steps = way.windows(2).map(|pair| {
            let file = &place[&(pair[0].clone(), pair[1].clone())];
            format!("{} -> {} ({file})", pair[0], pair[1])
        });
        Some(steps.collect::<Vec<_>>().join(", "))
    })
}

/// Return the shortest way from a room back to itself.
fn way_back(start: &str, next: &BTreeMap<String, BTreeSet<String>>) -> Option<Vec<String>> {
    let mut ways = vec![vec![start.to_string()]];
    let mut seen = BTreeSet::new();
    while !ways.is_empty() {
        let mut longer = Vec::new();
        for way in ways {
            for room in next.get(way.last()?).into_iter().flatten() {
                let mut further = way.clone();
                further.push(room.clone());
                if room == start {
                    return Some(further);
                }
                if seen.insert(room.clone()) {
                    longer.push(further);
                }
            }
        }
        ways = longer;
    }
    None
}

/// Return every import of one leaf of a table by another.
fn sibling_imports(tree: &Tree, table: &[&str]) -> Vec<String> {
    let depth = table.len();
    let inside = |path: &[String]| path.len() > depth && path.iter().zip(table).all(|(a, b)| a == b);
    let leaf = |path: &[String]| inside(path).then(|| path[depth].clone()).filter(|name| name != "shared");
    let leaves: BTreeSet<String> = tree.0.keys().filter_map(|path| leaf(&module(path))).collect();
    let mut found = Vec::new();
    for arrow in tree.arrows() {
        if let (Some(from), Some(to)) = (leaf(&arrow.from), leaf(&arrow.to))
            && from != to
            && leaves.contains(&to)
        {
            found.push(format!("{}/{from} imports {to}", table.join("/")));
        }
    }
    found
}

/// Return the text of all whole-line comments, joined.
fn comments(text: &str) -> String {
    let lines = text.lines().map(str::trim_start).filter(|line| line.starts_with("//"));
    lines.map(|line| line.trim_start_matches(['/', '!']).trim()).collect::<Vec<_>>().join(" ")
}

/// Return the pointers of a text, as (docs/method.md, *Noise*): page and heading.
fn pointers(text: &str) -> Vec<(String, String)> {
    let mut found = Vec::new();
    for (at, _) in text.match_indices(".md, *") {
        let begin = text[..at].rfind(|c: char| !(c.is_alphanumeric() || "/_-.".contains(c))).map_or(0, |i| i + 1);
        let rest = &text[at + 6..];
        if let Some(end) = rest.find('*') {
            found.push((format!("{}.md", &text[begin..at]), rest[..end].to_string()));
        }
    }
    found
}

/// Return the tests that a row of the paper map names: file from the repository's root, beginning of the name.
fn named_tests(row: &str) -> Vec<(String, String)> {
    let mut found = Vec::new();
    for cell in row.split('|') {
        let (mut home, mut file) = ("cfpose", None);
        for word in cell.split('`').skip(1).step_by(2) {
            if word.starts_with("cfpose-") {
                home = word;
            } else if word.starts_with("tests/") {
                let path = format!("crates/{home}/{word}");
                found.push((path.clone(), String::new()));
                file = Some(path);
            } else if let (Some(file), Some(begin)) = (&file, word.strip_suffix("...")) {
                found.push((file.clone(), begin.to_string()));
            }
        }
    }
    found
}

#[test]
fn rooms_form_no_circle() {
    let found: Vec<String> =
        crates().iter().filter_map(|(name, tree)| circle(tree).map(|circle| format!("{name}: {circle}"))).collect();
    assert!(found.is_empty(), "circles of rooms:\n{}", found.join("\n"));
}

#[test]
fn cfpose_has_few_rooms() {
    let all = crates();
    let (_, tree) = all.iter().find(|(name, _)| name == "cfpose").unwrap();
    let rooms = tree.rooms();
    assert!(rooms.len() <= MAX_ROOMS, "{} rooms: {rooms:?}", rooms.len());
}

#[test]
fn leaves_import_no_leaves() {
    let mut found = Vec::new();
    for (name, tree) in crates() {
        for table in TABLES {
            found.extend(sibling_imports(&tree, table).into_iter().map(|sentence| format!("{name}: {sentence}")));
        }
    }
    assert!(found.is_empty(), "shared parts go one level up or into shared/:\n{}", found.join("\n"));
}

#[test]
fn pointers_in_comments_lead_to_headings() {
    let mut wrong = Vec::new();
    let mut count = 0;
    for (path, text) in files("rs") {
        let comments = comments(&text);
        if comments.contains(".md, section") || comments.contains(".md section") {
            wrong.push(format!("{}: cites a numbered section; headings have no numbers", path.display()));
        }
        for (page, heading) in pointers(&comments) {
            count += 1;
            let headings = fs::read_to_string(root().join(&page)).unwrap_or_default();
            if !headings.lines().any(|line| line.starts_with('#') && line.trim_start_matches('#').trim() == heading) {
                wrong.push(format!("{}: {page} has no heading `{heading}`", path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "pointers that lead nowhere:\n{}", wrong.join("\n"));
    assert!(count >= 5, "only {count} pointers were found");
}

#[test]
fn tests_of_the_paper_map_exist() {
    let page = fs::read_to_string(root().join("docs/paper-map.md")).unwrap();
    let rows: Vec<&str> = page.lines().filter(|line| line.starts_with('|')).collect();
    let named: Vec<_> = rows.iter().flat_map(|row| named_tests(row)).collect();
    assert!(named.len() >= 15, "only {} tests were found", named.len());
    for (file, begin) in named {
        let text = fs::read_to_string(root().join(&file)).unwrap_or_else(|error| panic!("{file}: {error}"));
        assert!(begin.is_empty() || text.contains(&format!("fn {begin}")), "{file} has no test `{begin}...`");
    }
}

#[test]
fn files_that_the_maps_name_exist() {
    let sources: Vec<String> = files("rs").keys().map(|path| path.display().to_string()).collect();
    let mut missing = Vec::new();
    for page in ["docs/paper-map.md", "ARCHITECTURE.md"] {
        let text = fs::read_to_string(root().join(page)).unwrap();
        // Every other piece between backticks is code.
        for name in text.split('`').skip(1).step_by(2).filter(|name| name.ends_with(".rs") && !name.contains(' ')) {
            let known = root().join(name).exists() || sources.iter().any(|path| path.ends_with(&format!("/{name}")));
            if !known {
                missing.push(format!("{page}: {name}"));
            }
        }
    }
    assert!(missing.is_empty(), "files that are not there:\n{}", missing.join("\n"));
}

#[test]
fn random_numbers_come_from_one_generator() {
    let found: Vec<_> = files("rs").into_iter().filter(|(_, text)| text.contains(OLD_GENERATOR)).map(|f| f.0).collect();
    assert!(found.is_empty(), "{OLD_GENERATOR} in {found:#?}");
}

#[test]
fn the_map_of_the_house_names_every_room() {
    let page = fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let rooms = page.split("## Rooms").nth(1).expect("ARCHITECTURE.md has a section Rooms");
    for (name, tree) in crates() {
        let row = rooms.lines().find(|line| line.starts_with(&format!("| `{name}` |")));
        let row = row.unwrap_or_else(|| panic!("ARCHITECTURE.md, Rooms: no row for {name}"));
        for room in tree.rooms() {
            assert!(row.contains(&format!("`{room}`")), "ARCHITECTURE.md, Rooms: {name} lacks `{room}`");
        }
    }
}

/// Names that the first page of the library's documentation lists, outside the tables.
fn public_names(lib: &str) -> Vec<String> {
    let tables = ["models", "families", "start", "normalise", "weighting"];
    let text: String = lib.lines().filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n");
    let mut names = Vec::new();
    for statement in text.split(';').map(str::trim) {
        // Of a module with a body only its own name is on the page.
        if let Some(at) = statement.rfind("pub mod ") {
            names.extend(statement[at + 8..].split_whitespace().next().map(str::to_string));
        } else if let Some(path) = statement.strip_prefix("pub use ") {
            let list = path.rsplit_once("::").map_or(path, |(_, list)| list);
            let list = path.find('{').map_or(list, |at| &path[at + 1..]);
            let own = |name: &str| {
                name.rsplit(" as ").next().map(|name| name.trim_matches(['{', '}', ' ', '\n']).to_string())
            };
            names.extend(list.split(',').filter_map(own).filter(|name| !name.is_empty() && name != "*"));
        }
    }
    names.retain(|name| !tables.contains(&name.as_str()));
    names
}

#[test]
fn the_public_page_is_short() {
    let names = public_names(&fs::read_to_string(root().join("crates/cfpose/src/lib.rs")).unwrap());
    assert!(names.iter().any(|name| name == "Estimator") && names.iter().any(|name| name == "theta"), "{names:?}");
    assert!(names.len() <= 60, "{} names: {names:?}", names.len());
    println!("{} names", names.len());
}

#[test]
fn criteria_in_the_method_page_are_those_of_the_code() {
    let page = fs::read_to_string(root().join("docs/method.md")).unwrap();
    for row in cfpose::Criteria::default().table() {
        let begin = format!("| `{}` | {} | {} |", row.name, row.value, row.unit);
        assert!(page.lines().any(|line| line.starts_with(&begin)), "docs/method.md lacks `{begin}`; run `cfpose docs`");
    }
}

#[test]
fn the_rules_find_what_they_look_for() {
    let good = [("a.rs", "use crate::b::X; // crate::c::Y\nconst T: &str = \"crate::c\";"), ("b.rs", ""), ("c.rs", "")];
    assert_eq!(circle(&Tree::of(&good)), None);
    let bad = Tree::of(&[
        ("a.rs", "use crate::b::X;"),
        ("b/mod.rs", "mod d;"),
        ("b/d.rs", "use super::super::{c, e};"),
        ("c.rs", "fn f() { crate::a::g(); }"),
    ]);
    assert_eq!(circle(&bad).unwrap(), "a -> b (a), b -> c (b/d), c -> a (c)");
    // Through a name that the root re-exports.
    let root =
        Tree::of(&[("lib.rs", "pub use a::{X, y as Z};"), ("a.rs", "use crate::b;"), ("b.rs", "use crate::{Z};")]);
    assert!(circle(&root).is_some());
    let hidden = Tree::of(&[("a.rs", "use crate::b;"), ("b.rs", "#[cfg(test)]\nmod tests { use crate::a::X; }")]);
    assert_eq!(circle(&hidden), None);
    let table = [("models/mod.rs", ""), ("models/x.rs", "use super::{shared::s, y::F};"), ("models/y.rs", "")];
    assert_eq!(sibling_imports(&Tree::of(&table), &["models"]), ["models/x imports y"]);
    assert_eq!(
        pointers(&comments("/// as said (docs/a.md, *What\n/// follows*).")),
        [("docs/a.md".to_string(), "What follows".to_string())]
    );
    assert_eq!(
        named_tests("| x | `y.rs` | `tests/z.rs` `it_is...` |")[1],
        ("crates/cfpose/tests/z.rs".into(), "it_is".into())
    );
    assert_eq!(tokens("'a' b'\\'' r#\"crate::x\"# 'static"), ["b", "'", "static"]);
}

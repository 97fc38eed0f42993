//! A reader of Rust source that knows just enough to see which module names which: paths, groups, `super`.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// One way from a module to what it names, both as paths from the crate's root.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Arrow {
    pub from: Vec<String>,
    pub to: Vec<String>,
}

/// The source of one crate: text by path below `src`.
#[derive(Debug, Default)]
pub struct Tree(pub BTreeMap<String, String>);

impl Tree {
    /// Make a tree of texts, for tests of the rules themselves.
    pub fn of(files: &[(&str, &str)]) -> Self {
        Self(files.iter().map(|(path, text)| (path.to_string(), text.to_string())).collect())
    }

    /// Read all Rust files below a directory.
    pub fn read(root: &Path) -> Self {
        let mut tree = Self::default();
        let mut open = vec![root.to_path_buf()];
        while let Some(directory) = open.pop() {
            for entry in fs::read_dir(&directory).unwrap_or_else(|error| panic!("{}: {error}", directory.display())) {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    open.push(path);
                } else if path.extension().is_some_and(|extension| extension == "rs") {
                    let key = path.strip_prefix(root).unwrap().to_str().unwrap().replace('\\', "/");
                    tree.0.insert(key, fs::read_to_string(&path).unwrap());
                }
            }
        }
        tree
    }

    /// Return the rooms: the top-level modules, each a file or a directory.
    pub fn rooms(&self) -> BTreeSet<String> {
        self.0.keys().filter_map(|path| module(path).into_iter().next()).collect()
    }

    /// Return every arrow between modules of the crate; `crate::Name` counts as an arrow to the room that the root takes it from.
    pub fn arrows(&self) -> Vec<Arrow> {
        let exports = self.exports();
        let mut arrows = Vec::new();
        for (path, text) in &self.0 {
            let from = module(path);
            if from.is_empty() {
                continue;
            }
            for mut to in paths(&tokens(text), &from) {
                if let Some(room) = to.first().and_then(|name| exports.get(name)) {
                    to.insert(0, room.clone());
                }
                arrows.push(Arrow { from: from.clone(), to });
            }
        }
        arrows
    }

    /// Return what the root re-exports: name, and the room it comes from.
    fn exports(&self) -> BTreeMap<String, String> {
        let rooms = self.rooms();
        let mut exports = BTreeMap::new();
        let tokens = self.0.get("lib.rs").map(|text| tokens(text)).unwrap_or_default();
        for i in 0..tokens.len() {
            if tokens[i] == "use" && tokens.get(i + 1).is_some_and(|name| rooms.contains(name)) {
                for path in expand(&tokens, i + 1, Vec::new()).0 {
                    let name = path.last().cloned().unwrap_or_default();
                    if !rooms.contains(&name) {
                        exports.insert(name, path[0].clone());
                    }
                }
            }
        }
        exports
    }
}

/// Return the module of a file; the root is the empty path.
pub fn module(path: &str) -> Vec<String> {
    let mut parts: Vec<String> = path.trim_end_matches(".rs").split('/').map(str::to_string).collect();
    if matches!(parts.last().map(String::as_str), Some("mod" | "lib" | "main")) {
        parts.pop();
    }
    parts
}

/// Split source into names and signs, without comments, strings, and modules that only tests see.
pub fn tokens(text: &str) -> Vec<String> {
    let c: Vec<char> = text.chars().collect();
    let (mut out, mut i) = (Vec::new(), 0);
    let at = |i: usize| c.get(i).copied().unwrap_or('\0');
    while i < c.len() {
        match c[i] {
            '/' if at(i + 1) == '/' => i = until(&c, i, "\n"),
            '/' if at(i + 1) == '*' => i = until(&c, i, "*/"),
            'r' if at(i + 1) == '"' => i = until(&c, i + 2, "\""),
            'r' if at(i + 1) == '#' && at(i + 2) == '"' => i = until(&c, i + 3, "\"#"),
            '"' => i = end_of_string(&c, i),
            '\'' if at(i + 1) == '\\' => i = until(&c, i + 3, "'"),
            '\'' if at(i + 2) == '\'' => i += 3,
            ':' if at(i + 1) == ':' => {
                out.push("::".to_string());
                i += 2;
            }
            x if x.is_alphanumeric() || x == '_' => {
                let start = i;
                while at(i).is_alphanumeric() || at(i) == '_' {
                    i += 1;
                }
                out.push(c[start..i].iter().collect());
            }
            x => {
                if !x.is_whitespace() {
                    out.push(x.to_string());
                }
                i += 1;
            }
        }
    }
    without_tests(out)
}

/// Return the place after the next occurrence of `end`.
fn until(c: &[char], from: usize, end: &str) -> usize {
    let end: Vec<char> = end.chars().collect();
    (from..c.len()).find(|i| c[*i..].starts_with(&end)).map_or(c.len(), |i| i + end.len())
}

/// Return the place after a string that begins at `i`.
fn end_of_string(c: &[char], mut i: usize) -> usize {
    i += 1;
    while i < c.len() && c[i] != '"' {
        i += if c[i] == '\\' { 2 } else { 1 };
    }
    i + 1
}

/// Drop `#[cfg(test)] mod name { .. }`, and the same of `doctest`.
fn without_tests(tokens: Vec<String>) -> Vec<String> {
    let (mut out, mut i) = (Vec::new(), 0);
    while i < tokens.len() {
        let head: Vec<&str> = tokens[i..].iter().take(8).map(String::as_str).collect();
        let hidden = matches!(head[..], ["#", "[", "cfg", "(", "test" | "doctest", ")", "]", "mod"]);
        if !hidden {
            out.push(tokens[i].clone());
            i += 1;
            continue;
        }
        let mut depth = 0_usize;
        while i < tokens.len() {
            let token = tokens[i].as_str();
            i += 1;
            match token {
                "{" => depth += 1,
                "}" if depth == 1 => break,
                "}" => depth -= 1,
                ";" if depth == 0 => break,
                _ => {}
            }
        }
    }
    out
}

/// Return every path that begins with `crate` or `super`, from the crate's root.
fn paths(tokens: &[String], from: &[String]) -> Vec<Vec<String>> {
    let (mut found, mut i) = (Vec::new(), 0);
    while i + 1 < tokens.len() {
        let inner = i > 0 && tokens[i - 1] == "::";
        if inner || !matches!(tokens[i].as_str(), "crate" | "super") || tokens[i + 1] != "::" {
            i += 1;
            continue;
        }
        let mut prefix = if tokens[i] == "crate" { Vec::new() } else { from[..from.len() - 1].to_vec() };
        i += 2;
        while tokens.get(i).is_some_and(|token| token == "super") {
            prefix.pop();
            i += 2;
        }
        let (more, next) = expand(tokens, i, prefix);
        found.extend(more);
        i = next;
    }
    found
}

/// Expand `a::{b, c::d}` from place `i` on, behind a prefix; returns the paths and the place after them. `a as b` ends in b.
fn expand(tokens: &[String], mut i: usize, mut prefix: Vec<String>) -> (Vec<Vec<String>>, usize) {
    while i < tokens.len() {
        if tokens[i] == "{" {
            let mut all = Vec::new();
            i += 1;
            while i < tokens.len() && tokens[i] != "}" {
                let (more, next) = expand(tokens, i, prefix.clone());
                all.extend(more);
                i = if next > i { next } else { i + 1 };
                if tokens.get(i).is_some_and(|token| token == ",") {
                    i += 1;
                }
            }
            return (all, i + 1);
        }
        if !tokens[i].starts_with(|c: char| c.is_alphanumeric() || c == '_' || c == '*') {
            break;
        }
        prefix.push(tokens[i].clone());
        i += 1;
        match tokens.get(i).map(String::as_str) {
            Some("::") => i += 1,
            Some("as") => {
                prefix.push(tokens.get(i + 1).cloned().unwrap_or_default());
                i += 2;
                break;
            }
            _ => break,
        }
    }
    (vec![prefix], i)
}

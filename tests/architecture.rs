//! Holds the imports of the sources, paths in code included, against the table of rooms in `lib.rs`, and finds circles of
//! files.

mod files;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use proc_macro2::{TokenStream, TokenTree};
use quote::ToTokens;

/// Who may import whom; an entry with `::` allows just that module of a room.
const TABLE: &[(&str, &[&str])] = &[
    ("domain", &[]),
    ("store", &[]),
    ("remote", &["store"]),
    ("kinds", &["domain", "store"]),
    ("pipeline", &["store"]),
    ("stages", &["domain", "kinds", "pipeline", "store"]),
    ("report", &["domain", "kinds", "store", "pipeline::event"]),
    ("cluster", &["pipeline", "remote", "store"]),
    ("cli", &["cluster", "domain", "kinds", "pipeline", "remote", "store", "stages", "report"]),
    ("python", &["cluster", "domain", "kinds", "pipeline", "remote", "store", "stages", "report", "cli"]),
];

/// What the domain does without: files, clocks, the environment, printing.
const WORLD: &[&str] = &["std::fs", "std::env", "std::time", "std::net", "std::process"];
const PRINTING: &[&str] = &["print", "println", "eprint", "eprintln", "dbg"];

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("the folder of sources") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") && path.file_stem().is_some_and(|stem| stem != "tests") {
            found.push(path);
        }
    }
}

fn is_test(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|a| a.path().is_ident("cfg") && a.to_token_stream().to_string().contains("test"))
}

/// The tokens of a file, without its test modules, as a flat list of words and signs.
fn words(source: &str) -> Vec<String> {
    let file = syn::parse_file(source).expect("the sources parse");
    let mut out = Vec::new();
    for item in &file.items {
        let test = match item {
            syn::Item::Mod(item) => is_test(&item.attrs),
            syn::Item::Use(item) => is_test(&item.attrs),
            syn::Item::Fn(item) => is_test(&item.attrs),
            _ => false,
        };
        if !test {
            flatten(item.to_token_stream(), &mut out);
        }
    }
    out
}

fn flatten(tokens: TokenStream, out: &mut Vec<String>) {
    for token in tokens {
        match token {
            TokenTree::Group(group) => {
                out.push("{".to_owned());
                flatten(group.stream(), out);
                out.push("}".to_owned());
            }
            TokenTree::Literal(_) => out.push("\"\"".to_owned()),
            other => out.push(other.to_string()),
        }
    }
}

/// The paths that start at the crate's root: `crate::a::b`, `crate::{a::b, c}`, and `super` chains that climb to it.
fn imported(words: &[String], depth: usize) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut at = 0;
    while at < words.len() {
        let mut next = at;
        if words[at] == "crate" || words[at] == "trodden" {
            next = at + 1;
        } else {
            let mut climbed = 0;
            while words.get(next).is_some_and(|w| w == "super") {
                climbed += 1;
                next += 1;
                if words.get(next + 2).is_some_and(|w| w == "super") {
                    next += 2;
                }
            }
            if climbed == 0 || climbed < depth {
                at = next.max(at + 1);
                continue;
            }
        }
        if colons(words, next) {
            collect(words, next + 2, &mut found);
        }
        at = next.max(at + 1);
    }
    found
}

fn colons(words: &[String], at: usize) -> bool {
    words.get(at).is_some_and(|w| w == ":") && words.get(at + 1).is_some_and(|w| w == ":")
}

fn collect(words: &[String], at: usize, found: &mut BTreeSet<String>) {
    let Some(word) = words.get(at) else { return };
    if word != "{" {
        let second = colons(words, at + 1).then(|| words.get(at + 3)).flatten().filter(|second| *second != "{");
        found.insert(second.map_or_else(|| word.clone(), |second| format!("{word}::{second}")));
        return;
    }
    let (mut depth, mut expects) = (1, true);
    for (offset, word) in words[at + 1..].iter().enumerate() {
        match word.as_str() {
            "{" => depth += 1,
            "}" => depth -= 1,
            "," if depth == 1 => expects = true,
            _ if expects => {
                collect(words, at + 1 + offset, found);
                expects = false;
            }
            _ => {}
        }
        if depth == 0 {
            return;
        }
    }
}

/// The room of a file and how many `super`s lead from it to the crate's root.
fn place(root: &Path, file: &Path) -> (String, usize) {
    let relative = file.strip_prefix(root).expect("below the sources");
    let mut parts: Vec<String> =
        relative.iter().map(|p| p.to_string_lossy().trim_end_matches(".rs").to_owned()).collect();
    if parts.last().is_some_and(|last| last == "mod") {
        parts.pop();
    }
    (parts[0].clone(), parts.len())
}

#[test]
fn imports_follow_the_table_of_rooms() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let table: BTreeMap<&str, &[&str]> = TABLE.iter().copied().collect();
    let mut files = Vec::new();
    sources(&root, &mut files);
    assert!(files.len() > 30, "the walk found the sources");
    let mut wrong = Vec::new();
    for file in &files {
        let (room, depth) = place(&root, file);
        if ["lib", "main", "build"].contains(&room.as_str()) {
            continue;
        }
        let allowed = table.get(room.as_str()).unwrap_or_else(|| panic!("`{room}` is not a room of the table"));
        let words = words(&std::fs::read_to_string(file).expect("a readable source"));
        for path in imported(&words, depth) {
            let target = path.split("::").next().expect("a first part");
            let known = table.contains_key(target);
            if known && target != room && !allowed.contains(&target) && !allowed.contains(&path.as_str()) {
                wrong.push(format!("{}: `{room}` may not import `{path}`", file.display()));
            }
        }
        if room == "domain" {
            wrong.extend(worldly(&words).map(|what| format!("{}: the domain may not use `{what}`", file.display())));
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

fn worldly(words: &[String]) -> impl Iterator<Item = String> + '_ {
    let paths = (0..words.len()).filter(|at| words[*at] == "std" && colons(words, at + 1)).flat_map(|at| {
        let mut found = BTreeSet::new();
        collect(words, at + 3, &mut found);
        found.into_iter().map(|path| format!("std::{}", path.split("::").next().expect("a first part")))
    });
    let printing = words
        .windows(2)
        .filter(|pair| pair[1] == "!" && PRINTING.contains(&pair[0].as_str()))
        .map(|pair| format!("{}!", pair[0]));
    paths.filter(|path| WORLD.contains(&path.as_str())).chain(printing)
}

#[test]
fn the_rooms_have_no_cycle() {
    let table: BTreeMap<&str, &[&str]> = TABLE.iter().copied().collect();
    let mut order: Vec<&str> = Vec::new();
    while order.len() < table.len() {
        let ready = table.iter().find(|(room, imports)| {
            !order.contains(room) && imports.iter().all(|i| order.contains(&i.split("::").next().expect("a room")))
        });
        order.push(ready.expect("a room whose imports are all in order").0);
    }
}

#[test]
fn no_files_need_each_other() {
    let needs = files::Sources::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src")).needs();
    assert!(needs.values().map(BTreeSet::len).sum::<usize>() > 300, "the reader found what files need");
    let mut wrong = Vec::new();
    for circle in files::circles(&needs) {
        let within = |file: &&PathBuf| circle.contains(*file);
        let names = |files: &mut dyn Iterator<Item = &PathBuf>| {
            files.map(|file| file.display().to_string()).collect::<Vec<_>>().join(", ")
        };
        let lines: Vec<String> = circle
            .iter()
            .map(|file| format!("{} needs {}", file.display(), names(&mut needs[file].iter().filter(within))))
            .collect();
        wrong.push(lines.join("\n"));
    }
    assert!(wrong.is_empty(), "circles of files:\n{}", wrong.join("\n\n"));
}

#[test]
fn the_reader_of_paths_sees_what_it_must() {
    let check = |source: &str, depth: usize, expected: &[&str]| {
        let found: Vec<String> = imported(&words(source), depth).into_iter().collect();
        assert_eq!(found, expected, "{source}");
    };
    check("use crate::store::Digest;", 2, &["store::Digest"]);
    check("use crate::{domain::map::A, store::{B, C}};", 2, &["domain::map", "store"]);
    check("fn f() -> u8 { crate::cli::run(); vec![crate::report::X] }", 2, &["cli::run", "report::X"]);
    check("use super::super::stages::X; use super::own::Y;", 2, &["stages::X"]);
    check("#[cfg(test)] mod tests { use crate::cli::X; }", 1, &[]);
    assert_eq!(
        worldly(&words("use std::{fs, collections::BTreeMap}; fn f() { println!(); }")).collect::<Vec<_>>(),
        ["std::fs", "println!"]
    );
}

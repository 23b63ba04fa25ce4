//! No circle of files: which file of the sources needs which, and what hangs together in both directions.
//!
//! A file needs another if it names something that is defined there: by `use`, by a path in its code, in a signature or
//! in a macro. Re-exports are looked through: `super::Thing` is a need for the file that defines `Thing`, not for the
//! `mod.rs` that passes it on. So a `mod.rs` that only declares and re-exports needs nothing, and nobody needs it. What a
//! `mod.rs` defines or computes itself counts as in any other file: a child that uses its parent's types while the
//! parent calls the child is a circle. Test modules are left out; methods (`value.method()`) are not followed.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use quote::ToTokens;

use super::{flatten, is_test, sources};

/// A module: a file, or a part of one.
#[derive(Default)]
struct Module {
    file: PathBuf,
    /// Names that are defined in it.
    items: BTreeSet<String>,
    /// Names that `use` brings into it, with their paths.
    names: BTreeMap<String, Vec<String>>,
    /// Paths whose whole content `use` brings into it.
    globs: Vec<Vec<String>>,
    /// Everything that its own code names: paths of one part too.
    paths: BTreeSet<Vec<String>>,
}

/// Where a path leads to.
enum Target {
    Module(Vec<String>),
    Item(PathBuf),
}

/// The modules of the sources by path; the crate's root has the empty one.
#[derive(Default)]
pub struct Sources {
    modules: BTreeMap<Vec<String>, Module>,
}

impl Sources {
    /// Reads all sources below a folder.
    pub fn read(root: &Path) -> Self {
        let mut files = Vec::new();
        sources(root, &mut files);
        let mut all = Self::default();
        for file in files {
            let relative = file.strip_prefix(root).expect("below the folder").to_owned();
            all.add_file(&relative, &std::fs::read_to_string(&file).expect("a readable source"));
        }
        all
    }

    fn add_file(&mut self, file: &Path, source: &str) {
        let mut path: Vec<String> = file.with_extension("").iter().map(|p| p.to_string_lossy().into_owned()).collect();
        if path.last().is_some_and(|last| ["mod", "lib"].contains(&last.as_str())) {
            path.pop();
        }
        self.add(path, file, &syn::parse_file(source).expect("the sources parse").items);
    }

    fn add(&mut self, path: Vec<String>, file: &Path, items: &[syn::Item]) {
        let mut module = Module { file: file.to_owned(), ..Module::default() };
        let mut words = Vec::new();
        for item in items.iter().filter(|item| !is_test(attributes(item))) {
            match item {
                syn::Item::Use(item) => {
                    let passed_on = !matches!(item.vis, syn::Visibility::Inherited);
                    module.bring(&item.tree, &mut Vec::new(), passed_on);
                }
                syn::Item::Mod(syn::ItemMod { ident, content: Some((_, items)), .. }) => {
                    self.add([path.as_slice(), &[ident.to_string()]].concat(), file, items);
                }
                syn::Item::Mod(_) => {}
                item => {
                    module.items.extend(name(item));
                    flatten(item.to_token_stream(), &mut words);
                }
            }
        }
        paths(&words, &mut module.paths);
        self.modules.insert(path, module);
    }

    /// Returns the files that each file needs.
    pub fn needs(&self) -> BTreeMap<PathBuf, BTreeSet<PathBuf>> {
        let mut needs: BTreeMap<PathBuf, BTreeSet<PathBuf>> = BTreeMap::new();
        for (from, module) in &self.modules {
            let found = needs.entry(module.file.clone()).or_default();
            for path in &module.paths {
                if let Some(Target::Item(file)) = self.resolve(from, path, 0)
                    && file != module.file
                {
                    found.insert(file);
                }
            }
        }
        needs
    }

    /// Follows a path that is written in module `from`; `None` if it leads out of the crate.
    fn resolve(&self, from: &[String], path: &[String], depth: usize) -> Option<Target> {
        // A name may lead back to itself through a glob.
        if depth > 20 {
            return None;
        }
        let (first, rest) = path.split_first()?;
        let here = self.modules.get(from)?;
        match first.as_str() {
            "crate" | "trodden" => self.descend(Vec::new(), rest, depth),
            "self" if !rest.is_empty() => self.descend(from.to_vec(), rest, depth),
            "super" => self.descend(from[..from.len().checked_sub(1)?].to_vec(), rest, depth),
            _ if here.items.contains(first) || here.names.contains_key(first) || self.has(from, first) => {
                self.descend(from.to_vec(), path, depth)
            }
            _ => self.through_globs(from, path, depth),
        }
    }

    fn has(&self, module: &[String], child: &str) -> bool {
        self.modules.contains_key(&[module, &[child.to_owned()]].concat())
    }

    fn descend(&self, module: Vec<String>, path: &[String], depth: usize) -> Option<Target> {
        let Some((first, rest)) = path.split_first() else { return Some(Target::Module(module)) };
        if first == "super" {
            return self.descend(module[..module.len().checked_sub(1)?].to_vec(), rest, depth);
        }
        let here = self.modules.get(&module)?;
        if here.items.contains(first) {
            return Some(Target::Item(here.file.clone()));
        }
        if self.has(&module, first) {
            return self.descend([module.as_slice(), std::slice::from_ref(first)].concat(), rest, depth);
        }
        if let Some(path) = here.names.get(first) {
            return match self.resolve(&module, path, depth + 1)? {
                Target::Module(inner) => self.descend(inner, rest, depth + 1),
                item => Some(item),
            };
        }
        self.through_globs(&module, path, depth)
    }

    fn through_globs(&self, module: &[String], path: &[String], depth: usize) -> Option<Target> {
        let ours = |glob: &&Vec<String>| ["crate", "self", "super"].contains(&glob[0].as_str());
        let mut globs = self.modules[module].globs.iter().filter(ours);
        globs.find_map(|glob| self.resolve(module, &[glob.as_slice(), path].concat(), depth + 1))
    }
}

impl Module {
    /// Notes what a `use` brings; what it passes on is no need of its own.
    fn bring(&mut self, tree: &syn::UseTree, before: &mut Vec<String>, passed_on: bool) {
        match tree {
            syn::UseTree::Path(path) => {
                before.push(path.ident.to_string());
                self.bring(&path.tree, before, passed_on);
                before.pop();
            }
            syn::UseTree::Group(group) => group.items.iter().for_each(|tree| self.bring(tree, before, passed_on)),
            syn::UseTree::Glob(_) => self.globs.push(before.clone()),
            syn::UseTree::Name(name) if name.ident == "self" => {
                let name = before.last().expect("`self` stands in a group").clone();
                self.names.insert(name, before.clone());
            }
            syn::UseTree::Name(name) => self.name(&name.ident, &name.ident, before, passed_on),
            syn::UseTree::Rename(name) => self.name(&name.rename, &name.ident, before, passed_on),
        }
    }

    fn name(&mut self, name: &syn::Ident, original: &syn::Ident, before: &[String], passed_on: bool) {
        let path = [before, &[original.to_string()]].concat();
        if !passed_on {
            self.paths.insert(path.clone());
        }
        self.names.insert(name.to_string(), path);
    }
}

fn attributes(item: &syn::Item) -> &[syn::Attribute] {
    match item {
        syn::Item::Const(item) => &item.attrs,
        syn::Item::Enum(item) => &item.attrs,
        syn::Item::Fn(item) => &item.attrs,
        syn::Item::Impl(item) => &item.attrs,
        syn::Item::Macro(item) => &item.attrs,
        syn::Item::Mod(item) => &item.attrs,
        syn::Item::Static(item) => &item.attrs,
        syn::Item::Struct(item) => &item.attrs,
        syn::Item::Trait(item) => &item.attrs,
        syn::Item::Type(item) => &item.attrs,
        syn::Item::Use(item) => &item.attrs,
        _ => &[],
    }
}

fn name(item: &syn::Item) -> Option<String> {
    let name = match item {
        syn::Item::Const(item) => &item.ident,
        syn::Item::Enum(item) => &item.ident,
        syn::Item::Fn(item) => &item.sig.ident,
        syn::Item::Macro(item) => item.ident.as_ref()?,
        syn::Item::Static(item) => &item.ident,
        syn::Item::Struct(item) => &item.ident,
        syn::Item::Trait(item) => &item.ident,
        syn::Item::Type(item) => &item.ident,
        syn::Item::Union(item) => &item.ident,
        _ => return None,
    };
    Some(name.to_string())
}

/// Collects the paths among words: `a::b::c`, and `a::{b, c::d}` as two.
fn paths(words: &[String], found: &mut BTreeSet<Vec<String>>) {
    let mut at = 0;
    while at < words.len() {
        let follows = at > 0 && [".", "'"].contains(&words[at - 1].as_str());
        at = if is_word(&words[at]) && !follows { path(words, at, &[], found) } else { at + 1 };
    }
}

fn path(words: &[String], mut at: usize, before: &[String], found: &mut BTreeSet<Vec<String>>) -> usize {
    let mut path = before.to_vec();
    loop {
        path.push(words[at].clone());
        at += 1;
        let colons = words.get(at).is_some_and(|w| w == ":") && words.get(at + 1).is_some_and(|w| w == ":");
        match words.get(at + 2) {
            Some(word) if colons && is_word(word) => at += 2,
            Some(word) if colons && word == "{" => {
                at += 3;
                while words.get(at).is_some_and(|word| word != "}") {
                    at = if is_word(&words[at]) { self::path(words, at, &path, found) } else { at + 1 };
                }
                return at;
            }
            _ => break,
        }
    }
    found.insert(path);
    at
}

fn is_word(word: &str) -> bool {
    word.starts_with(|first: char| first.is_alphabetic() || first == '_')
}

/// Returns the sets of files that need each other, directly or through others, each sorted.
pub fn circles(needs: &BTreeMap<PathBuf, BTreeSet<PathBuf>>) -> Vec<Vec<PathBuf>> {
    let reached: BTreeMap<&PathBuf, BTreeSet<&PathBuf>> =
        needs.keys().map(|file| (file, reached(needs, file))).collect();
    let mut found = BTreeSet::new();
    for (file, from_it) in &reached {
        if from_it.contains(*file) {
            let back = |other: &&&PathBuf| reached.get(**other).is_some_and(|them| them.contains(*file));
            found.insert(from_it.iter().filter(back).map(|other| (*other).clone()).collect());
        }
    }
    found.into_iter().collect()
}

fn reached<'a>(needs: &'a BTreeMap<PathBuf, BTreeSet<PathBuf>>, start: &'a PathBuf) -> BTreeSet<&'a PathBuf> {
    let (mut seen, mut open) = (BTreeSet::new(), vec![start]);
    while let Some(file) = open.pop() {
        open.extend(needs.get(file).into_iter().flatten().filter(|next| seen.insert(*next)));
    }
    seen
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns what each file of a small crate needs, and its circles.
    fn check(sources: &[(&str, &str)], needs: &[(&str, &[&str])], circle: &[&str]) {
        let mut all = Sources::default();
        all.add_file(Path::new("lib.rs"), "");
        for (file, source) in sources {
            all.add_file(Path::new(file), source);
        }
        let found = all.needs();
        let paths = |names: &[&str]| names.iter().map(PathBuf::from).collect::<Vec<_>>();
        for (file, expected) in needs {
            assert_eq!(found[Path::new(file)].iter().cloned().collect::<Vec<_>>(), paths(expected), "{file}");
        }
        let expected: Vec<_> = if circle.is_empty() { Vec::new() } else { vec![paths(circle)] };
        assert_eq!(circles(&found), expected);
    }

    #[test]
    fn a_parent_that_passes_names_on_is_no_part_of_a_circle() {
        check(
            &[
                ("a/mod.rs", "mod b; mod c; pub use b::B; pub use c::C;"),
                ("a/b.rs", "use super::C; pub struct B(C);"),
                ("a/c.rs", "pub struct C;"),
            ],
            &[("a/mod.rs", &[]), ("a/b.rs", &["a/c.rs"])],
            &[],
        );
    }

    #[test]
    fn a_parent_that_uses_what_it_passes_on_is() {
        check(
            &[
                ("a/mod.rs", "mod b; pub use b::B; pub enum Error { At(B) }"),
                ("a/b.rs", "pub struct B; impl B { fn f() -> Result<(), super::Error> {} }"),
            ],
            &[("a/mod.rs", &["a/b.rs"])],
            &["a/b.rs", "a/mod.rs"],
        );
    }

    #[test]
    fn circles_go_through_groups_renames_globs_macros_and_parts_of_files() {
        check(
            &[
                ("b.rs", "use crate::{c::{self, f as g}, d::*}; pub fn h() { c::deep(); g(); k() }"),
                ("c.rs", "pub fn f() {} pub fn deep() { call!(crate::d::inner::X) }"),
                ("d.rs", "pub mod inner { pub const X: u8 = super::super::e::Y; } pub fn k() {}"),
                ("e.rs", "use crate::b::h; pub const Y: u8 = 1;"),
            ],
            &[("b.rs", &["c.rs", "d.rs"]), ("c.rs", &["d.rs"]), ("d.rs", &["e.rs"]), ("e.rs", &["b.rs"])],
            &["b.rs", "c.rs", "d.rs", "e.rs"],
        );
    }

    #[test]
    fn tests_and_other_crates_do_not_count() {
        check(
            &[
                ("b.rs", "use std::fmt; use c::Y; pub struct Z; #[cfg(test)] mod tests { use crate::c::Y; }"),
                ("c.rs", "use crate::b::Z; pub struct Y; #[cfg(test)] impl Y { fn f() { crate::d::g() } }"),
                ("d.rs", "pub fn g() {}"),
            ],
            &[("b.rs", &[]), ("c.rs", &["b.rs"])],
            &[],
        );
    }
}

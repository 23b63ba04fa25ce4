//! A lineage as a graph, for Graphviz and for Mermaid.

use std::fmt::Write;

use super::fold::View;
use crate::report::plain::one_line;
use crate::store::Digest;

/// A box of the graph: an artifact, or a file outside of the store.
struct Node {
    lines: Vec<String>,
    is_file: bool,
}

/// An arrow from what is read to what was made of it.
struct Arrow {
    from: usize,
    to: usize,
    name: String,
}

/// Writes a lineage in Graphviz's language.
#[must_use]
pub fn dot(view: &View<'_>) -> String {
    let (nodes, arrows) = parts(view);
    let quoted = |text: &str| text.replace('\\', "\\\\").replace('"', "\\\"");
    let mut text = String::from("digraph lineage {\n  rankdir=LR;\n  node [shape=box, fontname=\"sans-serif\"];\n");
    for (number, node) in nodes.iter().enumerate() {
        let lines: Vec<String> = node.lines.iter().map(|line| quoted(line)).collect();
        let shape = if node.is_file { ", shape=note" } else { "" };
        let _ = writeln!(text, "  n{number} [label=\"{}\"{shape}];", lines.join("\\n"));
    }
    for Arrow { from, to, name } in &arrows {
        let _ = writeln!(text, "  n{from} -> n{to} [label=\"{}\"];", quoted(name));
    }
    text.push('}');
    text
}

/// Writes a lineage in Mermaid's language.
#[must_use]
pub fn mermaid(view: &View<'_>) -> String {
    let (nodes, arrows) = parts(view);
    // Its texts are read as Markdown and HTML unless such signs go by their numbers.
    let quoted = |text: &str| {
        text.chars().fold(String::new(), |mut out, letter| {
            if letter.is_alphanumeric() || " ./-_:,()…".contains(letter) {
                out.push(letter);
            } else {
                let _ = write!(out, "#{};", u32::from(letter));
            }
            out
        })
    };
    let mut text = String::from("flowchart LR");
    for (number, node) in nodes.iter().enumerate() {
        let lines: Vec<String> = node.lines.iter().map(|line| quoted(line)).collect();
        let (open, close) = if node.is_file { ("([", "])") } else { ("[", "]") };
        let _ = write!(text, "\n  n{number}{open}\"{}\"{close}", lines.join("<br/>"));
    }
    for Arrow { from, to, name } in &arrows {
        let _ = write!(text, "\n  n{from} -->|\"{}\"| n{to}", quoted(name));
    }
    text
}

fn parts(view: &View<'_>) -> (Vec<Node>, Vec<Arrow>) {
    let mut nodes: Vec<Node> = (0..view.made.len()).map(|at| artifact(view, at)).collect();
    let mut arrows = Vec::new();
    let mut files: Vec<(Option<&str>, Digest, usize)> = Vec::new();
    for (to, made) in view.made.iter().enumerate() {
        let name = |port: &str, member: Option<&String>| {
            let member = member.map_or_else(String::new, |member| format!(" {}", one_line(member)));
            format!("{port}{member}")
        };
        let reads = made.reads.iter();
        arrows.extend(reads.map(|read| Arrow { from: read.step, to, name: name(&read.port, read.member.as_ref()) }));
        for file in view.sources(to) {
            let path = file.path.as_deref();
            let known = files.iter().find(|(other, digest, _)| *other == path && *digest == file.digest);
            let from = known.map_or(nodes.len(), |(.., number)| *number);
            if from == nodes.len() {
                let path = one_line(path.unwrap_or("a file, its path is not on record")).into_owned();
                nodes.push(Node { lines: vec![path, file.digest.to_string()], is_file: true });
                files.push((file.path.as_deref(), file.digest, from));
            }
            arrows.push(Arrow { from, to, name: file.role.clone() });
        }
    }
    (nodes, arrows)
}

fn artifact(view: &View<'_>, at: usize) -> Node {
    let (head, mut lines) = (view.head(at), vec![one_line(&view.name(at)).into_owned()]);
    match &head.recipe {
        Some(recipe) => lines.push(format!("{} version {} → {}", recipe.stage, recipe.version, recipe.kind)),
        None => lines.push("not on record".to_owned()),
    }
    match view.parts(at) {
        Some(parts) => lines.push(parts),
        None => lines.push(head.digest.to_string()),
    }
    Node { lines, is_file: false }
}

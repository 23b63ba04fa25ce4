//! Names nodes and their parts: what a name consists of is data, and its text is only put together.

use std::borrow::Borrow;
use std::fmt;
use std::ops::Deref;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

/// The name of a node, or of a part of one: `model`, `labels/home_03`, `walks/home_03/chunk-02`, `model/epoch-07`.
///
/// It compares and sorts as its text. Records and events hold the text with the member and the number of the part beside
/// it, as neither can be told from the text alone.
#[derive(Clone, Serialize, Deserialize)]
#[serde(from = "Fields", into = "Fields")]
pub struct NodeName {
    text: Arc<str>,
    /// Where the stage's name ends.
    stage: usize,
    /// Where the node's name ends: with the member, if there is one.
    node: usize,
    part: Option<NodePart>,
}

/// Stands between the name of a stage and what tells its variants apart.
pub const VARIANT: char = '@';

/// What a node is to the pipeline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// One that the pipeline's file names.
    Node,
    /// An independent part of one.
    Chunk,
    /// A step of one; the node's artifact is that of the last step. Records and JSON call it as the first version did.
    #[serde(rename = "epoch")]
    Step,
}

/// A part of a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NodePart {
    /// An independent part, counted from 0.
    Chunk(u32),
    /// A step, counted from 1.
    Step(u32),
}

impl fmt::Display for NodePart {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Chunk(number) => write!(formatter, "chunk-{number:02}"),
            Self::Step(number) => write!(formatter, "step-{number:02}"),
        }
    }
}

impl NodePart {
    /// Reads what the first format of records called the parts of nodes.
    fn parse(text: &str) -> Option<Self> {
        let (kind, digits) = text.split_once('-')?;
        let number = digits.parse().ok()?;
        let part = match kind {
            "chunk" => Self::Chunk(number),
            "epoch" => Self::Step(number),
            _ => return None,
        };
        (format!("{kind}-{number:02}") == text).then_some(part)
    }
}

impl NodeName {
    /// Names the node of a use of a stage, or that of one member of the group that it is made for. What tells variants apart
    /// may stand behind the name of the use, after [`VARIANT`].
    #[must_use]
    pub fn new(stage: &str, member: Option<&str>) -> Self {
        let text: Arc<str> = match member {
            Some(member) => Arc::from(format!("{stage}/{member}")),
            None => Arc::from(stage),
        };
        Self { stage: stage.len(), node: text.len(), text, part: None }
    }

    /// Names a part of this node.
    #[must_use]
    pub fn part_of(&self, part: NodePart) -> Self {
        self.called(&part.to_string(), part)
    }

    /// Names a step of this node by a word of its own: `model/epoch-07`.
    #[must_use]
    pub fn step_of(&self, word: &str, number: u32) -> Self {
        self.called(&format!("{word}-{number:02}"), NodePart::Step(number))
    }

    fn called(&self, own: &str, part: NodePart) -> Self {
        let node = self.node();
        Self { text: Arc::from(format!("{node}/{own}")), stage: self.stage, node: node.len(), part: Some(part) }
    }

    /// Returns the whole name.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.text
    }

    /// Returns the name that the pipeline's file gives the use of the stage: `walks`.
    #[must_use]
    pub fn stage(&self) -> &str {
        let whole = &self.text[..self.stage];
        whole.split_once(VARIANT).map_or(whole, |(stage, _)| stage)
    }

    /// Returns what tells it from the same node of other variants: `classes=4` of `labels@classes=4/home_03`.
    #[must_use]
    pub fn variant(&self) -> Option<&str> {
        self.text[..self.stage].split_once(VARIANT).map(|(_, variant)| variant)
    }

    /// Returns the name of the member that the node is made for: `home_03`.
    #[must_use]
    pub fn member(&self) -> Option<&str> {
        (self.node > self.stage).then(|| &self.text[self.stage + 1..self.node])
    }

    /// Returns the name without the part: `walks/home_03`.
    #[must_use]
    pub fn node(&self) -> &str {
        &self.text[..self.node]
    }

    /// Returns the part, if it is the name of one.
    #[must_use]
    pub const fn part(&self) -> Option<NodePart> {
        self.part
    }

    /// Returns what the part is called, if it is the name of one: `epoch-07`.
    #[must_use]
    pub fn own(&self) -> Option<&str> {
        self.part.map(|_| self.text[self.node..].trim_start_matches('/'))
    }

    /// Returns the number of the step, if it is the name of one.
    #[must_use]
    pub const fn step(&self) -> Option<u32> {
        match self.part {
            Some(NodePart::Step(number)) => Some(number),
            _ => None,
        }
    }

    /// Returns what it is the name of.
    #[must_use]
    pub const fn role(&self) -> Role {
        match self.part {
            None => Role::Node,
            Some(NodePart::Chunk(_)) => Role::Chunk,
            Some(NodePart::Step(_)) => Role::Step,
        }
    }

    /// Tells whether a name given by a user means it: its own, that of its node, or that of its stage.
    #[must_use]
    pub fn is_meant_by(&self, name: &str) -> bool {
        self.is_meant_where(|text| name == text)
    }

    /// Tells whether something holds of it, of its node, of its stage, or of that with what tells variants apart.
    #[must_use]
    pub fn is_meant_where(&self, holds: impl Fn(&str) -> bool) -> bool {
        holds(self.as_str()) || holds(self.node()) || holds(self.stage()) || holds(&self.text[..self.stage])
    }
}

/// A name as JSON has it; the first format had the text alone.
#[derive(Serialize, Deserialize)]
struct Fields {
    node: Arc<str>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    member: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    chunk: Option<u32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    step: Option<u32>,
}

impl From<NodeName> for Fields {
    fn from(name: NodeName) -> Self {
        let (chunk, step) = match name.part {
            Some(NodePart::Chunk(number)) => (Some(number), None),
            Some(NodePart::Step(number)) => (None, Some(number)),
            None => (None, None),
        };
        Self { member: name.member().map(str::to_owned), chunk, step, node: name.text }
    }
}

impl From<Fields> for NodeName {
    fn from(fields: Fields) -> Self {
        let part = fields.chunk.map(NodePart::Chunk).or(fields.step.map(NodePart::Step));
        if part.is_none() && fields.member.is_none() {
            return Self::from(&*fields.node);
        }
        let strip = |text: usize, end: &str| {
            let rest = fields.node[..text].strip_suffix(end).and_then(|rest| rest.strip_suffix('/'));
            rest.map_or(text, str::len)
        };
        // What a part is called has no slash; a step may be called by any word.
        let whole = fields.node.len();
        let node = part.and_then(|_| fields.node.rfind('/')).unwrap_or(whole);
        let stage = fields.member.as_deref().map_or(node, |member| strip(node, member));
        Self { stage, node, part, text: fields.node }
    }
}

impl From<&str> for NodeName {
    /// Reads a text alone, as records of the first format have it: a last word that could name a part does.
    fn from(text: &str) -> Self {
        let (node, part) = match text.rsplit_once('/').and_then(|(node, last)| Some((node, NodePart::parse(last)?))) {
            Some((node, part)) => (node, Some(part)),
            None => (text, None),
        };
        let stage = node.find('/').unwrap_or(node.len());
        Self { stage, node: node.len(), part, text: Arc::from(text) }
    }
}

impl Deref for NodeName {
    type Target = str;

    fn deref(&self) -> &str {
        &self.text
    }
}

impl Borrow<str> for NodeName {
    fn borrow(&self) -> &str {
        &self.text
    }
}

impl fmt::Display for NodeName {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.pad(&self.text)
    }
}

impl fmt::Debug for NodeName {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&self.text, formatter)
    }
}

impl PartialEq for NodeName {
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text
    }
}

impl Eq for NodeName {}

impl PartialOrd for NodeName {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for NodeName {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.text.cmp(&other.text)
    }
}

impl PartialEq<str> for NodeName {
    fn eq(&self, other: &str) -> bool {
        &*self.text == other
    }
}

impl PartialEq<&str> for NodeName {
    fn eq(&self, other: &&str) -> bool {
        &*self.text == *other
    }
}

impl PartialEq<String> for NodeName {
    fn eq(&self, other: &String) -> bool {
        *self.text == **other
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks the pieces of a name, and that JSON keeps them.
    fn check(name: &NodeName, text: &str, pieces: (&str, Option<&str>, Option<NodePart>)) {
        let json = serde_json::to_string(name).expect("is JSON");
        let read: NodeName = serde_json::from_str(&json).expect("is a name");
        for name in [name, &read] {
            assert_eq!(name.as_str(), text);
            assert_eq!((name.stage(), name.member(), name.part()), pieces, "{json}");
        }
    }

    #[test]
    fn names_keep_their_pieces() {
        let walks = NodeName::new("walks", Some("home_03"));
        let model = NodeName::new("model", None);
        check(&walks, "walks/home_03", ("walks", Some("home_03"), None));
        check(&model, "model", ("model", None, None));
        let chunk = walks.part_of(NodePart::Chunk(2));
        check(&chunk, "walks/home_03/chunk-02", ("walks", Some("home_03"), Some(NodePart::Chunk(2))));
        let step = model.step_of("epoch", 107);
        check(&step, "model/epoch-107", ("model", None, Some(NodePart::Step(107))));
        assert_eq!((step.node(), step.step(), step.role()), ("model", Some(107), Role::Step));
        assert_eq!((step.own(), chunk.own(), walks.own()), (Some("epoch-107"), Some("chunk-02"), None));
        assert_eq!(chunk.part_of(NodePart::Chunk(3)).as_str(), "walks/home_03/chunk-03");
        let variant = NodeName::new("labels@classes=4", Some("home_03"));
        check(&variant, "labels@classes=4/home_03", ("labels", Some("home_03"), None));
        assert_eq!((variant.variant(), walks.variant()), (Some("classes=4"), None));
        assert!(["labels", "labels@classes=4"].into_iter().all(|meant| variant.is_meant_by(meant)));
        // A map may be called like a part.
        let odd = NodeName::new("labels", Some("epoch-07"));
        check(&odd, "labels/epoch-07", ("labels", Some("epoch-07"), None));
        check(&model.part_of(NodePart::Step(7)), "model/step-07", ("model", None, Some(NodePart::Step(7))));
        check(
            &odd.step_of("epoch", 7),
            "labels/epoch-07/epoch-07",
            ("labels", Some("epoch-07"), Some(NodePart::Step(7))),
        );
    }

    #[test]
    fn names_of_the_first_format_are_texts() {
        let check = |text: &str, pieces: (&str, Option<&str>, Option<NodePart>)| {
            let read: NodeName = serde_json::from_value(serde_json::json!({ "node": text })).expect("is a name");
            assert_eq!((read.as_str(), (read.stage(), read.member(), read.part())), (text, pieces));
        };
        check("model", ("model", None, None));
        check("model/epoch-07", ("model", None, Some(NodePart::Step(7))));
        check("labels/home_03", ("labels", Some("home_03"), None));
        check("walks/home_03/chunk-102", ("walks", Some("home_03"), Some(NodePart::Chunk(102))));
        check("walks/chunk-x", ("walks", Some("chunk-x"), None));
        check("walks/chunk-3", ("walks", Some("chunk-3"), None));
    }

    #[test]
    fn users_mean_parts_nodes_and_stages() {
        let name = NodeName::new("walks", Some("home_0")).part_of(NodePart::Chunk(1));
        let meant = ["walks", "walks/home_0", "walks/home_0/chunk-01"];
        assert!(meant.into_iter().all(|meant| name.is_meant_by(meant)));
        let others = ["", "walk", "walks/", "walks/home_", "walks/home_0/chunk-0", "home_0", "model"];
        assert!(!others.into_iter().any(|other| name.is_meant_by(other)));
    }
}

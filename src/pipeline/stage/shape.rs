//! What a stage looks like from outside: verb, ports, and the kind of what comes out.

use std::borrow::Cow;

/// An artifact kind as the pipeline sees it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KindSpec {
    /// Name, such as `VisitCounts`.
    pub name: Cow<'static, str>,
    /// Number of the format; it changes when the bytes of equal values change.
    pub format: u32,
    /// Ending of the file that people see, or of each part of a bundle; empty if the parts' names carry their own.
    pub extension: Cow<'static, str>,
    /// Whether artifacts are so large that they stay where they were made, unless something elsewhere reads them.
    pub bulky: bool,
}

impl KindSpec {
    /// Names a kind, its format and the ending of its files.
    #[must_use]
    pub const fn new(name: &'static str, format: u32, extension: &'static str) -> Self {
        Self { name: Cow::Borrowed(name), format, extension: Cow::Borrowed(extension), bulky: false }
    }

    /// Says whether artifacts are so large that they stay where they were made.
    #[must_use]
    pub const fn bulky(mut self, bulky: bool) -> Self {
        self.bulky = bulky;
        self
    }
}

/// How many artifacts a port takes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Arity {
    /// One artifact. A group connected to it maps the stage over the group's members.
    One,
    /// One artifact or none: the port may be left out. Otherwise as [`Arity::One`].
    Optional,
    /// All members of a group at once.
    Group,
    /// All members of a group at once, or nothing: the port may be left out.
    OptionalGroup,
    /// As [`Arity::Group`], in the place of the port named: exactly one of both is connected.
    GroupOr(Cow<'static, str>),
}

impl Arity {
    /// [`Arity::GroupOr`] of a port.
    #[must_use]
    pub const fn group_or(port: &'static str) -> Self {
        Self::GroupOr(Cow::Borrowed(port))
    }

    /// Returns whether the port takes a whole group at once.
    #[must_use]
    pub const fn takes_group(&self) -> bool {
        matches!(self, Self::Group | Self::OptionalGroup | Self::GroupOr(_))
    }
}

/// A typed input.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Port {
    /// Name of the port.
    pub name: Cow<'static, str>,
    /// Name of the kind that the port takes; [`Port::ANY`] if it takes them all.
    pub kind: Cow<'static, str>,
    /// How many artifacts it takes.
    pub arity: Arity,
    /// One sentence for the JSON Schema.
    pub doc: Cow<'static, str>,
}

impl Port {
    /// The kind of a port that takes artifacts of every kind.
    pub const ANY: &'static str = "any kind";

    /// Names a port, the kind that it takes, how many of it, and what for.
    #[must_use]
    pub const fn new(name: &'static str, kind: &'static str, arity: Arity, doc: &'static str) -> Self {
        Self { name: Cow::Borrowed(name), kind: Cow::Borrowed(kind), arity, doc: Cow::Borrowed(doc) }
    }

    /// Returns whether the port takes artifacts of a kind.
    #[must_use]
    pub fn takes(&self, kind: &str) -> bool {
        self.kind == Self::ANY || self.kind == kind
    }
}

/// What is the same for every use of a stage.
#[derive(Debug, Clone)]
pub struct StageSpec {
    /// The verb, such as `rasterize`.
    pub name: Cow<'static, str>,
    /// Rises when the same inputs give other bytes.
    pub version: u32,
    /// The inputs.
    pub ports: Vec<Port>,
    /// The kind of what comes out.
    pub output: KindSpec,
    /// Whether it draws random numbers: then a seed enters the recipe, and a use may name one of its own.
    pub seeded: bool,
    /// Whether its uses name their inputs themselves, under `inputs:`; [`Stage::own_spec`](super::Stage::own_spec) then says what a use is.
    pub open: bool,
    /// One sentence for the JSON Schema and the help.
    pub doc: Cow<'static, str>,
}

impl StageSpec {
    /// Describes a stage: verb, version, inputs, what comes out, and what it is for in a sentence.
    #[must_use]
    pub fn new(name: &'static str, version: u32, ports: Vec<Port>, output: KindSpec, doc: &'static str) -> Self {
        let (name, doc) = (Cow::Borrowed(name), Cow::Borrowed(doc));
        Self { name, version, ports, output, seeded: false, open: false, doc }
    }

    /// As [`StageSpec::new`], for a stage that draws random numbers.
    #[must_use]
    pub fn seeded(name: &'static str, version: u32, ports: Vec<Port>, output: KindSpec, doc: &'static str) -> Self {
        Self { seeded: true, ..Self::new(name, version, ports, output, doc) }
    }
}

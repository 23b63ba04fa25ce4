//! Tells the nodes of variants apart by what is set in theirs: `labels@classes=4/home_00`.
//!
//! A node has in its name what varies in the use of its stage or in a use that it reads, at first or second hand. What varies
//! in a section, such as the number of maps, is in a name only where it is needed: the maps that two variants share are the
//! same nodes.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::declare::Use;
use super::reference::Target;

/// Which axes change which uses and sections, and what the values of one variant are called.
#[derive(Debug, Clone, Default)]
pub(super) struct Labels {
    /// By the name of a use, or the key of a section after a dollar sign: the axes that change it directly.
    pub direct: BTreeMap<String, BTreeSet<usize>>,
    /// Axes that change the seed of all that have none of their own.
    pub seeds: BTreeSet<usize>,
    /// `classes=4` for each axis.
    pub values: Vec<String>,
}

/// What a node's name has.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Marks {
    /// What varies in its use and those that it reads.
    pub own: String,
    /// With what varies in the sections that it reads.
    pub all: String,
}

impl Labels {
    pub(super) const fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Returns the marks of all uses and sections; `order` has the uses so that each stands after those that it reads.
    pub(super) fn mark(&self, stages: &[Arc<Use>], order: &[usize]) -> BTreeMap<String, Marks> {
        let mut marks = BTreeMap::new();
        if self.is_empty() {
            return marks;
        }
        let none = BTreeSet::new();
        let mut axes: BTreeMap<String, (BTreeSet<usize>, BTreeSet<usize>)> = BTreeMap::new();
        for (key, direct) in self.direct.iter().filter(|(key, _)| key.starts_with('$')) {
            axes.insert(key.clone(), (BTreeSet::new(), direct.union(&self.seeds).copied().collect()));
        }
        for index in order {
            let stage = &stages[*index];
            let mut own = self.direct.get(&stage.name).unwrap_or(&none).clone();
            if stage.spec.seeded && stage.seed.is_none() {
                own.extend(&self.seeds);
            }
            let mut all = own.clone();
            for (_, reference) in &stage.ports {
                let key = match &reference.target {
                    Target::Section(key) => format!("${key}"),
                    Target::Stage(name) => name.clone(),
                };
                if let Some((more_own, more)) = axes.get(&key) {
                    own.extend(more_own);
                    all.extend(more);
                }
            }
            all.extend(&own);
            axes.insert(stage.name.clone(), (own, all));
        }
        let text =
            |axes: &BTreeSet<usize>| axes.iter().map(|axis| self.values[*axis].as_str()).collect::<Vec<_>>().join(",");
        for (key, (own, all)) in axes {
            marks.insert(key, Marks { own: text(&own), all: text(&all) });
        }
        marks
    }
}

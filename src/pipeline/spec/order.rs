//! Orders the uses of stages by what they read, and finds cycles.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::declare::Use;
use super::reference::{Reference, Target};
use super::suggest;
use crate::pipeline::error::{MOST_SHOWN, Problem};
use crate::pipeline::stage::Section;

/// Returns the uses so that each stands after those that it refers to, otherwise in order of the file.
pub(super) fn order(stages: &[Arc<Use>], sections: &[Section]) -> Result<Vec<usize>, Vec<Problem>> {
    let mut problems = Vec::new();
    let names: BTreeMap<&str, usize> =
        stages.iter().enumerate().map(|(index, stage)| (stage.name.as_str(), index)).collect();
    let mut reads = vec![Vec::new(); stages.len()];
    for (index, stage) in stages.iter().enumerate() {
        for (_, reference) in &stage.ports {
            let Target::Stage(name) = &reference.target else { continue };
            match names.get(name.as_str()) {
                Some(target) => reads[index].push((*target, reference)),
                // A guess looks at all names, and what is beyond the first problems is not shown.
                None if problems.len() < MOST_SHOWN => problems.push(unknown_stage(name, reference, stages, sections)),
                None => problems.push(Problem::new(reference.span, format!("the pipeline has no stage `{name}`"))),
            }
        }
    }
    if !problems.is_empty() {
        return Err(problems);
    }
    let mut search =
        Search { stages, reads: &reads, state: vec![State::New; stages.len()], path: Vec::new(), done: Vec::new() };
    for index in 0..stages.len() {
        search.visit(index).map_err(|problem| vec![problem])?;
    }
    Ok(search.done)
}

fn unknown_stage(name: &str, reference: &Reference, stages: &[Arc<Use>], sections: &[Section]) -> Problem {
    let problem = Problem::new(reference.span, format!("the pipeline has no stage `{name}`"));
    if sections.iter().any(|section| section.key == name) {
        return problem.with_help(format!("did you mean `${name}`?"));
    }
    problem.with_help_from(suggest::help(name, stages.iter().map(|stage| stage.name.as_str())))
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum State {
    New,
    Open,
    Done,
}

/// A depth-first search that remembers its path, to name a cycle.
struct Search<'a> {
    stages: &'a [Arc<Use>],
    reads: &'a [Vec<(usize, &'a Reference)>],
    state: Vec<State>,
    /// The open uses, each with how many of those that it reads were looked at.
    path: Vec<(usize, usize)>,
    done: Vec<usize>,
}

impl Search<'_> {
    /// Visits a use and all that it reads at first or second hand. A chain of uses may be long: the path is a list, not
    /// calls within calls.
    fn visit(&mut self, index: usize) -> Result<(), Problem> {
        if self.state[index] != State::Done {
            self.open(index);
        }
        while let Some((here, next)) = self.path.last_mut() {
            let here = *here;
            let Some((target, reference)) = self.reads[here].get(*next) else {
                self.path.pop();
                self.state[here] = State::Done;
                self.done.push(here);
                continue;
            };
            *next += 1;
            match self.state[*target] {
                State::New => self.open(*target),
                State::Open => return Err(self.cycle(*target, reference)),
                State::Done => {}
            }
        }
        Ok(())
    }

    fn open(&mut self, index: usize) {
        self.state[index] = State::Open;
        self.path.push((index, 0));
    }

    fn cycle(&self, target: usize, reference: &Reference) -> Problem {
        let start = self.path.iter().position(|(index, _)| *index == target).expect("an open stage is on the path");
        let cycle = self.path[start..].iter().map(|(index, _)| *index).chain([target]);
        let chain: Vec<String> = cycle.map(|index| format!("`{}`", self.stages[index].name)).collect();
        if chain.len() == 2 {
            return Problem::new(reference.span, format!("{} reads itself", chain[0]));
        }
        Problem::new(reference.span, "stages read each other in a cycle")
            .with_label("this closes the cycle")
            .with_context(self.stages[target].name_span, "it starts here")
            .with_help(format!("each of these reads the next: {}", chain.join(" → ")))
    }
}

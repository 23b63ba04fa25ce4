//! Cuts what is to be made into units: what one worker does in one go.
//!
//! A task joins what it reads as long as the whole stays short; so the map, the crowds and the counts of a building are one
//! piece of work, and nothing of it goes over to another machine. What reads several such pieces, and would be too long with
//! all of them, waits for the next wave, and so does what would make one too long. A chain of steps is never cut. Small
//! pieces of a wave are put together until they are long enough to be worth a start.

use std::collections::{BTreeMap, BTreeSet};

/// A task that is to be made.
#[derive(Debug, Clone, PartialEq)]
pub struct Piece {
    /// How long it takes, as far as that is foreseen.
    pub seconds: f64,
    /// What it reads, as positions, each before its own.
    pub inputs: Vec<usize>,
    /// The step before, which it stays with.
    pub follows: Option<usize>,
    /// Whether it wants a GPU.
    pub gpu: bool,
}

/// What one worker does in one go.
#[derive(Debug, Clone, PartialEq)]
pub struct CutUnit {
    /// It needs results of earlier waves only.
    pub wave: usize,
    /// The tasks, as positions, in order.
    pub tasks: Vec<usize>,
    /// How long they take together.
    pub seconds: f64,
    /// Whether they want a GPU.
    pub gpu: bool,
    /// The units whose results it reads, in order.
    pub needs: Vec<usize>,
}

/// Tasks that belong together.
#[derive(Debug, Clone, Copy)]
struct Group {
    wave: usize,
    seconds: f64,
    gpu: bool,
}

/// Groups that are joined more and more.
#[derive(Default)]
struct Groups {
    groups: Vec<Group>,
    parents: Vec<usize>,
}

impl Groups {
    fn add(&mut self, group: Group) -> usize {
        self.groups.push(group);
        self.parents.push(self.parents.len());
        self.parents.len() - 1
    }

    fn find(&mut self, mut group: usize) -> usize {
        while self.parents[group] != group {
            self.parents[group] = self.parents[self.parents[group]];
            group = self.parents[group];
        }
        group
    }

    /// Joins groups of one wave.
    fn join(&mut self, groups: &[usize]) -> usize {
        let first = groups[0];
        for group in &groups[1..] {
            self.parents[*group] = first;
            self.groups[first].seconds += self.groups[*group].seconds;
        }
        first
    }
}

/// Cuts tasks into units of about so many seconds, waves in order; `None` stands for a task that is not to be made.
#[must_use]
pub fn cut(tasks: &[Option<Piece>], target_s: f64) -> Vec<CutUnit> {
    let mut groups = Groups::default();
    let mut group_of: Vec<Option<usize>> = vec![None; tasks.len()];
    for (position, task) in tasks.iter().enumerate() {
        let Some(piece) = task else { continue };
        let read: BTreeSet<usize> =
            piece.inputs.iter().filter_map(|input| group_of[*input]).map(|group| groups.find(group)).collect();
        let last = read.iter().map(|group| groups.groups[*group].wave).max();
        let newest: Vec<usize> =
            read.iter().copied().filter(|group| Some(groups.groups[*group].wave) == last).collect();
        let alike = newest.iter().all(|group| groups.groups[*group].gpu == piece.gpu);
        let seconds = piece.seconds + newest.iter().map(|group| groups.groups[*group].seconds).sum::<f64>();
        let stays = piece.follows.is_some_and(|step| group_of[step].is_some());
        let group = if !newest.is_empty() && (stays || (alike && seconds <= target_s)) {
            let group = groups.join(&newest);
            groups.groups[group].seconds += piece.seconds;
            group
        } else {
            groups.add(Group { wave: last.map_or(0, |wave| wave + 1), seconds: piece.seconds, gpu: piece.gpu })
        };
        group_of[position] = Some(group);
    }
    pack(tasks, &mut groups, &group_of, target_s)
}

/// Puts groups of one wave together to units.
fn pack(tasks: &[Option<Piece>], groups: &mut Groups, group_of: &[Option<usize>], target_s: f64) -> Vec<CutUnit> {
    let mut members: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    let mut order: Vec<usize> = Vec::new();
    for (position, group) in group_of.iter().enumerate() {
        let Some(group) = group.map(|group| groups.find(group)) else { continue };
        let tasks = members.entry(group).or_default();
        if tasks.is_empty() {
            order.push(group);
        }
        tasks.push(position);
    }
    order.sort_by_key(|group| groups.groups[*group].wave);
    let mut units: Vec<CutUnit> = Vec::new();
    // The unit of each wave, with a GPU and without, that may take more.
    let mut open: BTreeMap<(usize, bool), usize> = BTreeMap::new();
    for group in order {
        let (Group { wave, seconds, gpu }, tasks) = (groups.groups[group], &members[&group]);
        match open.get(&(wave, gpu)) {
            Some(unit) if units[*unit].seconds + seconds <= target_s => {
                units[*unit].seconds += seconds;
                units[*unit].tasks.extend(tasks);
            }
            _ => {
                open.insert((wave, gpu), units.len());
                units.push(CutUnit { wave, tasks: tasks.clone(), seconds, gpu, needs: Vec::new() });
            }
        }
    }
    let mut unit_of = vec![None; tasks.len()];
    for (number, unit) in units.iter_mut().enumerate() {
        unit.tasks.sort_unstable();
        unit.tasks.iter().for_each(|task| unit_of[*task] = Some(number));
    }
    for (number, unit) in units.iter_mut().enumerate() {
        let read = unit.tasks.iter().filter_map(|task| tasks[*task].as_ref()).flat_map(|piece| &piece.inputs);
        let needs: BTreeSet<usize> = read.filter_map(|input| unit_of[*input]).filter(|need| *need != number).collect();
        unit.needs = needs.into_iter().collect();
    }
    units
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(seconds: f64, inputs: &[usize]) -> Option<Piece> {
        Some(Piece { seconds, inputs: inputs.to_vec(), follows: None, gpu: false })
    }

    /// Holds waves, tasks and needs of the units against what is expected.
    fn check(tasks: &[Option<Piece>], target_s: f64, expected: &[(usize, &[usize], &[usize])]) {
        let units = cut(tasks, target_s);
        let found: Vec<(usize, &[usize], &[usize])> =
            units.iter().map(|unit| (unit.wave, &*unit.tasks, &*unit.needs)).collect();
        assert_eq!(found, expected);
        for (number, unit) in units.iter().enumerate() {
            assert!(
                unit.needs.iter().all(|need| units[*need].wave < unit.wave),
                "unit {number} waits for its own wave"
            );
        }
    }

    #[test]
    fn what_belongs_to_one_map_stays_together() {
        // Two maps with crowds and counts, a training over both, and a prediction for each.
        let tasks = [
            piece(1.0, &[]),
            piece(1.0, &[]),
            piece(5.0, &[0]),
            piece(5.0, &[1]),
            piece(1.0, &[0, 2]),
            piece(1.0, &[1, 3]),
            piece(9.0, &[4, 5]),
            piece(6.0, &[6, 0]),
            piece(6.0, &[6, 1]),
        ];
        let units: [(usize, &[usize], &[usize]); 5] =
            [(0, &[0, 2, 4], &[]), (0, &[1, 3, 5], &[]), (1, &[6], &[0, 1]), (2, &[7], &[0, 2]), (2, &[8], &[1, 2])];
        check(&tasks, 10.0, &units);
        // With time enough it is one unit, with none each task is one.
        check(&tasks, 100.0, &[(0, &[0, 1, 2, 3, 4, 5, 6, 7, 8], &[])]);
        assert_eq!(cut(&tasks, 0.0).len(), 9);
    }

    #[test]
    fn small_pieces_share_a_unit() {
        let tasks: Vec<_> = (0..10).map(|_| piece(1.0, &[])).collect();
        check(&tasks, 4.0, &[(0, &[0, 1, 2, 3], &[]), (0, &[4, 5, 6, 7], &[]), (0, &[8, 9], &[])]);
    }

    #[test]
    fn a_chain_stays_whole_and_what_is_there_is_nobodys_need() {
        let step = |follows: Option<usize>, inputs: &[usize]| {
            Some(Piece { seconds: 10.0, inputs: inputs.to_vec(), follows, gpu: false })
        };
        // The first task is there already; three epochs, and what reads the last.
        let tasks = [None, step(None, &[0]), step(Some(1), &[0, 1]), step(Some(2), &[0, 2]), piece(1.0, &[3])];
        check(&tasks, 5.0, &[(0, &[1, 2, 3], &[]), (1, &[4], &[0])]);
        // Of a chain whose first steps are there the rest is a chain.
        let tasks = [None, None, step(Some(1), &[0, 1]), step(Some(2), &[0, 2])];
        check(&tasks, 5.0, &[(0, &[2, 3], &[])]);
    }

    #[test]
    fn what_wants_a_gpu_stays_apart() {
        let gpu = |inputs: &[usize]| Some(Piece { seconds: 1.0, inputs: inputs.to_vec(), follows: None, gpu: true });
        let tasks = [piece(1.0, &[]), gpu(&[0]), gpu(&[1]), piece(1.0, &[2]), gpu(&[])];
        let units = cut(&tasks, 100.0);
        let found: Vec<(usize, bool, &[usize])> =
            units.iter().map(|unit| (unit.wave, unit.gpu, &*unit.tasks)).collect();
        let expected: [(usize, bool, &[usize]); 4] =
            [(0, false, &[0]), (0, true, &[4]), (1, true, &[1, 2]), (2, false, &[3])];
        assert_eq!(found, expected);
    }

    #[test]
    fn groups_of_one_wave_join_where_they_meet() {
        // Eight chunks of a map that is there, and their sum.
        let mut tasks = vec![None];
        tasks.extend((0..8).map(|_| piece(1.0, &[0])));
        tasks.push(piece(0.5, &[1, 2, 3, 4, 5, 6, 7, 8]));
        assert_eq!(cut(&tasks, 10.0).len(), 1);
        let units = cut(&tasks, 4.0);
        assert_eq!(units.iter().map(|unit| unit.wave).collect::<Vec<_>>(), [0, 0, 1]);
    }
}

use super::super::estimate::Basis;
use super::super::work::{Group, PartKind};
use super::*;
use crate::store::NodeName;

fn group(stage: &str, part: PartKind) -> Group {
    Group { stage: stage.to_owned(), part }
}

fn work(name: &str, amount: f64, inputs: &[usize], state: WorkState) -> Work {
    let name = NodeName::from(name);
    let part = PartKind::of(name.role(), None);
    let stage = name.stage().to_owned();
    Work { group: group(&stage, part), name, amount, inputs: inputs.to_vec(), state, exclusive: false }
}

fn seen(name: &str, amount: f64, read: u64, seconds: f64, bytes: u64) -> Observation {
    let name = NodeName::from(name);
    let part = PartKind::of(name.role(), None);
    let stage = name.stage().to_owned();
    Observation { group: group(&stage, part), name, amount: Some(amount), read: Some(read), seconds, bytes }
}

#[test]
fn a_node_takes_what_it_took_times_the_amount_of_its_work() {
    let tasks = [
        work("maps/a", 1.0, &[], WorkState::Done(100)),
        work("walks/a", 16.0, &[0], WorkState::Runs),
        work("walks/b", 16.0, &[0], WorkState::Runs),
    ];
    let observed = vec![seen("walks/a", 8.0, 100, 1.0, 1000), seen("walks/a", 8.0, 100, 3.0, 1000)];
    let found = forecast(&tasks, observed, 1);
    // Twice the work of (1 + 3) / 2 seconds; the other map is like this one.
    let own = Estimate { seconds: 4.0, range_s: (2.0, 6.0), bytes: 2000, basis: Basis::Node(2) };
    assert_eq!(found.tasks, [None, Some(own), Some(Estimate { basis: Basis::Stage(2), ..own })]);
    assert_eq!((found.work_s, found.wall_s, found.critical_s), (8.0, 8.0, 4.0));
    assert_eq!((found.bytes, found.range_s, found.unknown.len()), (4000, (4.0, 12.0), 0));
    assert_eq!(forecast(&tasks, vec![seen("walks/a", 8.0, 100, 3.0, 1)], 2).wall_s, 6.0);
}

#[test]
fn what_is_read_tells_the_time_where_several_observations_say_so() {
    // Half a second, and a second for each thousand bytes.
    let line: Vec<Observation> = [1000, 2000, 3000, 4000]
        .into_iter()
        .map(|read| seen(&format!("heat/{read}"), 1.0, read, 0.5 + read as f64 / 1000.0, 10))
        .collect();
    let task = |read| [work("maps/x", 1.0, &[], WorkState::Done(read)), work("heat/x", 1.0, &[0], WorkState::Runs)];
    let seconds = |read| forecast(&task(read), line.clone(), 1).work_s;
    assert!((seconds(2500) - 3.0).abs() < 1e-9 && (seconds(1000) - 1.5).abs() < 1e-9);
    // Beyond what was seen it grows with what is read at most: 4.5 s for twice as much is 9 s at most, the line says 8.5 s.
    assert!((seconds(8000) - 8.5).abs() < 1e-9);
    // A node's own past counts, and moves along the line: 2 s where the line says 1.5 s are 4.67 s where it says 3.5 s.
    let own = [vec![seen("heat/x", 1.0, 1000, 2.0, 10)], line.clone()].concat();
    let found = forecast(&task(3000), own, 1).tasks[1].expect("is known");
    assert_eq!(found.basis, Basis::Node(1));
    assert!(found.seconds > 3.5 && found.seconds < 5.0, "{found:?}");
    // Three points are too few, and a line that falls is none.
    assert_eq!(forecast(&task(9000), line[..3].to_vec(), 1).work_s, (1.5 + 2.5 + 3.5) / 3.0);
    let falling: Vec<_> = (1..=4).map(|n| seen(&format!("heat/{n}"), 1.0, n * 1000, 5.0 - n as f64, 10)).collect();
    assert_eq!(forecast(&task(9000), falling, 1).work_s, (4.0 + 3.0 + 2.0 + 1.0) / 4.0);
}

#[test]
fn of_what_nothing_is_known_no_number_is_made_up() {
    let tasks = [
        work("walks/a", 1.0, &[], WorkState::Runs),
        work("labels/a", 1.0, &[0], WorkState::Depends),
        work("labels/b", 1.0, &[0], WorkState::Depends),
        work("other", 1.0, &[], WorkState::Outside),
    ];
    let found = forecast(&tasks, vec![seen("walks/a", 1.0, 0, 2.0, 10), seen("other", 1.0, 0, 9.0, 9)], 2);
    assert_eq!((found.run, found.unknown.as_slice()), (3, &[("labels".to_owned(), 2)][..]));
    assert_eq!((found.work_s, found.certain_s, found.wall_s, found.bytes), (2.0, 2.0, 2.0, 10));
    assert_eq!(found.recorded(), Foreseen { wall_s: 2.0, work_s: 2.0, bytes: 10, unknown: 2 });
}

#[test]
fn what_depends_counts_but_is_told_apart() {
    let tasks = [work("walks/a", 1.0, &[], WorkState::Runs), work("labels/a", 1.0, &[0], WorkState::Depends)];
    let found = forecast(&tasks, vec![seen("walks/a", 1.0, 0, 2.0, 10), seen("labels/a", 1.0, 10, 1.0, 1)], 2);
    assert_eq!((found.work_s, found.certain_s, found.critical_s), (3.0, 2.0, 3.0));
}

#[test]
fn parts_of_another_kind_tell_nothing() {
    let chunk = work("walks/a/chunk-00", 1.0, &[], WorkState::Runs);
    assert_eq!(chunk.group.part, PartKind::Chunk);
    let found = forecast(&[chunk], vec![seen("walks/a", 1.0, 0, 2.0, 10)], 2);
    assert_eq!(found.unknown, [("walks".to_owned(), 1)]);
}

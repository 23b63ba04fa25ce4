//! Holds one ORCA step against the numbers of the reference implementation.
//!
//! The data lie in `../shared/oracle/orca` below the folder that `TRODDEN_SHARED` names; see the README there. Without
//! them the tests say so and pass.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use serde_json::Value;
use trodden::domain::geometry::Point;
use trodden::domain::orca::{AgentParameters, HalfPlane, Obstacles, Simulation};

use super::needs::Need;

/// In m/s, for velocities and for largest violations.
const TOLERANCE: f64 = 1e-4;

/// One agent of a case: its state and the reference's answer.
struct Agent {
    position: Point,
    velocity: Point,
    preferred: Point,
    parameters: AgentParameters,
    expected: Point,
    /// Whether no velocity kept all half-planes, where the oracle says so.
    infeasible: Option<bool>,
}

fn point(value: &Value) -> Point {
    Point::new(value[0].as_f64().expect("x"), value[1].as_f64().expect("y"))
}

fn largest_violation(half_planes: &[HalfPlane], velocity: Point) -> f64 {
    half_planes.iter().map(|h| h.violation(velocity)).fold(f64::NEG_INFINITY, f64::max)
}

/// Returns a simulation in the state of the agents, their radii changed by `growth` meters.
fn simulation_of(time_step: f64, obstacles: &Arc<Obstacles>, agents: &[Agent], growth: f64) -> Simulation {
    let mut simulation = Simulation::new(time_step, Arc::clone(obstacles));
    for (i, agent) in agents.iter().enumerate() {
        let radius = agent.parameters.radius + growth;
        simulation.add_agent(agent.position, AgentParameters { radius, ..agent.parameters });
        simulation.set_velocity(i, agent.velocity);
        simulation.set_preferred_velocity(i, agent.preferred);
    }
    simulation
}

/// Steps once and returns by how much each agent's answer is off, in m/s.
///
/// Where no velocity keeps all half-planes many are equally good. There the largest violation counts, and that of the
/// walls, which may not pay for the neighbors.
fn errors(simulation: &mut Simulation, agents: &[Agent]) -> Vec<f64> {
    let limits: Vec<(Vec<HalfPlane>, usize)> = (0..agents.len())
        .map(|i| {
            let constraints = simulation.constraints(i);
            (constraints.half_planes.to_vec(), constraints.walls)
        })
        .collect();
    simulation.step();
    agents
        .iter()
        .zip(&limits)
        .enumerate()
        .map(|(i, (agent, (half_planes, walls)))| {
            let (ours, max_speed) = (simulation.velocity(i), agent.parameters.max_speed);
            let our_worst = largest_violation(half_planes, ours);
            if !agent.infeasible.unwrap_or(our_worst > TOLERANCE) {
                return ours.distance(agent.expected);
            }
            // In one case the reference breaks the speed limit by 1.5 %, by rounding, and so violates the rest less.
            let excess = agent.expected.norm() / max_speed - 1.0;
            let theirs = if excess > 1e-3 { agent.expected.normalized() * max_speed } else { agent.expected };
            let difference = our_worst - largest_violation(half_planes, theirs);
            let at_walls = |v| largest_violation(&half_planes[..*walls], v).max(0.0);
            let difference = if excess > 1e-3 { difference.max(0.0) } else { difference.abs() };
            difference.max(at_walls(ours) - at_walls(theirs)).max(ours.norm() - max_speed)
        })
        .collect()
}

#[test]
fn one_step_of_300_random_cases_is_the_references() {
    let Some(folder) = Need::Oracle.folder() else { return };
    let text = fs::read_to_string(folder.join("onestep.jsonl")).expect("the oracle has its cases");
    let (mut cases, mut agents_seen, mut by_cuts, mut found) = (0, 0, 0, Vec::new());
    for line in text.lines() {
        let case: Value = serde_json::from_str(line).expect("a case is JSON");
        let polygons: Vec<Vec<Point>> = case["obstacles"]
            .as_array()
            .expect("obstacles")
            .iter()
            .map(|polygon| polygon.as_array().expect("a polygon").iter().map(point).collect())
            .collect();
        let uncut = Arc::new(Obstacles::new(&polygons).expect("the obstacles are sound"));
        let cut = Arc::new(Obstacles::new(&cut_like_the_reference(&polygons)).expect("the obstacles are sound"));
        let number = |value: &Value| value.as_f64().expect("a number");
        let expected = case["expect"].as_array().expect("answers");
        let agents: Vec<Agent> = case["agents"]
            .as_array()
            .expect("agents")
            .iter()
            .zip(expected)
            .map(|(agent, answer)| Agent {
                position: point(&agent["p"]),
                velocity: point(&agent["v"]),
                preferred: point(&agent["pv"]),
                parameters: AgentParameters {
                    radius: number(&agent["r"]),
                    max_speed: number(&agent["vmax"]),
                    neighbor_distance: number(&agent["neighbor_dist"]),
                    max_neighbors: number(&agent["max_neighbors"]) as usize,
                    time_horizon: number(&agent["th"]),
                    obstacle_horizon: number(&agent["tho"]),
                },
                expected: point(&answer["v"]),
                infeasible: answer["infeasible"].as_bool(),
            })
            .collect();
        let time_step = number(&case["dt"]);
        let mut simulation = simulation_of(time_step, &cut, &agents, 0.0);
        for (i, answer) in expected.iter().enumerate() {
            let constraints = simulation.constraints(i);
            let ids: Vec<Value> = constraints.neighbors.iter().map(|near| near.id.into()).collect();
            assert_eq!(Value::Array(ids), answer["neigh"], "neighbors of agent {i} in case {}", case["case"]);
            assert_eq!(constraints.facing.len(), answer["n_obst_neigh"], "walls of agent {i} in case {}", case["case"]);
        }
        for (i, error) in errors(&mut simulation, &agents).into_iter().enumerate() {
            if error.is_nan() || error > TOLERANCE {
                found.push(format!("case {}, agent {i}: off by {error:.1e}", case["case"]));
            }
        }
        let with_uncut = errors(&mut simulation_of(time_step, &uncut, &agents, 0.0), &agents);
        by_cuts += with_uncut.iter().filter(|error| **error > TOLERANCE).count();
        cases += 1;
        agents_seen += agents.len();
    }
    println!("{cases} cases, {agents_seen} agents; {by_cuts} answers hang on where the reference cuts its walls");
    assert_eq!(cases, 300);
    assert!(found.is_empty(), "{} of {agents_seen} agents:\n{}", found.len(), found.join("\n"));
    assert!(by_cuts <= 3, "the cuts matter for {by_cuts} answers");
}

/// Puts vertices where the reference cuts walls in two: at the lines of other walls, as its obstacle tree does.
///
/// The tree's root is the wall whose line leaves the smaller larger half (then the smaller smaller one), the first of
/// equals; walls that the line crosses are cut; both halves go on alike. A cut shows only in discs that overlap a wall
/// and in polygons that overlap each other, where the loose ends act as corners. So the library doesn't cut.
fn cut_like_the_reference(polygons: &[Vec<Point>]) -> Vec<Vec<Point>> {
    let mut walls = Vec::new();
    for (number, polygon) in polygons.iter().enumerate() {
        for (i, start) in polygon.iter().enumerate() {
            let end = polygon[(i + 1) % polygon.len()];
            walls.push(Edge { start: *start, end, polygon: number, from: i as f64, to: i as f64 + 1.0 });
        }
    }
    let mut pieces = Vec::new();
    cut(walls, &mut pieces);
    pieces.sort_by(|a, b| a.polygon.cmp(&b.polygon).then(a.from.total_cmp(&b.from)));
    let mut result = vec![Vec::new(); polygons.len()];
    for piece in pieces {
        result[piece.polygon].push(piece.start);
    }
    result
}

#[derive(Clone, Copy)]
struct Edge {
    start: Point,
    end: Point,
    polygon: usize,
    /// Where along the polygon it starts and ends, in edges.
    from: f64,
    to: f64,
}

impl Edge {
    /// Returns on which side of this edge's line the ends of another lie: positive is left.
    fn sides(&self, other: &Self) -> (f64, f64) {
        let along = self.end - self.start;
        (along.det(other.start - self.start), along.det(other.end - self.start))
    }
}

/// The reference's tolerance for points on a line.
const ON_LINE: f64 = 1e-5;

fn cut(walls: Vec<Edge>, pieces: &mut Vec<Edge>) {
    let halves = |i: usize| {
        let (mut left, mut right) = (0, 0);
        for (_, other) in walls.iter().enumerate().filter(|(j, _)| *j != i) {
            let (start, end) = walls[i].sides(other);
            let (is_left, is_right) = (start >= -ON_LINE && end >= -ON_LINE, start <= ON_LINE && end <= ON_LINE);
            left += usize::from(is_left || !is_right);
            right += usize::from(!is_left);
        }
        (left.max(right), left.min(right))
    };
    let Some(root) = (0..walls.len()).min_by_key(|i| halves(*i)) else { return };
    let (mut left, mut right) = (Vec::new(), Vec::new());
    for (_, other) in walls.iter().enumerate().filter(|(j, _)| *j != root) {
        let (start, end) = walls[root].sides(other);
        if start >= -ON_LINE && end >= -ON_LINE {
            left.push(*other);
        } else if start <= ON_LINE && end <= ON_LINE {
            right.push(*other);
        } else {
            let share = start / (start - end);
            let middle = other.start + (other.end - other.start) * share;
            let at = other.from + (other.to - other.from) * share;
            let first = Edge { end: middle, to: at, ..*other };
            let second = Edge { start: middle, from: at, ..*other };
            let (to_left, to_right) = if start > 0.0 { (first, second) } else { (second, first) };
            left.push(to_left);
            right.push(to_right);
        }
    }
    pieces.push(walls[root]);
    cut(left, pieces);
    cut(right, pieces);
}

fn rows(path: &Path) -> Vec<Vec<String>> {
    let text = fs::read_to_string(path).expect("a scene has three files");
    text.lines().skip(1).map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

/// What came of one scene.
#[derive(Default)]
struct Tally {
    steps: usize,
    at_contact: usize,
    wrong: Vec<String>,
}

/// Half the distance between float32 numbers near the sum of two radii, in meters.
const HALF_ULP: f64 = 1.5e-8;

/// Compares all steps of one scene.
///
/// The reference tells in float32 whether two discs touch. Where their distance and the sum of their radii differ by
/// less than that can tell, both of its answers are right; so an answer that is off is compared again with radii that
/// are larger or smaller by an ulp or two.
fn compare(folder: &Path, scene: &str) -> Tally {
    let number = |text: &String| text.parse::<f64>().expect("a number");
    let table = |part: &str| rows(&folder.join(format!("{scene}.{part}.csv")));
    let mut polygons: Vec<Vec<Point>> = Vec::new();
    for row in table("obst") {
        let polygon: usize = row[0].parse().expect("an index");
        polygons.resize(polygons.len().max(polygon + 1), Vec::new());
        polygons[polygon].push(Point::new(number(&row[2]), number(&row[3])));
    }
    let obstacles = Arc::new(Obstacles::new(&polygons).expect("the obstacles are sound"));
    let agents = table("agents");
    let time_step = number(&agents[0][4]);
    let parameters: Vec<AgentParameters> = agents
        .iter()
        .map(|row| AgentParameters {
            neighbor_distance: number(&row[5]),
            max_neighbors: number(&row[6]) as usize,
            time_horizon: number(&row[7]),
            obstacle_horizon: number(&row[8]),
            radius: number(&row[9]),
            max_speed: number(&row[10]),
        })
        .collect();
    let track: Vec<Vec<f64>> = table("traj").iter().map(|row| row.iter().map(number).collect()).collect();
    let steps: Vec<&[Vec<f64>]> = track.chunks(agents.len()).collect();
    let mut tally = Tally::default();
    for pair in steps.windows(2) {
        let state: Vec<Agent> = pair[0]
            .iter()
            .zip(pair[1])
            .zip(&parameters)
            .map(|((now, next), parameters)| Agent {
                position: Point::new(now[2], now[3]),
                velocity: Point::new(now[4], now[5]),
                preferred: Point::new(now[6], now[7]),
                parameters: *parameters,
                expected: Point::new(next[4], next[5]),
                infeasible: None,
            })
            .collect();
        let with = |growth| errors(&mut simulation_of(time_step, &obstacles, &state, growth), &state);
        tally.steps += state.len();
        for (i, error) in with(0.0).into_iter().enumerate() {
            if error <= TOLERANCE {
                continue;
            }
            let at_contact = state.iter().enumerate().any(|(j, other)| {
                let touch = state[i].parameters.radius + other.parameters.radius;
                i != j && (state[i].position.distance(other.position) - touch).abs() < 2.0 * HALF_ULP
            });
            let otherwise = [-2.0, -1.0, 1.0, 2.0].map(|ulps| with(ulps * HALF_ULP)[i]);
            if at_contact && otherwise.iter().any(|error| *error <= TOLERANCE) {
                tally.at_contact += 1;
            } else {
                tally.wrong.push(format!("{scene}, step {}, agent {i}: off by {error:.1e}", pair[0][0][0]));
            }
        }
    }
    tally
}

#[test]
fn every_step_of_twenty_scenes_is_the_references() {
    let Some(folder) = Need::Oracle.folder() else { return };
    let mut scenes: Vec<String> = fs::read_dir(&folder)
        .expect("the oracle is a folder")
        .filter_map(|entry| entry.expect("an entry").file_name().to_str()?.strip_suffix(".traj.csv").map(str::to_owned))
        .collect();
    scenes.sort();
    assert_eq!(scenes.len(), 20);
    let mut all = Tally::default();
    for scene in &scenes {
        let tally = compare(&folder, scene);
        all.steps += tally.steps;
        all.at_contact += tally.at_contact;
        all.wrong.extend(tally.wrong);
    }
    println!("{} steps of agents; {} of them touch another within float32's accuracy", all.steps, all.at_contact);
    assert!(all.wrong.is_empty(), "{} of {}:\n{}", all.wrong.len(), all.steps, all.wrong.join("\n"));
    assert!(all.at_contact * 200 < all.steps, "contact excuses {} of {}", all.at_contact, all.steps);
}

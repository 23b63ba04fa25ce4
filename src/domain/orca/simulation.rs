//! Discs with their wishes, moved step by step.

use std::sync::Arc;

use super::agent::{AgentParameters, check_positive};
use super::half_plane::{Disc, HalfPlane, avoid_disc};
use super::linear_program::{closest_velocity, least_violation};
use super::neighbors::NeighborGrid;
use super::obstacles::{Near, Obstacles};
use crate::domain::geometry::Point;

/// A crowd of discs among walls.
#[derive(Debug, Clone)]
pub struct Simulation {
    time_step: f64,
    obstacles: Arc<Obstacles>,
    discs: Vec<Disc>,
    parameters: Vec<AgentParameters>,
    preferred: Vec<Point>,
    visible: Vec<bool>,
    new_velocities: Vec<Point>,
    grid: NeighborGrid,
    scratch: Scratch,
}

/// Buffers of one agent's computation, kept for the next one.
#[derive(Debug, Clone, Default)]
struct Scratch {
    walls: Vec<Near>,
    neighbors: Vec<Near>,
    half_planes: Vec<HalfPlane>,
    projected: Vec<HalfPlane>,
}

/// What limits an agent's next velocity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constraints<'s> {
    /// All half-planes: first those of walls, nearest first, then those of neighbors, nearest first.
    pub half_planes: &'s [HalfPlane],
    /// How many of them come from walls.
    pub walls: usize,
    /// The walls that face the agent within its range, nearest first. Not every one yields a half-plane.
    pub facing: &'s [Near],
    /// The neighbors that are heeded, nearest first.
    pub neighbors: &'s [Near],
}

impl Simulation {
    /// Returns an empty simulation that moves by `time_step` seconds at a time.
    ///
    /// # Panics
    /// If `time_step` is not finite and positive.
    #[must_use]
    pub fn new(time_step: f64, obstacles: Arc<Obstacles>) -> Self {
        check_positive("time_step", time_step).expect("a time step is finite and positive");
        Self {
            time_step,
            obstacles,
            discs: Vec::new(),
            parameters: Vec::new(),
            preferred: Vec::new(),
            visible: Vec::new(),
            new_velocities: Vec::new(),
            grid: NeighborGrid::default(),
            scratch: Scratch::default(),
        }
    }

    /// Adds an agent at rest and returns its index.
    ///
    /// # Panics
    /// If [`AgentParameters::check`] fails.
    pub fn add_agent(&mut self, position: Point, parameters: AgentParameters) -> usize {
        parameters.check().expect("the parameters of an agent are in range");
        self.discs.push(Disc { position, velocity: Point::default(), radius: parameters.radius });
        self.parameters.push(parameters);
        self.preferred.push(Point::default());
        self.visible.push(true);
        self.new_velocities.push(Point::default());
        self.discs.len() - 1
    }

    /// Removes all agents and keeps the buffers.
    pub fn clear(&mut self) {
        self.discs.clear();
        self.parameters.clear();
        self.preferred.clear();
        self.visible.clear();
        self.new_velocities.clear();
    }

    /// Sets the velocity in m/s that an agent would take were it alone.
    pub fn set_preferred_velocity(&mut self, agent: usize, velocity: Point) {
        self.preferred[agent] = velocity;
    }

    /// Moves an agent elsewhere.
    pub fn set_position(&mut self, agent: usize, position: Point) {
        self.discs[agent].position = position;
    }

    /// Sets the velocity in m/s that an agent has.
    pub fn set_velocity(&mut self, agent: usize, velocity: Point) {
        self.discs[agent].velocity = velocity;
    }

    /// Sets whether the others heed an agent; it heeds them in either case.
    pub fn set_visible(&mut self, agent: usize, visible: bool) {
        self.visible[agent] = visible;
    }

    /// Returns the time of a step in seconds.
    #[must_use]
    pub fn time_step(&self) -> f64 {
        self.time_step
    }

    /// Returns the walls.
    #[must_use]
    pub fn obstacles(&self) -> &Arc<Obstacles> {
        &self.obstacles
    }

    /// Returns the number of agents.
    #[must_use]
    pub fn len(&self) -> usize {
        self.discs.len()
    }

    /// Tells whether there are no agents.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.discs.is_empty()
    }

    /// Returns position, velocity and radius of all agents.
    #[must_use]
    pub fn discs(&self) -> &[Disc] {
        &self.discs
    }

    /// Returns the position of an agent in meters.
    #[must_use]
    pub fn position(&self, agent: usize) -> Point {
        self.discs[agent].position
    }

    /// Returns the velocity of an agent in m/s.
    #[must_use]
    pub fn velocity(&self, agent: usize) -> Point {
        self.discs[agent].velocity
    }

    /// Returns the velocity in m/s that an agent would like.
    #[must_use]
    pub fn preferred_velocity(&self, agent: usize) -> Point {
        self.preferred[agent]
    }

    /// Returns the parameters of an agent.
    #[must_use]
    pub fn parameters(&self, agent: usize) -> &AgentParameters {
        &self.parameters[agent]
    }

    /// Computes every agent's new velocity from the present state, then moves all of them for one time step.
    pub fn step(&mut self) {
        self.fill_grid();
        let mut scratch = std::mem::take(&mut self.scratch);
        for agent in 0..self.discs.len() {
            self.new_velocities[agent] = self.new_velocity(agent, &mut scratch);
        }
        self.scratch = scratch;
        for (disc, velocity) in self.discs.iter_mut().zip(&self.new_velocities) {
            disc.velocity = *velocity;
            disc.position += *velocity * self.time_step;
        }
    }

    /// Returns what limits the next velocity of an agent in the present state.
    #[must_use]
    pub fn constraints(&mut self, agent: usize) -> Constraints<'_> {
        self.fill_grid();
        let mut scratch = std::mem::take(&mut self.scratch);
        let walls = self.constrain(agent, &mut scratch);
        self.scratch = scratch;
        let Scratch { walls: facing, neighbors, half_planes, .. } = &self.scratch;
        Constraints { half_planes, walls, facing, neighbors }
    }

    fn fill_grid(&mut self) {
        let furthest = self.parameters.iter().map(|p| p.neighbor_distance).fold(0.0, f64::max);
        self.grid.fill(&self.discs, &self.visible, furthest);
    }

    fn new_velocity(&self, agent: usize, scratch: &mut Scratch) -> Point {
        let walls = self.constrain(agent, scratch);
        let Scratch { half_planes, projected, .. } = scratch;
        let max_speed = self.parameters[agent].max_speed;
        let solution = closest_velocity(half_planes, self.preferred[agent], max_speed);
        if solution.kept == half_planes.len() {
            solution.velocity
        } else {
            least_violation(half_planes, walls, max_speed, solution, projected)
        }
    }

    /// Collects the half-planes of an agent and returns how many of them are walls'.
    fn constrain(&self, agent: usize, scratch: &mut Scratch) -> usize {
        let Scratch { walls, neighbors, half_planes, .. } = scratch;
        let (disc, p) = (&self.discs[agent], &self.parameters[agent]);
        half_planes.clear();

        // No wall further away can be met within the horizon.
        let range = p.obstacle_horizon * p.max_speed + p.radius;
        self.obstacles.facing_within(disc.position, range, walls);
        for near in walls.iter() {
            let wall = &self.obstacles.walls()[near.id as usize];
            if !wall.is_covered(disc, p.obstacle_horizon, half_planes) {
                half_planes.extend(wall.avoid(disc, p.obstacle_horizon));
            }
        }
        let count = half_planes.len();

        self.grid.nearest(agent, disc, p.neighbor_distance, p.max_neighbors, neighbors);
        half_planes.extend(
            neighbors
                .iter()
                .map(|near| avoid_disc(disc, &self.discs[near.id as usize], p.time_horizon, self.time_step)),
        );
        count
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const PARAMETERS: AgentParameters = AgentParameters {
        radius: 0.25,
        max_speed: 1.5,
        neighbor_distance: 4.0,
        max_neighbors: 6,
        time_horizon: 2.0,
        obstacle_horizon: 1.0,
    };

    /// An agent's position, velocity and preferred velocity.
    type State = [Point; 3];

    fn simulation(polygons: &[Vec<Point>], states: &[State]) -> Simulation {
        let obstacles = Arc::new(Obstacles::new(polygons).expect("sound"));
        let mut simulation = Simulation::new(0.1, obstacles);
        for [position, velocity, preferred] in states {
            let agent = simulation.add_agent(*position, PARAMETERS);
            simulation.set_velocity(agent, *velocity);
            simulation.set_preferred_velocity(agent, *preferred);
        }
        simulation
    }

    fn walls() -> Vec<Vec<Point>> {
        let polygon = |points: &[(f64, f64)]| points.iter().map(|(x, y)| Point::new(*x, *y)).collect::<Vec<_>>();
        vec![
            polygon(&[(-6.0, 6.0), (6.0, 6.0), (6.0, -6.0), (-6.0, -6.0)]),
            polygon(&[(1.0, 1.0), (3.0, 1.2), (3.0, 1.5), (1.6, 1.5), (1.6, 3.0), (1.0, 3.0)]),
            polygon(&[(-3.0, -1.0), (-1.0, -3.0)]),
        ]
    }

    prop_compose! {
        fn states()(numbers in prop::collection::vec(
            (-5.5..5.5f64, -5.5..5.5f64, -1.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64), 1..40,
        )) -> Vec<State> {
            numbers
                .into_iter()
                .map(|(x, y, vx, vy, px, py)| [Point::new(x, y), Point::new(vx, vy), Point::new(px, py)])
                .collect()
        }
    }

    #[test]
    fn nobody_sees_an_invisible_agent_which_sees_everybody() {
        let rest = Point::default();
        let states =
            [[Point::new(-0.5, 0.0), rest, Point::new(1.0, 0.0)], [Point::new(0.5, 0.01), rest, Point::new(-1.0, 0.0)]];
        let mut simulation = simulation(&[], &states);
        simulation.set_visible(1, false);
        simulation.step();
        assert_eq!(simulation.velocity(0), Point::new(1.0, 0.0));
        assert!(simulation.velocity(1).x > -1.0);
    }

    #[test]
    fn a_crowd_crosses_without_overlap_and_without_new_memory() {
        // A ring, each bound for a place to the left of the opposite one, which breaks the symmetry.
        let states: Vec<State> = (0..30)
            .map(|i| {
                let angle = f64::from(i) * std::f64::consts::TAU / 30.0;
                [Point::new(libm::cos(angle), libm::sin(angle)) * 5.0, Point::default(), Point::default()]
            })
            .collect();
        let mut simulation = simulation(&walls()[..1], &states);
        let mut memory = None;
        for step in 0..300 {
            for (agent, [start, ..]) in states.iter().enumerate() {
                let way = -*start + start.perpendicular() * 0.5 - simulation.position(agent);
                simulation.set_preferred_velocity(agent, way.normalized() * way.norm().min(1.2));
            }
            simulation.step();
            for (i, disc) in simulation.discs().iter().enumerate() {
                for other in &simulation.discs()[..i] {
                    assert!(disc.position.distance(other.position) > 0.5 - 1e-3, "overlap in step {step}");
                }
            }
            let Scratch { walls, neighbors, half_planes, projected } = &simulation.scratch;
            let now = [walls.capacity(), neighbors.capacity(), half_planes.capacity(), projected.capacity()];
            if step > 150 {
                assert_eq!(*memory.get_or_insert(now), now, "step {step}");
            }
        }
        let across = (0..30).filter(|agent| simulation.position(*agent).dot(states[*agent][0]) < 0.0).count();
        assert!(across >= 25, "{across} of 30 got across");
    }

    proptest! {
        #[test]
        fn every_feasible_velocity_obeys_every_half_plane(states in states()) {
            let mut simulation = simulation(&walls(), &states);
            let limits: Vec<Vec<HalfPlane>> =
                (0..states.len()).map(|agent| simulation.constraints(agent).half_planes.to_vec()).collect();
            simulation.step();
            for (agent, half_planes) in limits.iter().enumerate() {
                let velocity = simulation.velocity(agent);
                prop_assert!(velocity.norm() < PARAMETERS.max_speed + 1e-9);
                let solution = closest_velocity(half_planes, states[agent][2], PARAMETERS.max_speed);
                if solution.kept == half_planes.len() {
                    prop_assert_eq!(velocity, solution.velocity);
                    for half_plane in half_planes {
                        prop_assert!(half_plane.violation(velocity) < 1e-9);
                    }
                }
            }
        }

        /// But for discs that overlap a corner, which belongs to one of its two walls ([`super::super::Wall::avoid`]), and for
        /// those to whom a corner makes two walls equally near: the one that is first in their order is asked first, and may
        /// cover the other by another half-plane that is as safe.
        #[test]
        fn a_mirrored_scene_gives_the_mirrored_answer(states in states()) {
            let obstacles = Obstacles::new(&walls()).expect("sound");
            let states: Vec<State> =
                states.into_iter().filter(|[position, ..]| obstacles.distance(*position) > PARAMETERS.radius).collect();
            let mirror = |p: &Point| Point::new(-p.x, p.y);
            // Mirroring turns solids inside out; the reverse order turns them back.
            let mirrored_walls: Vec<Vec<Point>> =
                walls().iter().map(|polygon| polygon.iter().rev().map(mirror).collect()).collect();
            let mirrored_states: Vec<State> = states.iter().map(|state| state.each_ref().map(mirror)).collect();
            let mut here = simulation(&walls(), &states);
            let mut there = simulation(&mirrored_walls, &mirrored_states);
            here.step();
            there.step();
            // How far an agent minds walls.
            const REACH: f64 = PARAMETERS.radius + PARAMETERS.obstacle_horizon * PARAMETERS.max_speed;
            let mut walls = Vec::new();
            let mut is_between = |position: Point| {
                obstacles.facing_within(position, REACH, &mut walls);
                let equal = |pair: &[Near]| pair[1].distance_squared - pair[0].distance_squared < 1e-9;
                walls.windows(2).any(equal)
            };
            for ((a, b), [position, ..]) in here.discs().iter().zip(there.discs()).zip(&states) {
                if is_between(*position) {
                    continue;
                }
                prop_assert!(a.velocity.distance(mirror(&b.velocity)) < 1e-6, "{:?} and {:?}", a, b);
            }
        }

        #[test]
        fn the_order_of_agents_and_polygons_shows_in_no_answer(states in states(), turn in 0usize..40) {
            let by = turn % states.len();
            let mut turned = states.clone();
            turned.rotate_left(by);
            let mut polygons = walls();
            let mut here = simulation(&polygons, &states);
            polygons.rotate_left(1);
            let mut there = simulation(&polygons, &turned);
            here.step();
            there.step();
            for agent in 0..states.len() {
                prop_assert_eq!(here.discs()[agent], there.discs()[(agent + states.len() - by) % states.len()]);
            }
        }

        #[test]
        fn agents_out_of_sight_change_nothing(states in states(), far in states()) {
            let mut alone = simulation(&walls(), &states);
            let moved = far.iter().map(|[position, v, p]| [*position + Point::new(100.0, 0.0), *v, *p]);
            let both: Vec<State> = states.iter().copied().chain(moved).collect();
            let mut together = simulation(&walls(), &both);
            alone.step();
            together.step();
            prop_assert_eq!(alone.discs(), &together.discs()[..states.len()]);
        }
    }
}

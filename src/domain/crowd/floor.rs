//! Who walks where: the agents of a crowd on the floor of a scene, as giving way and moving see them.

use std::sync::Arc;

use crate::domain::geometry::{Cell, Point};
use crate::domain::orca::{AgentParameters, Simulation};
use crate::domain::random::Stream;

use super::routes::Route;
use super::scene::Scene;
use super::search::Search;
use super::walker::Walker;

/// Agents among the walls of a scene. An agent has the same index as walker and in the simulation.
#[derive(Debug, Clone)]
pub struct Floor<'s> {
    /// The map and everything derived from it.
    pub scene: &'s Scene,
    /// Positions and velocities of all discs.
    pub simulation: Simulation,
    /// What each agent is up to, in the order of the simulation.
    pub walkers: Vec<Walker>,
    /// Memory of searches for ways.
    pub search: Search,
}

impl<'s> Floor<'s> {
    /// Returns an empty floor.
    #[must_use]
    pub fn new(scene: &'s Scene) -> Self {
        Self {
            scene,
            simulation: Simulation::new(scene.config().time_step, Arc::clone(scene.obstacles())),
            walkers: Vec::new(),
            search: scene.router().search(),
        }
    }

    /// Adds an agent at rest with its preferred speed in m/s and the stream of its noise; returns its index.
    ///
    /// An agent that would start in a wall starts at the nearest place, at most a meter off, where it does not.
    pub fn add(&mut self, position: Point, speed: f64, noise: Stream) -> usize {
        let config = self.scene.config();
        let position = self.scene.space().nearest_start(position, 1.0).unwrap_or(position);
        self.walkers.push(Walker::new(position, speed, noise, config.time_step));
        self.simulation.add_agent(
            position,
            AgentParameters {
                radius: config.radius,
                max_speed: speed * config.max_speed_factor,
                neighbor_distance: config.neighbor_distance,
                max_neighbors: config.max_neighbors,
                time_horizon: config.horizon,
                obstacle_horizon: config.obstacle_horizon,
            },
        )
    }

    /// Returns the number of agents.
    #[must_use]
    pub fn len(&self) -> usize {
        self.walkers.len()
    }

    /// Returns the position of an agent in the local frame, in meters.
    #[must_use]
    pub fn position(&self, agent: usize) -> Point {
        self.simulation.position(agent)
    }

    /// Returns the velocity of an agent in m/s.
    #[must_use]
    pub fn velocity(&self, agent: usize) -> Point {
        self.simulation.velocity(agent)
    }

    /// Finds the way from where an agent is to its goal anew, to the taste it has, over cells that `enter` does not refuse.
    pub fn way_on(&mut self, agent: usize, enter: impl FnMut(Cell) -> bool) -> Option<Route> {
        let (router, space) = (self.scene.router(), self.scene.space());
        let route = &self.walkers[agent].line.route;
        let ends = [self.simulation.position(agent), route.end()];
        router.route(space, &mut self.search, route.taste(), ends, enter)
    }

    /// Collects the way ahead of an agent for at most `length` meters.
    pub fn ahead(&self, agent: usize, length: f64, points: &mut Vec<Point>) {
        self.walkers[agent].current().ahead(self.position(agent), length, points);
    }
}

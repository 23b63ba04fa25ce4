//! What all episodes on one map share.

use std::sync::Arc;

use crate::domain::geometry::{Frame, Point};
use crate::domain::map::OccupancyMap;
use crate::domain::orca::Obstacles;

use super::CrowdError;
use super::config::CrowdConfig;
use super::contours::walls;
use super::gates::Gates;
use super::places::Places;
use super::routes::Router;
use super::space::FreeSpace;

/// A map made ready for crowds of one kind: walls, open cells, ways and places. It never changes; threads share it.
#[derive(Debug, Clone)]
pub struct Scene {
    config: CrowdConfig,
    space: FreeSpace,
    router: Router,
    gates: Gates,
    obstacles: Arc<Obstacles>,
    places: Places,
}

impl Scene {
    /// Makes a map ready.
    ///
    /// # Errors
    /// [`CrowdError`] if a setting is out of range or no agent fits anywhere on the map.
    pub fn new(map: &OccupancyMap, config: &CrowdConfig) -> Result<Self, CrowdError> {
        config.check()?;
        let space = FreeSpace::new(map, config.radius);
        let walls = walls(&space);
        Self::assemble(space, &walls, config)
    }

    /// Makes a map ready whose walls are given as polygons in its local frame, where contours of its cells would be too
    /// coarse: counter-clockwise ones are solid, clockwise ones are rooms seen from inside, two vertices are a segment with
    /// both sides.
    ///
    /// # Errors
    /// [`CrowdError`] if a setting is out of range, a polygon is none, or no agent fits anywhere.
    pub fn with_walls(map: &OccupancyMap, walls: &[Vec<Point>], config: &CrowdConfig) -> Result<Self, CrowdError> {
        config.check()?;
        Self::assemble(FreeSpace::new(map, config.radius), walls, config)
    }

    fn assemble(space: FreeSpace, walls: &[Vec<Point>], config: &CrowdConfig) -> Result<Self, CrowdError> {
        let router = Router::new(&space, config);
        let gates = Gates::new(&space);
        let places = Places::new(&space, &router, config)?;
        let fastest = config.speed.max * config.max_speed_factor;
        let reach = config.radius + config.obstacle_horizon * fastest;
        let obstacles = Arc::new(Obstacles::with_reach(walls, reach)?);
        Ok(Self { config: config.clone(), space, router, gates, obstacles, places })
    }

    /// Returns the settings of the crowd.
    #[must_use]
    pub const fn config(&self) -> &CrowdConfig {
        &self.config
    }

    /// Returns where the local frame lies.
    #[must_use]
    pub const fn frame(&self) -> &Frame {
        self.space.map().frame()
    }

    /// Returns where the centers of discs may be.
    pub(super) const fn space(&self) -> &FreeSpace {
        &self.space
    }

    /// Returns the ways.
    pub(super) const fn router(&self) -> &Router {
        &self.router
    }

    /// Returns the narrow places.
    pub(super) const fn gates(&self) -> &Gates {
        &self.gates
    }

    /// Returns the places of starts and goals.
    pub(super) const fn places(&self) -> &Places {
        &self.places
    }

    /// Returns the walls as ORCA sees them.
    #[must_use]
    pub const fn obstacles(&self) -> &Arc<Obstacles> {
        &self.obstacles
    }

    /// Returns how far a disc at a point reaches into a blocked cell, in meters; 0 if it does not.
    #[must_use]
    pub fn wall_overlap(&self, position: Point) -> f64 {
        if self.space.is_free(position) { self.space.radius() - self.space.gap(position) } else { self.space.radius() }
    }
}

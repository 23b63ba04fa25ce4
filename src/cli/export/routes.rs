//! A graph of ways over the floor of a heat, for those who send robots along graphs.

use std::path::Path;

use crate::cli::error::CliError;
use crate::cli::plan_path;
use crate::cli::screen::Screen;
use crate::domain::crowd::{CrowdError, Scene, mean_pedestrians};
use crate::domain::geometry::{Frame, Point};
use crate::domain::map::OccupancyMap;
use crate::domain::planner::SocialPlanner;
use crate::domain::route_graph::{Edge, Node, Role, RouteGraph};
use crate::domain::social::CostConfig;
use crate::kinds::{Heat, Placed};
use crate::report::picture::{Scale, route_graph};
use crate::report::png;
use crate::stages::path_around::{check_ranges, robots_crowd};

/// How the graph is laid.
#[derive(Debug, clap::Args)]
pub(super) struct RouteArgs {
    /// Radius of the robot in meters: it fits on every line of the graph.
    #[arg(long, value_name = "METERS", default_value_t = 0.2)]
    radius: f64,
    /// Speed of the robot in m/s.
    #[arg(long, value_name = "SPEED", default_value_t = 0.5)]
    speed: f64,
    /// How many people are in the building [default: 6.5, and in proportion more above 200 m²].
    #[arg(long, value_name = "NUMBER")]
    people: Option<f64>,
    /// Meters that a unit of social cost is worth [default: as much as makes people cost what the way costs, on the mean over
    /// the graph].
    #[arg(long, value_name = "METERS")]
    lambda: Option<f64>,
}

/// A graph on a map.
#[derive(Debug)]
pub(super) struct Laid {
    graph: RouteGraph,
    frame: Frame,
    /// Meters that a unit of social cost is worth.
    pub lambda: f64,
    /// How many people are reckoned with.
    pub people: f64,
    /// Speed of the robot in m/s.
    speed: f64,
}

impl RouteArgs {
    /// Lays a graph over the floor of a heat, which was read from `path`, and says how large it is; refuses floor on which the robot
    /// gets nowhere.
    pub fn lay(&self, heat: &Placed<Heat>, path: &Path, screen: &Screen) -> Result<Laid, CliError> {
        let nowhere = || {
            let what = format!("a robot of {} m radius gets nowhere on the floor of `{}`", self.radius, path.display());
            CliError::advised(what, "choose a smaller `--radius`")
        };
        self.lay_if_any(heat, path, screen)?.ok_or_else(nowhere)
    }

    /// Lays a graph likewise, if there is one.
    pub fn lay_if_any(&self, heat: &Placed<Heat>, path: &Path, screen: &Screen) -> Result<Option<Laid>, CliError> {
        self.check()?;
        let refused = |error: &dyn std::fmt::Display| CliError::request(format!("`{}`: {error}", path.display()));
        let map = OccupancyMap::new(heat.value.free.clone(), heat.frame).map_err(|error| refused(&error))?;
        let crowd = robots_crowd(self.radius, self.speed);
        let scene = Scene::new(&map, &crowd).map_err(|error: CrowdError| refused(&error))?;
        let density = heat.value.relative_density(map.free());
        let density = density.ok_or_else(|| refused(&"the heat says that nobody is anywhere"))?;
        let people = self.people.unwrap_or_else(|| mean_pedestrians(&crowd, &map));
        let costs = CostConfig::default();
        let planner = SocialPlanner::new(&scene, &density, map.free(), people, &costs);
        let graph = RouteGraph::new(&map, &planner);
        if graph.edges.is_empty() {
            return Ok(None);
        }
        let total = |of: fn(&Edge) -> f64| graph.edges.iter().map(of).sum::<f64>();
        let cost = total(|edge| edge.cost);
        let lambda = self.lambda.unwrap_or(if cost > 0.0 { total(|edge| edge.length) / cost } else { 0.0 });
        let doors = graph.nodes.iter().filter(|node| node.role == Role::Door).count();
        let meters = total(|edge| edge.length);
        screen.remark(format!(
            "route graph: {} places, {doors} of them doors, {} lines of {meters:.0} m together; {people:.1} people, λ = {lambda:.3} m",
            graph.nodes.len(),
            graph.edges.len()
        ));
        Ok(Some(Laid { graph, frame: heat.frame, lambda, people, speed: self.speed }))
    }

    fn check(&self) -> Result<(), CliError> {
        let ranges = [
            ("radius", Some(self.radius), 0.05, 2.0),
            ("speed", Some(self.speed), 0.05, 10.0),
            ("people", self.people, 0.0, 1e5),
            ("lambda", self.lambda, 0.0, 1e6),
        ];
        check_ranges(&ranges).map_err(plan_path::refused)
    }
}

impl Laid {
    /// Returns the places: where each lies on the map, rounded to millimeters, what it is, and its name; bends have none.
    pub fn places(&self) -> impl Iterator<Item = ([f64; 2], Role, Option<String>)> {
        let mut counts = [0usize; 3];
        self.graph.nodes.iter().map(move |Node { place, role }| {
            let name = (*role != Role::Bend).then(|| {
                counts[*role as usize] += 1;
                format!("{}_{}", role_name(*role), counts[*role as usize])
            });
            let at = self.frame.to_map(*place);
            ([at.x, at.y].map(|meters| (meters * 1e3).round() / 1e3), *role, name)
        })
    }

    /// Returns the lines, each in both directions.
    pub fn lines(&self) -> impl Iterator<Item = Edge> {
        self.graph.edges.iter().flat_map(|edge| [*edge, Edge { ends: [edge.ends[1], edge.ends[0]], ..*edge }])
    }

    /// Returns how many places there are.
    pub fn len(&self) -> usize {
        self.graph.nodes.len()
    }

    /// Returns what the people on a line cost, in meters.
    pub fn penalty(&self, line: &Edge) -> f64 {
        self.lambda * line.cost
    }

    /// Returns the speed in m/s at which a line takes as long as its length and its penalty together, for those who count nothing
    /// but time.
    pub fn speed(&self, line: &Edge) -> f64 {
        let speed = self.speed * line.length / (line.length + self.penalty(line));
        (speed * 1e3).round().max(1.0) / 1e3
    }

    /// Draws the graph over its heat.
    pub fn draw(&self, heat: &Placed<Heat>, title: &str) -> Vec<u8> {
        let places: Vec<(Point, Role)> = self.graph.nodes.iter().map(|node| (node.place, node.role)).collect();
        let lines: Vec<[usize; 2]> = self.graph.edges.iter().map(|edge| edge.ends).collect();
        let picture = route_graph(&heat.frame, &heat.value.heat, &heat.value.free, &places, &lines);
        png::figure(&picture, Scale::Linear, title)
    }
}

/// Names a role, as `class` in metadata.
pub(super) const fn role_name(role: Role) -> &'static str {
    match role {
        Role::Door => "door",
        Role::Crossing => "crossing",
        Role::End => "end",
        Role::Bend => "bend",
    }
}

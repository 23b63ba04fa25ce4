//! The settings of a crowd, as a pipeline file has them and with every default filled in.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Serialize};

use super::CrowdError;

/// The settings of a crowd with all defaults filled in: what an episode depends on besides its map and its seed.
///
/// It is read from [`CrowdFields`], of which every field may be left out. What it writes names every field, so that it
/// may stand in a cache key; reading that back gives the same settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(from = "CrowdFields")]
pub struct CrowdConfig {
    /// Fewest and most agents of an episode.
    pub agents: [u32; 2],
    /// Square meters of free floor up to which `agents` holds; on a larger floor there are more in proportion. `None`: it
    /// holds on any floor.
    pub agents_area: Option<f64>,
    /// Square meters of free floor for each agent; it replaces `agents` where it is given.
    pub area_per_agent: Option<f64>,
    /// Radius of an agent's disc in meters.
    pub radius: f64,
    /// Preferred speeds.
    pub speed: Speed,
    /// How much faster than at its preferred speed an agent may walk to evade others.
    pub max_speed_factor: f64,
    /// Seconds of one step.
    pub time_step: f64,
    /// Seconds of one episode.
    pub duration: f64,
    /// Distance in meters within which an agent sees others.
    pub neighbor_distance: f64,
    /// Most others that an agent heeds, the nearest first.
    pub max_neighbors: usize,
    /// Seconds for which velocities must be free of collisions with others.
    pub horizon: f64,
    /// Seconds for which velocities must be free of collisions with walls.
    pub obstacle_horizon: f64,
    /// Distance in meters that starts and goals keep from walls, beyond the radius.
    pub margin: f64,
    /// Least length in meters of the way to a new goal.
    pub goal_distance: f64,
    /// Standard deviation of the noise on preferred velocities, as a share of the preferred speed.
    pub noise: f64,
    /// How much more a meter costs in reach of a wall than far from walls: routes are the cheapest ones. 0: they heed no
    /// walls.
    pub clearance_cost: f64,
    /// Distance in meters over which that falls to 1/e.
    pub clearance_scale: f64,
    /// How much people differ in the ways they take: the standard deviation of the logarithm of a meter's cost. 0: not at
    /// all.
    pub variety: f64,
    /// Distance in meters over which one person's likes and dislikes change.
    pub variety_scale: f64,
    /// Share of starts and goals that are drawn from rooms alone: where there is space to stay in. 0: they lie anywhere.
    pub rooms: f64,
    /// What a room is: a place at least so many meters wide.
    pub room_width: f64,
}

/// The normal distribution of preferred speeds, cut at both ends, in meters per second.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Speed {
    /// Mean before the cut.
    pub mean: f64,
    /// Standard deviation before the cut.
    pub deviation: f64,
    /// Slowest speed.
    pub min: f64,
    /// Fastest speed.
    pub max: f64,
}

/// A named set of settings that explicit ones override.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// The pedestrians of the iGibson simulator: wide (0.5 m), slow (0.5 m/s), one on each 8 m², 500 steps.
    Igibson,
    /// The shortest ways, which graze corners, as the paper has them: what holds where no preset is named.
    Shortest,
    /// Ways that keep off walls and corners as far as there is room, and that differ from person to person; goals keep off
    /// walls, too, and nine of ten lie in rooms.
    Comfortable,
}

/// The settings of a crowd as a pipeline file has them: what is left out comes from the preset, or is as in brackets.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct CrowdFields {
    /// Named set of settings from which everything that is not given is taken.
    pub preset: Option<Preset>,
    /// Fewest and most agents of an episode [1, 8].
    pub agents: Option<[u32; 2]>,
    /// Square meters of free floor up to which `agents` holds; on a larger floor there are more in proportion [200; none,
    /// so that `agents` holds on any floor, where `agents` is given].
    #[schemars(range(min = 0.1, max = 1e6))]
    pub agents_area: Option<f64>,
    /// Square meters of free floor for each agent; replaces `agents` [none; `igibson`: 8].
    #[schemars(range(min = 0.1, max = 1e6))]
    pub area_per_agent: Option<f64>,
    /// Radius of an agent's disc in meters [0.2; `igibson`: 0.5].
    #[schemars(range(min = 0.05, max = 2.0))]
    pub radius: Option<f64>,
    /// Preferred speeds, drawn for each agent [normal, 1.3 ± 0.2 m/s, cut at 0.5 and 2.0; `igibson`: 0.5 m/s].
    pub speed: Option<SpeedFields>,
    /// How much faster than at its preferred speed an agent may walk to evade others [1.25; `igibson`: 1].
    #[schemars(range(min = 1.0, max = 3.0))]
    pub max_speed_factor: Option<f64>,
    /// Seconds of one step [0.1].
    #[schemars(range(min = 0.01, max = 0.5))]
    pub time_step: Option<f64>,
    /// Seconds of one episode [60; `igibson`: 50, which is 500 steps].
    #[schemars(range(min = 0.1, max = 86400.0))]
    pub duration: Option<f64>,
    /// Distance in meters within which an agent sees others [5 m].
    #[schemars(range(min = 0.1, max = 100.0))]
    pub neighbor_distance: Option<f64>,
    /// Most others that an agent heeds, the nearest first [10 others].
    #[schemars(range(max = 1000))]
    pub max_neighbors: Option<usize>,
    /// Seconds for which velocities must be free of collisions with others [2 s].
    #[schemars(range(min = 0.1, max = 60.0))]
    pub horizon: Option<f64>,
    /// Seconds for which velocities must be free of collisions with walls [0.5; `igibson`: 2].
    #[schemars(range(min = 0.1, max = 60.0))]
    pub obstacle_horizon: Option<f64>,
    /// Distance in meters that starts and goals keep from walls, beyond the radius [0.1; `igibson`: 0, `comfortable`: 0.2].
    #[schemars(range(min = 0.0, max = 10.0))]
    pub margin: Option<f64>,
    /// Least length in meters of the way to a new goal [4 m].
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub goal_distance: Option<f64>,
    /// Standard deviation of the noise on preferred velocities, as a share of the preferred speed [0.05].
    #[schemars(range(min = 0.0, max = 1.0))]
    pub noise: Option<f64>,
    /// How much more a meter costs in reach of a wall than far from walls, as routes are chosen by cost; 0: they heed no
    /// walls [0; `comfortable`: 3].
    #[schemars(range(min = 0.0, max = 20.0))]
    pub clearance_cost: Option<f64>,
    /// Distance in meters over which that extra cost falls to 1/e [0.3 m].
    #[schemars(range(min = 0.01, max = 10.0))]
    pub clearance_scale: Option<f64>,
    /// How much people differ in the ways they take: the standard deviation of the logarithm of a meter's cost; 0: not at
    /// all [0; `comfortable`: 1].
    #[schemars(range(min = 0.0, max = 2.0))]
    pub variety: Option<f64>,
    /// Distance in meters over which one person's likes and dislikes change [0.8 m].
    #[schemars(range(min = 0.05, max = 10.0))]
    pub variety_scale: Option<f64>,
    /// Share of starts and goals that are drawn from rooms alone: people pass through corridors, and stay where there is
    /// space [0: anywhere; `comfortable`: 0.9].
    #[schemars(range(min = 0.0, max = 1.0))]
    pub rooms: Option<f64>,
    /// What a room is: a place at least so many meters wide [2.1].
    #[schemars(range(min = 0.1, max = 20.0))]
    pub room_width: Option<f64>,
}

/// Preferred speeds as a pipeline file has them, in meters per second.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SpeedFields {
    /// Mean before the cut [1.3].
    pub mean: Option<f64>,
    /// Standard deviation before the cut [0.2].
    pub deviation: Option<f64>,
    /// Slowest speed [0.5].
    pub min: Option<f64>,
    /// Fastest speed [2.0].
    pub max: Option<f64>,
}

impl Default for CrowdConfig {
    fn default() -> Self {
        Self {
            agents: [1, 8],
            agents_area: Some(200.0),
            area_per_agent: None,
            radius: 0.2,
            speed: Speed { mean: 1.3, deviation: 0.2, min: 0.5, max: 2.0 },
            max_speed_factor: 1.25,
            time_step: 0.1,
            duration: 60.0,
            neighbor_distance: 5.0,
            max_neighbors: 10,
            horizon: 2.0,
            obstacle_horizon: 0.5,
            margin: 0.1,
            goal_distance: 4.0,
            noise: 0.05,
            clearance_cost: 0.0,
            clearance_scale: 0.3,
            variety: 0.0,
            variety_scale: 0.8,
            rooms: 0.0,
            room_width: 2.1,
        }
    }
}

impl Preset {
    /// Returns the settings of this name.
    #[must_use]
    pub fn config(self) -> CrowdConfig {
        match self {
            Self::Igibson => CrowdConfig {
                agents_area: None,
                area_per_agent: Some(8.0),
                radius: 0.5,
                speed: Speed { mean: 0.5, deviation: 0.0, min: 0.5, max: 0.5 },
                max_speed_factor: 1.0,
                duration: 50.0,
                obstacle_horizon: 2.0,
                margin: 0.0,
                ..CrowdConfig::default()
            },
            Self::Shortest => CrowdConfig::default(),
            Self::Comfortable => {
                CrowdConfig { margin: 0.2, clearance_cost: 3.0, variety: 1.0, rooms: 0.9, ..CrowdConfig::default() }
            }
        }
    }
}

impl From<CrowdFields> for CrowdConfig {
    fn from(fields: CrowdFields) -> Self {
        let base = fields.preset.map_or_else(Self::default, Preset::config);
        // A number of agents that was written down is meant as it is, whatever the preset or the default says of areas.
        let inherited = |area: Option<f64>| if fields.agents.is_some() { None } else { area };
        Self {
            agents: fields.agents.unwrap_or(base.agents),
            agents_area: fields.agents_area.or(inherited(base.agents_area)),
            area_per_agent: fields.area_per_agent.or(inherited(base.area_per_agent)),
            radius: fields.radius.unwrap_or(base.radius),
            speed: fields.speed.map_or(base.speed, |speed| speed.over(base.speed)),
            max_speed_factor: fields.max_speed_factor.unwrap_or(base.max_speed_factor),
            time_step: fields.time_step.unwrap_or(base.time_step),
            duration: fields.duration.unwrap_or(base.duration),
            neighbor_distance: fields.neighbor_distance.unwrap_or(base.neighbor_distance),
            max_neighbors: fields.max_neighbors.unwrap_or(base.max_neighbors),
            horizon: fields.horizon.unwrap_or(base.horizon),
            obstacle_horizon: fields.obstacle_horizon.unwrap_or(base.obstacle_horizon),
            margin: fields.margin.unwrap_or(base.margin),
            goal_distance: fields.goal_distance.unwrap_or(base.goal_distance),
            noise: fields.noise.unwrap_or(base.noise),
            clearance_cost: fields.clearance_cost.unwrap_or(base.clearance_cost),
            clearance_scale: fields.clearance_scale.unwrap_or(base.clearance_scale),
            variety: fields.variety.unwrap_or(base.variety),
            variety_scale: fields.variety_scale.unwrap_or(base.variety_scale),
            rooms: fields.rooms.unwrap_or(base.rooms),
            room_width: fields.room_width.unwrap_or(base.room_width),
        }
    }
}

impl SpeedFields {
    /// Fills in what is not given; a mean outside of the inherited cuts moves them.
    fn over(self, base: Speed) -> Speed {
        let mean = self.mean.unwrap_or(base.mean);
        Speed {
            mean,
            deviation: self.deviation.unwrap_or(base.deviation),
            min: self.min.unwrap_or(base.min.min(mean)),
            max: self.max.unwrap_or(base.max.max(mean)),
        }
    }
}

impl JsonSchema for CrowdConfig {
    fn schema_name() -> Cow<'static, str> {
        "CrowdConfig".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        CrowdFields::json_schema(generator)
    }
}

impl CrowdConfig {
    /// Checks that every setting lies in its range.
    ///
    /// # Errors
    /// [`CrowdError::Setting`] names the first field that does not, with the range.
    pub fn check(&self) -> Result<(), CrowdError> {
        let speed = &self.speed;
        let ranges = [
            ("agents_area", self.agents_area.unwrap_or(1.0), 0.1, 1e6),
            ("area_per_agent", self.area_per_agent.unwrap_or(1.0), 0.1, 1e6),
            ("radius", self.radius, 0.05, 2.0),
            ("speed.mean", speed.mean, 0.01, 10.0),
            ("speed.deviation", speed.deviation, 0.0, 5.0),
            ("speed.min", speed.min, 0.01, speed.mean.min(10.0)),
            ("speed.max", speed.max, speed.mean.max(0.01), 10.0),
            ("max_speed_factor", self.max_speed_factor, 1.0, 3.0),
            ("time_step", self.time_step, 0.01, 0.5),
            ("duration", self.duration, self.time_step, 86_400.0),
            ("neighbor_distance", self.neighbor_distance, 0.1, 100.0),
            ("max_neighbors", self.max_neighbors as f64, 0.0, 1000.0),
            ("horizon", self.horizon, self.time_step, 60.0),
            ("obstacle_horizon", self.obstacle_horizon, self.time_step, 60.0),
            ("margin", self.margin, 0.0, 10.0),
            ("goal_distance", self.goal_distance, 0.0, 1000.0),
            ("noise", self.noise, 0.0, 1.0),
            ("clearance_cost", self.clearance_cost, 0.0, 20.0),
            ("clearance_scale", self.clearance_scale, 0.01, 10.0),
            ("variety", self.variety, 0.0, 2.0),
            ("variety_scale", self.variety_scale, 0.05, 10.0),
            ("rooms", self.rooms, 0.0, 1.0),
            ("room_width", self.room_width, 0.1, 20.0),
        ];
        for (field, value, min, max) in ranges {
            // Written so that what is not a number is refused too.
            if !(value >= min && value <= max) {
                return Err(CrowdError::Setting {
                    field,
                    value: value.to_string(),
                    allowed: format!("{min} to {max}"),
                });
            }
        }
        let [fewest, most] = self.agents;
        if fewest < 1 || fewest > most || most as usize > MOST_WALKERS {
            return Err(CrowdError::Setting {
                field: "agents",
                value: format!("[{fewest}, {most}]"),
                allowed: format!("1 to {MOST_WALKERS}, the smaller number first"),
            });
        }
        Ok(())
    }

    /// Returns the number of steps of an episode.
    #[must_use]
    pub fn steps(&self) -> usize {
        // A hair less than half a step of tolerance: 0.3 / 0.1 is 2.9999999999999996.
        (self.duration / self.time_step + 0.499).floor() as usize
    }

    /// Returns the fewest and the most agents of an episode on a floor of `free_area` square meters.
    #[must_use]
    pub fn agents_on(&self, free_area: f64) -> [usize; 2] {
        match self.area_per_agent {
            Some(area) => [((free_area / area).floor() as usize).clamp(1, MOST_WALKERS); 2],
            None => {
                let larger = self.agents_area.map_or(1.0, |area| (free_area / area).max(1.0));
                self.agents.map(|n| ((f64::from(n) * larger).round() as usize).min(MOST_WALKERS))
            }
        }
    }
}

/// The most agents of an episode; one identifier is left for the robot of a navigation episode.
pub const MOST_WALKERS: usize = crate::domain::tracks::MOST_AGENTS - 1;

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn read(value: serde_json::Value) -> CrowdConfig {
        serde_json::from_value(value).expect("valid settings")
    }

    #[test]
    fn nothing_given_is_the_default() {
        assert_eq!(read(json!({})), CrowdConfig::default());
        assert_eq!(CrowdConfig::default().check(), Ok(()));
        assert_eq!(CrowdConfig::default().steps(), 600);
    }

    #[test]
    fn explicit_fields_override_the_preset() {
        let preset = read(json!({"preset": "igibson"}));
        assert_eq!((preset.radius, preset.area_per_agent, preset.steps()), (0.5, Some(8.0), 500));
        assert_eq!(preset.check(), Ok(()));
        assert_eq!(preset.agents_on(41.0), [5, 5]);
        assert_eq!(preset.agents_on(3.0), [1, 1]);
        let mixed = read(json!({"preset": "igibson", "agents": [2, 3], "speed": {"mean": 0.8}}));
        assert_eq!((mixed.radius, mixed.area_per_agent, mixed.agents_on(80.0)), (0.5, None, [2, 3]));
        assert_eq!(mixed.speed, Speed { mean: 0.8, deviation: 0.0, min: 0.5, max: 0.8 });
        assert_eq!(read(json!({"agents": [1, 2], "area_per_agent": 10.0})).agents_on(35.0), [3, 3]);
    }

    #[test]
    fn more_agents_walk_on_larger_floors_unless_their_number_is_given() {
        let on = |value: serde_json::Value| [30.0, 200.0, 500.0, 1e9].map(|area| read(value.clone()).agents_on(area));
        assert_eq!(on(json!({})), [[1, 8], [1, 8], [3, 20], [999, 999]]);
        assert_eq!(on(json!({"agents": [2, 4]})), [[2, 4]; 4]);
        assert_eq!(on(json!({"agents": [2, 4], "agents_area": 100})), [[2, 4], [4, 8], [10, 20], [999, 999]]);
        assert_eq!(on(json!({"agents_area": 1000}))[2], [1, 8]);
    }

    #[test]
    fn what_it_writes_reads_back_and_names_every_field() {
        let given = CrowdConfig { agents: [2, 4], agents_area: None, ..CrowdConfig::default() };
        for config in [CrowdConfig::default(), Preset::Igibson.config(), Preset::Comfortable.config(), given] {
            let written = serde_json::to_value(&config).expect("settings are JSON");
            assert_eq!(written.as_object().map(|o| o.len()), Some(21));
            assert_eq!(read(written), config);
        }
    }

    #[test]
    fn an_embedding_stage_refuses_unknown_fields() {
        #[derive(Debug, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields)]
        struct Stage {
            episodes: u32,
            #[serde(flatten)]
            crowd: CrowdConfig,
        }
        let stage: Stage = serde_json::from_value(json!({"episodes": 9, "agents": [1, 4]})).expect("a stage");
        assert_eq!((stage.episodes, stage.crowd.agents, stage.crowd.radius), (9, [1, 4], 0.2));
        let error = serde_json::from_value::<Stage>(json!({"episodes": 9, "radios": 0.2})).expect_err("misspelt");
        assert!(error.to_string().contains("`radios`"), "{error}");
        let schema = schemars::schema_for!(Stage);
        assert!(schema.pointer("/properties/obstacle_horizon").is_some(), "{schema:?}");
    }

    #[test]
    fn a_setting_out_of_range_is_named() {
        let message = |config: CrowdConfig| config.check().expect_err("out of range").to_string();
        let default = CrowdConfig::default;
        assert!(message(CrowdConfig { radius: f64::NAN, ..default() }).contains("`radius`"));
        assert!(message(CrowdConfig { agents: [3, 2], ..default() }).contains("`agents`"));
        assert!(message(CrowdConfig { agents: [1, 5000], ..default() }).contains("999"));
        assert!(message(CrowdConfig { obstacle_horizon: 0.05, ..default() }).contains("0.1 to 60"));
    }
}

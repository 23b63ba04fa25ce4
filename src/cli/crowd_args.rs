//! Who walks where a command simulates people: the same options for every command that does.

use std::ops::ControlFlow;

use super::error::CliError;
use super::screen::Screen;
use crate::domain::crowd::{CrowdConfig, CrowdFields, Preset};
use crate::domain::map::OccupancyMap;
use crate::kinds::Heat;
use crate::report::bars::WorkBar;
use crate::stages::crowd_heat::{self, Walks};

/// Episodes that are simulated where nothing else is asked for, as `simulate` of a pipeline file does.
const EPISODES: u32 = 100;

/// Who walks.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Who walks, where people are simulated")]
pub(super) struct CrowdArgs {
    /// Number of independent episodes of a minute; the more, the steadier [default: 100].
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    episodes: Option<u32>,
    /// How people choose their ways and goals [default: comfortable].
    #[arg(long, value_enum)]
    preset: Option<PresetName>,
    /// Fewest and most people of an episode, as in `4,12` [default: 1,8; more on a floor of more than 200 m²].
    #[arg(long, value_name = "FEWEST,MOST", value_delimiter = ',', num_args = 1)]
    agents: Option<Vec<u32>>,
    /// Seed of all chance [default: 0].
    #[arg(long, value_name = "NUMBER")]
    seed: Option<u64>,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum PresetName {
    /// The shortest ways, which graze corners, as the paper has them.
    Shortest,
    /// Ways that keep off walls, differ from person to person and lead from room to room: nearer to recorded people, and what
    /// the model that `trodden` brings has learned from.
    Comfortable,
    /// The wide and slow pedestrians of the iGibson simulator.
    Igibson,
}

impl CrowdArgs {
    /// Returns the option that was given, if one was.
    pub(super) fn given(&self) -> Option<&'static str> {
        let given = [
            (self.episodes.is_some(), "--episodes"),
            (self.preset.is_some(), "--preset"),
            (self.agents.is_some(), "--agents"),
            (self.seed.is_some(), "--seed"),
        ];
        given.into_iter().find_map(|(given, name)| given.then_some(name))
    }

    /// Reads what to simulate.
    ///
    /// # Errors
    /// [`CliError`] names the option that is out of range.
    pub(super) fn walks(&self) -> Result<Walks, CliError> {
        let preset = Some(match self.preset.unwrap_or(PresetName::Comfortable) {
            PresetName::Shortest => Preset::Shortest,
            PresetName::Comfortable => Preset::Comfortable,
            PresetName::Igibson => Preset::Igibson,
        });
        let agents = match self.agents.as_deref() {
            None => None,
            Some([fewest, most]) => Some([*fewest, *most]),
            Some(_) => return Err(CliError::advised("`--agents` takes two numbers", "write, say, `--agents 4,12`")),
        };
        let crowd = CrowdConfig::from(CrowdFields { preset, agents, ..CrowdFields::default() });
        crowd.check().map_err(|error| CliError::request(error.to_string()))?;
        Ok(Walks { crowd, episodes: self.episodes.unwrap_or(EPISODES), seed: self.seed.unwrap_or(0) })
    }
}

/// Simulates people on a map, with a bar, and says what was not as it was asked for.
pub(super) fn simulate(map: &OccupancyMap, walks: &Walks, screen: &Screen) -> Result<Heat, CliError> {
    let mut bar = WorkBar::new("simulate", screen.bars());
    let mut progress = |done: usize, all: usize| {
        bar.advance(done, all);
        ControlFlow::Continue(())
    };
    let (heat, summary) = crowd_heat::heat(map, walks, &mut progress)?;
    drop(bar);
    for warning in crowd_heat::warnings(&walks.crowd, &summary) {
        screen.warn(warning);
    }
    Ok(heat)
}

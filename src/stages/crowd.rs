//! What the stages that let crowds walk share: how far they are, and what they have to say about it.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::domain::crowd::{CrowdConfig, Summary};
use crate::kinds::Outline;
use crate::pipeline::stage::Context;

/// Goals that are nearer than asked for are spoken of if more than this share of the paths have one.
const NEAR_GOALS: f64 = 0.05;

/// Estimates what the samples of episodes take that have a number of steps and at least `least` agents, as they are
/// simulated and as they are written.
pub fn bytes(crowd: &CrowdConfig, least: usize, episodes: u32, steps: usize, map: &Outline) -> u64 {
    const SAMPLE: u64 = 160;
    // All of the map's area, where only the free floor counts: rather too much than too little.
    let area = map.rows as f64 * map.positive("resolution").unwrap_or(0.0).powi(2);
    let [_, most] = crowd.agents_on(area);
    let agents = most.max(least) as u64;
    agents.saturating_mul(u64::from(episodes)).saturating_mul(steps as u64).saturating_mul(SAMPLE)
}

/// Counts the steps of episodes that are computed side by side.
pub struct Steps<'a> {
    context: &'a Context<'a>,
    done: AtomicU64,
    total: u64,
    /// Steps of an episode; what is drawn again beyond them does not count.
    each: u64,
}

impl<'a> Steps<'a> {
    /// Starts to count towards a number of episodes of `each` steps.
    pub fn new(context: &'a Context<'a>, episodes: u32, each: usize) -> Self {
        let total = u64::from(episodes) * each as u64;
        (context.progress)(0, total);
        Self { context, done: AtomicU64::new(0), total, each: each as u64 }
    }

    /// Computes an episode, which is handed what to call after each of its steps.
    pub fn episode<T>(&self, compute: impl FnOnce(&mut dyn FnMut() -> ControlFlow<()>) -> T) -> T {
        let mut counted = 0;
        let found = compute(&mut || {
            if (self.context.cancelled)() {
                return ControlFlow::Break(());
            }
            if counted < self.each {
                counted += 1;
                self.add(1);
            }
            ControlFlow::Continue(())
        });
        self.add(self.each - counted);
        found
    }

    fn add(&self, steps: u64) {
        let done = self.done.fetch_add(steps, Ordering::Relaxed) + steps;
        (self.context.progress)(done, self.total);
    }
}

/// Says where a crowd was not what was asked for.
pub fn warn(context: &Context, config: &CrowdConfig, summary: &Summary) {
    warnings(config, summary).into_iter().for_each(|warning| (context.warn)(warning));
}

/// Returns what there is to say where a crowd was not what was asked for.
pub fn warnings(config: &CrowdConfig, summary: &Summary) -> Vec<String> {
    let mut said = Vec::new();
    let &Summary { agents, missing_agents, paths, near_goals, waits, .. } = summary;
    if missing_agents > 0 {
        let asked = agents + missing_agents;
        said.push(format!(
            "there was room for only {agents} of {asked} agents: ask for fewer `agents` or a smaller `radius`"
        ));
    }
    if near_goals as f64 > NEAR_GOALS * paths as f64 {
        let distance = config.goal_distance;
        said.push(format!(
            "{near_goals} of {paths} goals are less than `goal_distance: {distance}` (m) of way off: the map is too small for it"
        ));
    }
    if waits > 0 {
        said.push(format!("agents found no goal to go to {waits} times and waited for one"));
    }
    said
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::crowd::Preset;

    /// Returns the estimate for 20 episodes of 500 steps on so many square meters, in cells of 0.1 m.
    fn check(crowd: &CrowdConfig, area: u64, agents: u64) {
        let metadata = [("resolution".to_owned(), "0.1".to_owned())].into();
        let map = Outline { rows: area * 100, metadata, ..Outline::default() };
        assert_eq!(bytes(crowd, 1, 20, 500, &map), agents * 20 * 500 * 160, "{area} m²");
    }

    #[test]
    fn memory_is_that_of_the_agents_there_will_be() {
        // One agent for each 8 m², whatever `agents` says, up to the most that an episode may have.
        check(&Preset::Igibson.config(), 4000, 500);
        check(&Preset::Igibson.config(), 10_000, 999);
        check(&Preset::Igibson.config(), 40, 5);
        // Eight at most up to 200 m², and in proportion beyond.
        check(&CrowdConfig::default(), 100, 8);
        check(&CrowdConfig::default(), 2000, 80);
        check(&CrowdConfig { agents: [5, 30], agents_area: None, ..CrowdConfig::default() }, 2000, 30);
    }

    #[test]
    fn the_robot_and_those_it_must_have_around_it_count() {
        let alone = CrowdConfig { agents: [1, 2], agents_area: None, ..CrowdConfig::default() };
        assert_eq!(bytes(&alone, 6, 1, 1, &Outline::default()), 6 * 160);
    }
}

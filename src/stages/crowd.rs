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
    let &Summary { agents, missing_agents, paths, near_goals, waits, .. } = summary;
    if missing_agents > 0 {
        let asked = agents + missing_agents;
        (context.warn)(format!(
            "there was room for only {agents} of {asked} agents: ask for fewer `agents` or a smaller `radius`"
        ));
    }
    if near_goals as f64 > NEAR_GOALS * paths as f64 {
        let distance = config.goal_distance;
        (context.warn)(format!(
            "{near_goals} of {paths} goals are less than `goal_distance: {distance}` (m) of way off: the map is too small for it"
        ));
    }
    if waits > 0 {
        (context.warn)(format!("agents found no goal to go to {waits} times and waited for one"));
    }
}

//! Has it foreseen, beside the first tasks, what a run will take.

use std::sync::mpsc::Sender;
use std::thread::{Builder, Scope};

use super::scheduler::Scheduler;
use super::worker::Message;
use crate::pipeline::forecast::foresee;
use crate::pipeline::plan::of_ledger;

impl<'a> Scheduler<'a> {
    /// Sends what is foreseen as soon as it is; a run that cannot be foreseen is no worse.
    pub(super) fn foresee<'scope>(&self, scope: &'scope Scope<'scope, '_>, sender: &Sender<Message>)
    where
        'a: 'scope,
    {
        let (plan, pipeline) = (of_ledger(&self.ledger), self.ledger.graph.pipeline);
        let (store, jobs, sender) = (self.store(), self.jobs(), sender.clone());
        let _ = Builder::new().name("forecast".to_owned()).spawn_scoped(scope, move || {
            if let Ok(forecast) = foresee(pipeline, &plan, store, jobs) {
                let _ = sender.send(Message::Foreseen(forecast.recorded()));
            }
        });
    }
}

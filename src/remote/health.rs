//! Remembers whether a shared store answers, and says once that it does not.

use std::sync::Mutex;

use super::error::{Fault, RemoteError};

/// How a shared store has behaved so far.
#[derive(Debug)]
pub(super) struct Health {
    address: String,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    away: Option<String>,
    /// Why it takes nothing.
    read_only: Option<String>,
    /// Whether it has answered anything.
    answered: bool,
    told_of_denial: bool,
    news: Vec<String>,
}

impl Health {
    pub(super) fn new(address: &str, read_only: bool) -> Self {
        let state =
            State { read_only: read_only.then(|| "it was said to be read-only".to_owned()), ..State::default() };
        Self { address: address.to_owned(), state: Mutex::new(state) }
    }

    fn state(&self) -> std::sync::MutexGuard<'_, State> {
        self.state.lock().expect("nothing panics while it holds this lock")
    }

    /// Returns why it is not asked any more, if it is not.
    pub(super) fn away(&self) -> Option<RemoteError> {
        let why = self.state().away.clone()?;
        let help = help(&why);
        Some(RemoteError::Away { address: self.address.clone(), why, help })
    }

    /// Returns why nothing is given to it, if so.
    pub(super) fn read_only(&self) -> Option<RemoteError> {
        let why = self.state().read_only.clone()?;
        Some(RemoteError::ReadOnly { address: self.address.clone(), why })
    }

    /// Notes that it has answered.
    pub(super) fn answered(&self) {
        self.state().answered = true;
    }

    /// Notes that it takes nothing, and says so unless it was known.
    pub(super) fn refuses(&self, why: String) {
        let mut state = self.state();
        if state.read_only.is_none() {
            state.news.push(format!("the shared store `{}` takes nothing: {why}; it is only read", self.address));
            state.read_only = Some(why);
        }
    }

    /// Notes what came of a reading request that brought nothing. Nobody asks again once there was no answer.
    pub(super) fn failed_to_read(&self, fault: Fault) {
        let mut state = self.state();
        match fault {
            Fault::Absent | Fault::Interrupted => {}
            // Who may not list a bucket is told that of everything that is not there.
            Fault::Denied(_) if state.answered => {
                if !std::mem::replace(&mut state.told_of_denial, true) {
                    state.news.push(format!(
                        "the shared store `{}` denies the reading of what may only be missing (the right to list it would \
                         tell); it counts as missing",
                        self.address
                    ));
                }
            }
            Fault::Denied(why) | Fault::Away(why) => state.leave(&self.address, why),
        }
    }

    /// Notes what came of a writing request that failed.
    pub(super) fn failed_to_write(&self, fault: Fault) {
        match fault {
            Fault::Interrupted => {}
            Fault::Denied(why) => self.refuses(why),
            Fault::Absent => self.state().leave(&self.address, "there is no such bucket".to_owned()),
            Fault::Away(why) => self.state().leave(&self.address, why),
        }
    }

    /// Returns what there is to say since the last call.
    pub(super) fn news(&self) -> Vec<String> {
        std::mem::take(&mut self.state().news)
    }
}

impl State {
    fn leave(&mut self, address: &str, why: String) {
        if self.away.is_none() {
            let help = help(&why).map_or_else(String::new, |help| format!("; {help}"));
            self.news.push(format!("the shared store `{address}` does not answer, it goes on without: {why}{help}"));
            self.away = Some(why);
        }
    }
}

/// Returns what helps against what is a matter of settings.
fn help(why: &str) -> Option<&'static str> {
    const CREDENTIALS: &str = "set the credentials of the environment (`AWS_ACCESS_KEY_ID` and `AWS_SECRET_ACCESS_KEY`; \
        `eval \"$(aws configure export-credentials --format env)\"` takes those of a profile)";
    // The address at which machines of a cloud find their role.
    if why.contains("169.254.169.254") || why.contains("InvalidAccessKeyId") || why.contains("SignatureDoesNotMatch") {
        return Some(CREDENTIALS);
    }
    None
}

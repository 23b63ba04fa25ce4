//! Finds the runs that were given to a shared store.

use object_store::path::Path;

use super::error::{Fault, RemoteError};
use super::{Header, Remote, limits};
use crate::store::{Received, Run};

impl Remote {
    /// Lists the ids of the runs that were given to it, the newest last: an id begins with its time.
    ///
    /// # Errors
    /// If it does not answer.
    pub fn run_ids(&self) -> Result<Vec<String>, RemoteError> {
        if self.header()? == Header::None {
            return Ok(Vec::new());
        }
        self.folders(&self.layout.runs())
    }

    /// Lists the folders that stand directly below one, in order.
    pub(super) fn folders(&self, below: &Path) -> Result<Vec<String>, RemoteError> {
        let list = || self.bridge.ask(limits::SMALL, self.backend.list_with_delimiter(Some(below)));
        let listed = self.patience.with(list).map_err(|fault| self.failed_to_read(fault))?;
        let mut names: Vec<String> =
            listed.common_prefixes.iter().filter_map(|path| Some(path.filename()?.to_owned())).collect();
        names.sort_unstable();
        Ok(names)
    }

    /// Reads a run by its id, the beginning of it, or `latest`.
    ///
    /// # Errors
    /// If there is none, if several begin like that, if the record is damaged, or if the store does not answer.
    pub fn run(&self, id: &str) -> Result<Run, RemoteError> {
        let none = || RemoteError::NoRun { address: self.address.clone(), id: id.to_owned() };
        let mut ids = self.run_ids()?;
        let mut matches: Vec<String> = match id {
            "" => return Err(none()),
            "latest" => ids.pop().into_iter().collect(),
            whole if ids.iter().any(|known| known == whole) => vec![whole.to_owned()],
            prefix => ids.into_iter().filter(|known| known.starts_with(prefix)).collect(),
        };
        match matches.len() {
            0 => Err(none()),
            1 => self.read_run(&matches.remove(0))?.ok_or_else(none),
            _ => Err(RemoteError::AmbiguousRun { id: id.to_owned(), matches }),
        }
    }

    /// Reads the record of a run by its whole id.
    pub(super) fn read_run(&self, id: &str) -> Result<Option<Run>, RemoteError> {
        let record = |how| RemoteError::Record { address: self.address.clone(), what: format!("the run {id}"), how };
        match self.read(&self.layout.run(id)) {
            Ok(text) => match Run::from_text(id, &text) {
                Received::Good(run) => Ok(Some(run)),
                Received::Newer => Err(record("of a newer version")),
                Received::Damaged => Err(record("damaged")),
            },
            Err(Fault::Absent) => Ok(None),
            Err(fault) => Err(self.failed_to_read(fault)),
        }
    }
}

//! `watch`: runs a pipeline, and again whenever its file or a source file changes.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use serde_json::json;

use super::error::CliError;
use super::how::HowArgs;
use super::request::{Known, PipelineArgs};
use super::screen::Screen;
use super::selection::{NAMES, SelectionArgs};
use super::signals;
use super::upward::StorePlace;
use crate::pipeline::error::PipelineError;
use crate::pipeline::execute::timestamp;
use crate::pipeline::plan::Lookups;
use crate::pipeline::spec::{Pipeline, check_sources};
use crate::pipeline::stage::Register;
use crate::store::{Digest, Store, read_bounded};

/// How often files are looked at.
const EVERY: Duration = Duration::from_millis(500);
/// How long files must stay as they are before a run: editors and copies write in several steps.
const SETTLED: Duration = Duration::from_millis(250);
/// The most bytes of a pipeline file that are compared.
const LARGEST: u64 = 16 << 20;
/// The most files that are told to have changed.
const SHOWN: usize = 5;

/// Arguments of `watch`.
#[derive(Debug, clap::Args)]
#[command(after_help = format!("It looks at the pipeline file and at the files that its nodes read twice a second, also for new ones that its patterns find. A run that goes on when something changes is finished first. What is wrong with the file is shown, and it waits for the next change. Ctrl-C ends it; a run that goes on then stops at the next safe point and is kept.

{NAMES}

Examples:
  trodden watch pipelines/quickstart.yaml
  trodden watch pipelines/quickstart.yaml --only scores --set model.epochs=1

Exit codes: 0 ended by Ctrl-C while it waited, 130 while it ran; 2 a bad request, 3 a damaged store."))]
pub struct Args {
    #[command(flatten)]
    pipeline: PipelineArgs,
    #[command(flatten)]
    selection: SelectionArgs,
    #[command(flatten)]
    how: HowArgs,
}

/// What the files look like, and what the pipeline file says.
struct Look {
    /// Digests by path; `None` for a file that cannot be read.
    files: BTreeMap<PathBuf, Option<Digest>>,
    pipeline: Result<Pipeline, CliError>,
}

impl Args {
    pub(super) fn run(&self, register: &Register, place: &StorePlace, screen: &Screen) -> Result<ExitCode, CliError> {
        let file = self.pipeline.file()?;
        let root = &*place.root_for(&file);
        let cancelled = Arc::new(AtomicBool::new(false));
        signals::listen(&cancelled);
        let stopped = || cancelled.load(Ordering::Relaxed);
        let mut look = self.look(&file, register, &Known::at(root)?)?;
        loop {
            match &look.pipeline {
                Ok(pipeline) => {
                    let store = Store::open_until(root, &cancelled)?;
                    let remote = self.how.remote(pipeline, &cancelled)?;
                    let options = self.how.options((&self.selection).into(), remote.as_ref(), &cancelled)?;
                    match self.how.run(pipeline, &store, (&options, remote.as_ref()), false, screen) {
                        Ok((code, _)) if stopped() => return Ok(code),
                        Ok(_) => {}
                        // A name that the file has no longer, or a file that is gone: a change may mend it.
                        Err(error @ CliError::Pipeline(_)) => faulty(&error, screen)?,
                        Err(error) => return Err(error),
                    }
                }
                Err(error) => faulty(error, screen)?,
            }
            if screen.json() {
                screen.object(&json!({ "event": "watching", "files": look.files.len(), "time": timestamp() }))?;
                screen.flush()?;
            } else {
                let files =
                    if look.files.len() == 1 { "1 file".to_owned() } else { format!("{} files", look.files.len()) };
                screen.remark(format!("watching {files}; Ctrl-C ends it"));
            }
            let Some(next) = self.next(&look, (&file, register, root), &cancelled)? else {
                return Ok(ExitCode::SUCCESS);
            };
            tell(&changed(&look.files, &next.files), screen)?;
            look = next;
        }
    }

    /// Waits until the files look otherwise and have settled; `None` if it is to stop.
    fn next(
        &self,
        now: &Look,
        (file, register, root): (&Path, &Register, &Path),
        stop: &AtomicBool,
    ) -> Result<Option<Look>, CliError> {
        // One for all looks: it knows of files that have not changed without reading them.
        let known = Known::at(root)?;
        loop {
            if !signals::wait(EVERY, stop) {
                return Ok(None);
            }
            let mut next = self.look(file, register, &known)?;
            if next.files == now.files {
                continue;
            }
            loop {
                if !signals::wait(SETTLED, stop) {
                    return Ok(None);
                }
                let later = self.look(file, register, &known)?;
                let settled = later.files == next.files;
                next = later;
                if settled {
                    break;
                }
            }
            if next.files != now.files {
                return Ok(Some(next));
            }
        }
    }

    /// Looks at the pipeline file and at all files that its nodes read.
    fn look(&self, file: &Path, register: &Register, known: &Known) -> Result<Look, CliError> {
        let mut files = BTreeMap::new();
        let text = read_bounded(file, LARGEST).ok();
        files.insert(file.to_owned(), text.map(|text| Digest::of(&text)));
        let pipeline = self.pipeline.load(register);
        if let Ok(pipeline) = &pipeline {
            for source in pipeline.nodes.iter().filter_map(|node| node.stage.sources().ok()).flatten() {
                files.entry(source.path).or_insert_with_key(|path| known.source_digest(path).ok());
            }
        }
        let pipeline = pipeline.and_then(|pipeline| {
            check_sources(&pipeline)?;
            Ok(pipeline)
        });
        Ok(Look { files, pipeline })
    }
}

/// Says what is wrong with the file, as `check` does.
fn faulty(error: &CliError, screen: &Screen) -> Result<(), CliError> {
    if screen.json() {
        screen.object(&json!({
            "event": "faulty", "message": error.message(), "help": error.help(), "time": timestamp()
        }))?;
    } else if let CliError::Pipeline(error @ PipelineError::Spec(_)) = error {
        screen.complain(&error.render(screen.color()));
    } else {
        screen.error(&error.message(), error.help().as_deref(), error.code());
    }
    Ok(())
}

/// Lists the files that are new, gone or otherwise, with a word for which.
fn changed(
    before: &BTreeMap<PathBuf, Option<Digest>>,
    after: &BTreeMap<PathBuf, Option<Digest>>,
) -> Vec<(&'static str, PathBuf)> {
    let gone = before.keys().filter(|path| !after.contains_key(*path)).map(|path| ("gone", path.clone()));
    let here = after.iter().filter_map(|(path, digest)| match before.get(path) {
        None => Some(("new", path.clone())),
        Some(Some(_)) if digest.is_none() => Some(("gone", path.clone())),
        Some(other) if other != digest => Some(("changed", path.clone())),
        Some(_) => None,
    });
    gone.chain(here).collect()
}

fn tell(changed: &[(&'static str, PathBuf)], screen: &Screen) -> Result<(), CliError> {
    if screen.json() {
        let files: Vec<_> = changed.iter().map(|(what, path)| json!({ "file": path, "what": what })).collect();
        return screen.object(&json!({ "event": "changed", "files": files, "time": timestamp() }));
    }
    for (what, path) in changed.iter().take(SHOWN) {
        screen.remark(format!("{what}: {}", path.display()));
    }
    if changed.len() > SHOWN {
        screen.remark(format!("and {} more", changed.len() - SHOWN));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_changed_is_new_gone_or_otherwise() {
        let files = |files: &[(&str, Option<&str>)]| -> BTreeMap<PathBuf, Option<Digest>> {
            let digest = |text: &str| Digest::of(text.as_bytes());
            files.iter().map(|(path, text)| (PathBuf::from(path), text.map(digest))).collect()
        };
        let before = files(&[("a", Some("1")), ("b", Some("1")), ("c", Some("1")), ("d", None), ("e", Some("1"))]);
        let after = files(&[("a", Some("1")), ("b", Some("2")), ("c", None), ("d", Some("1")), ("f", Some("1"))]);
        let found = changed(&before, &after);
        let found: Vec<(&str, &str)> =
            found.iter().map(|(what, path)| (*what, path.to_str().expect("is text"))).collect();
        assert_eq!(found, [("gone", "e"), ("changed", "b"), ("gone", "c"), ("changed", "d"), ("new", "f")]);
        assert_eq!(changed(&after, &after), []);
    }
}

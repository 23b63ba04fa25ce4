//! `gc`: removes what no run needs any more.

use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use super::error::CliError;
use super::request::{age, size};
use super::screen::{Screen, bytes};
use super::signals;
use crate::remote::{Remote, RemoteCollect, RemoteCollected};
use crate::store::{Collect, Collected, DAY, Evict, Evicted, Freed, Store};

/// Arguments of `gc`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Kept is what these runs reach: of each pipeline (a name and a file) the newest run that finished everything and the newest run of any kind, so that an interrupted, failed or killed one goes on where it was; every run that is going on; every run marked by `trodden keep`. Of the epochs of a finished training only the last is kept. What is younger than a day is kept, too.

With `--remote` it collects in a shared store. Kept there is what these reach: the newest run of each pipeline that was pushed and the newest of them that finished everything, runs that were marked by `trodden keep` when they were pushed, and runs and recipes younger than `--older-than`. What is younger than `--grace` stays whatever it is.

On a terminal it shows what would go and asks; elsewhere it does not ask. Records and reports of runs stay: see `trodden runs prune`.

Examples:
  trodden gc --dry-run          what would go
  trodden gc                    the same, a question, and then it goes
  trodden gc --older-than 0s    whatever its age, for example when the disk is full
  trodden gc --keep-last 5      the newest five full runs of each pipeline count
  trodden gc --max-size 10GiB   only as much as it takes to make the artifacts fit, what was not used for longest first
  trodden gc --remote s3://lab/trodden --older-than 90d --dry-run"
)]
pub struct Args {
    /// Collect in this shared store instead: `s3://BUCKET/PREFIX`, `gs://…`, `az://…` or a folder.
    #[arg(long, value_name = "URL")]
    remote: Option<String>,
    /// Only show what would go; writes nothing.
    #[arg(long)]
    dry_run: bool,
    /// Keep what is younger: `30m`, `12h`, `1d`, `2w`; `0s` keeps nothing for its age [default: 1d, in a shared store 30d].
    #[arg(long, value_name = "AGE", value_parser = age)]
    older_than: Option<Duration>,
    /// Free artifacts that no run needs only until all others fit into this (`10GiB`), first what was not used for longest.
    #[arg(long, value_name = "SIZE", value_parser = size, conflicts_with = "remote")]
    max_size: Option<u64>,
    /// Keep what this many of the newest full runs of each pipeline reach.
    #[arg(long, value_name = "N", default_value_t = 1, conflicts_with = "remote")]
    keep_last: usize,
    /// In a shared store keep what is younger whatever it is: uploads under way end within that time.
    #[arg(long, value_name = "AGE", default_value = "1d", value_parser = age, requires = "remote")]
    grace: Duration,
    /// Do not ask.
    #[arg(long, short)]
    yes: bool,
}

impl Args {
    pub(super) fn run(&self, store: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        if let Some(address) = &self.remote {
            return self.run_remote(address, screen);
        }
        let store = Store::open_existing(store)?;
        if let Some(max_bytes) = self.max_size {
            return self.fit(&store, max_bytes, screen);
        }
        let older_than = self.older_than.unwrap_or(DAY);
        let asked = |dry_run| Collect { dry_run, older_than, keep_last: self.keep_last };
        let planned = store.collect(&asked(true))?;
        if !screen.json() {
            describe(&planned, screen)?;
        }
        let goes = !self.dry_run && planned.files() > 0;
        let done = if goes && (self.yes || screen.ask(&format!("free {}?", bytes(planned.bytes())))?) {
            let done = store.collect(&asked(false))?;
            if !screen.json() {
                screen.line(format!("freed {}", bytes(done.bytes())))?;
            }
            Some(done)
        } else {
            None
        };
        if screen.json() {
            screen.object(&json(done.as_ref().unwrap_or(&planned), done.is_none()))?;
        }
        Ok(ExitCode::SUCCESS)
    }

    /// Frees only as much as it takes to fit.
    fn fit(&self, store: &Store, max_bytes: u64, screen: &Screen) -> Result<ExitCode, CliError> {
        let older_than = self.older_than.unwrap_or(DAY);
        let asked = |dry_run| Evict { max_bytes, older_than, keep_last: self.keep_last, dry_run };
        let planned = store.evict(&asked(true))?;
        let size = bytes(planned.freed.bytes);
        if !screen.json() {
            screen.line(format!(
                "would free {} objects, {size}; {}",
                planned.freed.files,
                left(&planned, max_bytes)
            ))?;
        }
        let goes = !self.dry_run && planned.freed.files > 0;
        let done = goes && (self.yes || screen.ask(&format!("free {size}?"))?);
        let evicted = if done { store.evict(&asked(false))? } else { planned };
        if screen.json() {
            let part = |freed: &Freed| serde_json::json!({ "files": freed.files, "bytes": freed.bytes });
            screen.object(&serde_json::json!({
                "dry_run": !done,
                "objects": part(&evicted.freed),
                "left": part(&evicted.left),
                "needed": part(&evicted.needed),
                "young": part(&evicted.young),
                "max_bytes": max_bytes,
                "fits": evicted.fits,
            }))?;
        } else if done {
            screen.line(format!("freed {}", bytes(evicted.freed.bytes)))?;
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Says what is left, and why that does not fit if it does not.
fn left(evicted: &Evicted, max_bytes: u64) -> String {
    let all = bytes(evicted.left.bytes);
    if evicted.fits {
        return format!("{all} are left and fit into {}", bytes(max_bytes));
    }
    let mut reasons = vec![format!("runs need {}", bytes(evicted.needed.bytes))];
    if evicted.young.files > 0 {
        reasons.push(format!("{} are not old enough, see `--older-than`", bytes(evicted.young.bytes)));
    }
    format!("{all} are left, which is more than {}: {}", bytes(max_bytes), reasons.join(", "))
}

impl Args {
    fn run_remote(&self, address: &str, screen: &Screen) -> Result<ExitCode, CliError> {
        let stop = Arc::new(AtomicBool::new(false));
        let remote = Remote::open(address, Path::new(""), false, &stop)?;
        signals::listen(&stop);
        let older_than = self.older_than.unwrap_or(DAY * 30);
        let asked = |dry_run| RemoteCollect { dry_run, older_than, grace: self.grace };
        let planned = remote.collect(&asked(true))?;
        if !screen.json() {
            describe_remote(&planned, screen)?;
        }
        let goes = !self.dry_run && planned.files() > 0;
        let goes = goes && (self.yes || screen.ask(&format!("free {} in {address}?", bytes(planned.bytes())))?);
        let done = goes.then(|| remote.collect(&asked(false))).transpose()?;
        if screen.json() {
            let (part, of) = (freed, done.as_ref().unwrap_or(&planned));
            screen.object(&serde_json::json!({
                "remote": remote.address(), "dry_run": done.is_none(), "objects": part(&of.objects),
                "recipes": part(&of.recipes), "runs": part(&of.runs), "kept": part(&of.kept), "young": part(&of.young),
                "kept_runs": of.kept_runs,
            }))?;
        } else if let Some(done) = &done {
            screen.line(format!("freed {}", bytes(done.bytes())))?;
        }
        Ok(ExitCode::SUCCESS)
    }
}

fn describe_remote(planned: &RemoteCollected, screen: &Screen) -> Result<(), CliError> {
    headline(planned.files(), planned.bytes(), screen)?;
    line("objects", &planned.objects, screen)?;
    line("recipes", &planned.recipes, screen)?;
    line("records of runs", &planned.runs, screen)?;
    keeps(&planned.kept, &planned.kept_runs, screen)?;
    if planned.young.files > 0 {
        let Freed { files, bytes: size } = planned.young;
        screen.line(format!("{files} files, {}, are kept only for their age: see `--grace`", bytes(size)))?;
    }
    Ok(())
}

fn headline(files: u64, size: u64, screen: &Screen) -> Result<(), CliError> {
    if files == 0 { screen.line("nothing to free") } else { screen.line(format!("would free {}:", bytes(size))) }
}

fn line(what: &str, freed: &Freed, screen: &Screen) -> Result<(), CliError> {
    if freed.files == 0 {
        return Ok(());
    }
    screen.line(format!("{:>7} {what}, {}", freed.files, bytes(freed.bytes)))
}

fn keeps(kept: &Freed, runs: &[String], screen: &Screen) -> Result<(), CliError> {
    let runs = if runs.is_empty() { "no run".to_owned() } else { runs.join(", ") };
    screen.line(format!("keeps {} files, {}, for {runs}", kept.files, bytes(kept.bytes)))
}

fn freed(freed: &Freed) -> serde_json::Value {
    serde_json::json!({ "files": freed.files, "bytes": freed.bytes })
}

fn describe(planned: &Collected, screen: &Screen) -> Result<(), CliError> {
    let line = |what: &str, freed: &Freed| line(what, freed, screen);
    headline(planned.files(), planned.bytes(), screen)?;
    line("objects", &planned.objects)?;
    line("recipes", &planned.recipes)?;
    line("temporary files", &planned.temporary)?;
    line("damaged files", &planned.damaged)?;
    line("logs of commands", &planned.logs)?;
    line("files of runs without a record", &planned.runs)?;
    line("cached pictures of reports", &planned.cache)?;
    keeps(&planned.kept, &planned.kept_runs, screen)?;
    if planned.young.files > 0 {
        let Freed { files, bytes: size } = planned.young;
        let size = bytes(size);
        screen.line(format!("{files} files, {size}, are kept only for their age: see `--older-than`"))?;
    }
    Ok(())
}

fn json(collected: &Collected, dry_run: bool) -> serde_json::Value {
    let part = freed;
    serde_json::json!({
        "dry_run": dry_run,
        "objects": part(&collected.objects),
        "recipes": part(&collected.recipes),
        "temporary": part(&collected.temporary),
        "damaged": part(&collected.damaged),
        "runs": part(&collected.runs),
        "logs": part(&collected.logs),
        "cache": part(&collected.cache),
        "kept": part(&collected.kept),
        "young": part(&collected.young),
        "kept_runs": collected.kept_runs,
    })
}

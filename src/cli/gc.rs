//! `gc`: removes what no run needs any more.

use std::path::Path;
use std::process::ExitCode;

use super::error::CliError;
use super::screen::{Screen, bytes};
use crate::store::{Collected, Freed, Store};

/// Arguments of `gc`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Kept is what the newest finished run of each pipeline and every run marked by `trodden keep` reaches; of the epochs of a training only the last.

Examples:
  trodden gc --dry-run    what would go
  trodden gc              the same, and then it goes"
)]
pub struct Args {
    /// Only show what would go.
    #[arg(long)]
    dry_run: bool,
}

impl Args {
    pub(super) fn run(&self, store: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        let store = Store::open_existing(store)?;
        let planned = store.collect(true)?;
        if screen.json() {
            let done = if self.dry_run { planned } else { store.collect(false)? };
            screen.object(&json(&done, self.dry_run))?;
            return Ok(ExitCode::SUCCESS);
        }
        describe(&planned, screen)?;
        if !self.dry_run && total(&planned).files > 0 {
            let done = store.collect(false)?;
            screen.line(format!("freed {}", bytes(total(&done).bytes)))?;
        }
        Ok(ExitCode::SUCCESS)
    }
}

fn describe(planned: &Collected, screen: &Screen) -> Result<(), CliError> {
    let line = |what: &str, freed: &Freed| {
        if freed.files == 0 {
            return Ok(());
        }
        screen.line(format!("{:>7} {what}, {}", freed.files, bytes(freed.bytes)))
    };
    let all = total(planned);
    screen.line(if all.files == 0 {
        "nothing to free".to_owned()
    } else {
        format!("would free {}:", bytes(all.bytes))
    })?;
    line("objects", &planned.objects)?;
    line("recipes", &planned.recipes)?;
    line("temporary files", &planned.temporary)?;
    line("damaged files", &planned.damaged)?;
    line("files of older runs", &planned.runs)?;
    line("cached pictures of reports", &planned.cache)?;
    let kept = if planned.kept_runs.is_empty() { "no run".to_owned() } else { planned.kept_runs.join(", ") };
    screen.line(format!("keeps {} files, {}, for {kept}", planned.kept.files, bytes(planned.kept.bytes)))
}

fn total(collected: &Collected) -> Freed {
    Freed { files: collected.files(), bytes: collected.bytes() }
}

fn json(collected: &Collected, dry_run: bool) -> serde_json::Value {
    let part = |freed: &Freed| serde_json::json!({ "files": freed.files, "bytes": freed.bytes });
    serde_json::json!({
        "dry_run": dry_run,
        "objects": part(&collected.objects),
        "recipes": part(&collected.recipes),
        "temporary": part(&collected.temporary),
        "damaged": part(&collected.damaged),
        "runs": part(&collected.runs),
        "cache": part(&collected.cache),
        "kept": part(&collected.kept),
        "kept_runs": collected.kept_runs,
    })
}

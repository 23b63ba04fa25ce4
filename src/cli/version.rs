//! `version`: what this program is, and what it can compute with here.

use std::process::ExitCode;
use std::sync::OnceLock;

use super::error::CliError;
use super::screen::Screen;
use crate::domain::unet::{DeviceName, Simd};
use crate::pipeline::event::SCHEMA;
use crate::stages::compute;

/// Arguments of `version`.
#[derive(Debug, clap::Args)]
#[command(after_help = "The commit is known if TRODDEN_COMMIT named it when the program was built.

Examples:
  trodden version
  trodden version --json | jq -r .commit")]
pub struct Args {}

/// The commit that the program was built from. Whoever builds says so: asking git would build everything anew after each
/// commit, and elsewhere than in a clone there is none to ask.
const COMMIT: Option<&str> = option_env!("TRODDEN_COMMIT");

/// The parts that a build may have or not.
const FEATURES: [(&str, bool); 9] = [
    ("azure", cfg!(feature = "azure")),
    ("cuda", cfg!(feature = "cuda")),
    ("gcs", cfg!(feature = "gcs")),
    ("ndarray", cfg!(feature = "ndarray")),
    ("pages", cfg!(feature = "pages")),
    ("python", cfg!(feature = "python")),
    ("s3", cfg!(feature = "s3")),
    ("sql", cfg!(feature = "sql")),
    ("wgpu", cfg!(feature = "wgpu")),
];

fn commit() -> Option<&'static str> {
    COMMIT.filter(|commit| !commit.is_empty())
}

/// Returns the version, with the commit if it is known.
pub(super) fn short() -> &'static str {
    static SHORT: OnceLock<String> = OnceLock::new();
    let version = env!("CARGO_PKG_VERSION");
    SHORT.get_or_init(|| commit().map_or_else(|| version.to_owned(), |commit| format!("{version} ({commit})")))
}

impl Args {
    pub(super) fn run(&self, screen: &Screen) -> Result<ExitCode, CliError> {
        let features: Vec<&str> = FEATURES.into_iter().filter_map(|(name, is_in)| is_in.then_some(name)).collect();
        let sets: Vec<&str> = Simd::ALL.into_iter().filter(|simd| simd.is_available()).map(Simd::name).collect();
        let devices = DeviceName::ALL.map(|device| (device.name(), compute::open(device, None)));
        if screen.json() {
            let device = |(name, opened): &(&str, Result<_, _>)| match opened {
                Ok(compute) => serde_json::json!({ "name": name, "computes": format!("{compute}") }),
                Err(error) => serde_json::json!({ "name": name, "error": format!("{error}") }),
            };
            screen.object(&serde_json::json!({
                "version": env!("CARGO_PKG_VERSION"),
                "commit": commit(),
                "schema": SCHEMA,
                "features": features,
                "instruction_sets": sets,
                "devices": devices.iter().map(device).collect::<Vec<_>>(),
                "os": std::env::consts::OS,
                "arch": std::env::consts::ARCH,
            }))?;
            return Ok(ExitCode::SUCCESS);
        }
        let listed = |names: &[&str]| if names.is_empty() { "none".to_owned() } else { names.join(", ") };
        screen.line(format!("trodden {}", short()))?;
        screen.line(format!("features: {}", listed(&features)))?;
        screen.line(format!("instruction sets: {}", listed(&sets)))?;
        for (name, opened) in &devices {
            match opened {
                Ok(compute) => screen.line(format!("device {name}: computes as {compute}"))?,
                Err(error) => screen.line(format!("device {name}: {error}"))?,
            }
        }
        Ok(ExitCode::SUCCESS)
    }
}

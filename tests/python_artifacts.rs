//! Every artifact opens in pandas, polars, DuckDB and PedPy: `tests/python/open_artifacts.py` over a finished run.

use std::path::{Path, PathBuf};
use std::process::Command;

use super::needs::Need;
use super::promises::{Place, Told};

/// The Python with what `tests/python/requirements.txt` lists: `TRODDEN_PYTHON`, or that of `.venv` in the repository.
pub fn python() -> Option<PathBuf> {
    let ours = Path::new(env!("CARGO_MANIFEST_DIR")).join(".venv/bin/python");
    std::env::var_os("TRODDEN_PYTHON").map(PathBuf::from).or_else(|| ours.exists().then_some(ours))
}

#[test]
fn python_opens_every_artifact() {
    let Some(python) = python() else {
        Need::Python.missing("there is no `.venv/bin/python`, and `TRODDEN_PYTHON` names none");
        return;
    };
    let place = Place::finished();
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/open_artifacts.py");
    let kinds = [
        "OccupancyMap",
        "Trajectories",
        "VisitCounts",
        "Labels",
        "Tiles",
        "Checkpoint",
        "TrainingMetrics",
        "Heat",
        "NavEpisodes",
        "ClassScores",
        "SocialCosts",
    ];
    let told = Told::of(Command::new(python).arg(script).arg(place.at("artifacts/latest/tiny")).args(kinds));
    assert_eq!(told.code, 0, "{}{}", told.stdout, told.stderr);
    println!("{}", told.stdout);
}

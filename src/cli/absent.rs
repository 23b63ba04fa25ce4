//! What stands in the place of commands and options whose feature this program was built without: it says so.

use super::error::CliError;

fn absent(feature: &str) -> CliError {
    CliError::advised(
        format!("this program was built without the feature `{feature}`"),
        format!("build it with `--features {feature}`; it is on by default"),
    )
}

/// Without the feature `pages`: as the module `pages` is with it.
#[cfg(not(feature = "pages"))]
pub mod pages {
    use std::path::{Path, PathBuf};

    use super::absent;
    use crate::cli::error::CliError;
    use crate::cli::screen::Screen;
    use crate::domain::geometry::Point;
    use crate::domain::map::OccupancyMap;
    use crate::kinds::{Heat, Placed};
    use crate::report::compare::Section;
    use crate::report::study::{Front, StudyTable};
    use crate::stages::crowd_heat::Walks;
    use crate::stages::track_heat::Recorded;
    use crate::store::{Run, RunNode, Store};

    pub const VIEW: &str = "view.html";

    pub fn check(is_wanted: bool) -> Result<(), CliError> {
        if is_wanted { Err(absent("pages")) } else { Ok(()) }
    }

    pub const fn after_run(_: &Store, _: &Run) -> Result<Option<PathBuf>, CliError> {
        Ok(None)
    }

    pub fn report(_: &Store, _: &Run, _: Option<&Path>) -> Result<(PathBuf, usize), CliError> {
        Err(absent("pages"))
    }

    pub fn of_node(_: &Store, _: &Run, _: &RunNode) -> Result<Option<String>, CliError> {
        Err(absent("pages"))
    }

    pub fn of_study(_: &Store, _: &[Run], _: &StudyTable, _: Option<Front>, _: &str) -> Result<String, CliError> {
        Err(absent("pages"))
    }

    pub fn of_difference(_: &str, _: &[String], _: &[Section]) -> Result<String, CliError> {
        Err(absent("pages"))
    }

    pub struct View;

    impl View {
        pub const fn new(_: &str, _: &OccupancyMap) -> Self {
            Self
        }

        pub const fn heat(self, _: &str, _: &Placed<Heat>) -> Self {
            self
        }

        pub const fn paths(self, _: [(&[Point], &str); 2]) -> Self {
            self
        }

        pub const fn people(self, _: &OccupancyMap, _: &Walks) -> Result<Self, CliError> {
            Ok(self)
        }

        pub fn recorded(self, _: &OccupancyMap, _: Recorded, _: &[PathBuf]) -> Self {
            self
        }

        pub fn file(&self, _: &str, screen: &Screen) -> Option<(&'static str, Vec<u8>)> {
            screen.remark(format!("no `{VIEW}`: {}", absent("pages").message()));
            None
        }
    }
}

/// Without the feature `sql`: a command that takes anything.
#[cfg(not(feature = "sql"))]
pub mod sql {
    use std::ffi::OsString;
    use std::path::Path;
    use std::process::ExitCode;

    use super::absent;
    use crate::cli::error::CliError;
    use crate::cli::screen::Screen;

    /// Arguments of `sql`.
    #[derive(Debug, clap::Args)]
    #[command(after_help = "This program was built without the feature `sql`.")]
    pub struct Args {
        /// The query.
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        query: Vec<OsString>,
    }

    impl Args {
        pub fn run(&self, _: &Path, _: &Screen) -> Result<ExitCode, CliError> {
            Err(absent("sql"))
        }
    }
}

//! The compiled half of the Python package: what its functions in `trodden/` hand on to the other rooms.
//!
//! It is built with the feature `python` alone, as the module `trodden._trodden`, and nobody calls it but the Python files
//! beside it, which say what arguments mean. Tables go out as they are in memory, through Arrow's C data interface and the
//! array interface of numpy, so that neither library is needed to build it.

mod arrow;
mod column;
mod compute;
mod error;
mod maps;
mod table;

use pyo3::prelude::*;

/// What `trodden` computes, for the Python files beside it.
#[pymodule]
mod _trodden {
    use std::ffi::OsString;
    use std::process::ExitCode;

    use pyo3::prelude::*;

    #[pymodule_export]
    use super::column::Column;
    #[pymodule_export]
    use super::compute::{annotate, plan_path, simulate};
    #[pymodule_export]
    use super::maps::{grid_map, read_map};
    #[pymodule_export]
    use super::table::Table;

    /// The version of the package.
    #[pymodule_export]
    #[expect(non_upper_case_globals, reason = "Python calls it so")]
    const __version__: &str = env!("CARGO_PKG_VERSION");

    #[pymodule_init]
    fn init() {
        crate::cli::hush_decoder();
    }

    /// Runs the command with its arguments, the program's name first, and returns its exit code.
    #[pyfunction]
    fn main(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
        let code = py.detach(|| crate::cli::main(&crate::stages::register(), arguments));
        // The standard library compares exit codes, but does not say them.
        (0..=u8::MAX).find(|number| ExitCode::from(*number) == code).expect("an exit code has one of these numbers")
    }
}

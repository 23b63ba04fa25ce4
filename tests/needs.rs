//! What some tests need besides this repository and a C compiler's linker, and what happens where it is missing.
//!
//! A test without what it needs says so and passes, unless `TRODDEN_REQUIRE` names the need (several, with commas between
//! them, or `all`): then it fails. Reference data lie in the folder that `TRODDEN_SHARED` names, by default `../shared`.

use std::path::{Path, PathBuf};
use std::process::Command;

/// What a test may need, as `TRODDEN_REQUIRE` calls it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Need {
    /// Answers of the reference implementation of ORCA.
    Oracle,
    /// Maps of others.
    Maps,
    /// Floor plans of others.
    Plans,
    /// People who were recorded.
    Tracks,
    /// Small inputs that went wrong once.
    Cases,
    /// A Python with what `tests/python/requirements.txt` lists.
    Python,
    /// `chromium`.
    Browser,
    /// `bwrap`, and the right to make namespaces.
    Bwrap,
    /// `unshare`, and the right to mount.
    Unshare,
    /// A C compiler, to build a shim with.
    Cc,
    /// `strace`, and the right to trace.
    Strace,
    /// A processor with AVX-512.
    Avx512,
    /// A GPU, or a driver that does its work on the processor.
    Gpu,
    /// A Python with `moto[server]`, which speaks S3.
    S3,
    /// Slurm, and the right to make namespaces.
    Slurm,
}

impl Need {
    const ALL: [Self; 15] = [
        Self::Oracle,
        Self::Maps,
        Self::Plans,
        Self::Tracks,
        Self::Cases,
        Self::Python,
        Self::Browser,
        Self::Bwrap,
        Self::Unshare,
        Self::Cc,
        Self::Strace,
        Self::Avx512,
        Self::Gpu,
        Self::S3,
        Self::Slurm,
    ];

    const fn name(self) -> &'static str {
        match self {
            Self::Oracle => "oracle",
            Self::Maps => "maps",
            Self::Plans => "plans",
            Self::Tracks => "tracks",
            Self::Cases => "cases",
            Self::Python => "python",
            Self::Browser => "browser",
            Self::Bwrap => "bwrap",
            Self::Unshare => "unshare",
            Self::Cc => "cc",
            Self::Strace => "strace",
            Self::Avx512 => "avx512",
            Self::Gpu => "gpu",
            Self::S3 => "s3",
            Self::Slurm => "slurm",
        }
    }

    /// Says that a test is skipped for want of this, and why.
    ///
    /// # Panics
    /// If `TRODDEN_REQUIRE` names it.
    pub fn missing(self, why: &str) {
        let required = std::env::var("TRODDEN_REQUIRE").unwrap_or_default();
        assert!(!self.is_in(&required), "`{}` is required (TRODDEN_REQUIRE={required}): {why}", self.name());
        println!("skipped: {why}");
    }

    fn is_in(self, required: &str) -> bool {
        let mut names = required.split(',').map(str::trim).filter(|name| !name.is_empty());
        names.any(|name| {
            let known = name == "all" || Self::ALL.iter().any(|need| need.name() == name);
            assert!(known, "TRODDEN_REQUIRE names `{name}`, which no test needs");
            name == "all" || name == self.name()
        })
    }

    /// Returns whether a program runs with these arguments; says that a test is skipped if not.
    pub fn runs(self, program: &str, arguments: &[&str]) -> bool {
        let runs = Command::new(program).args(arguments).output().is_ok_and(|output| output.status.success());
        if !runs {
            self.missing(&format!("`{program} {}` does not run here", arguments.join(" ")));
        }
        runs
    }

    /// Returns a folder of the reference data, or says that a test is skipped for want of it.
    pub fn folder(self) -> Option<PathBuf> {
        let path = match self {
            Self::Oracle => "oracle/orca",
            Self::Maps => "maps",
            Self::Plans => "plans",
            Self::Tracks => "tracks",
            Self::Cases => "cases",
            _ => unreachable!("only data lie in a folder"),
        };
        let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared");
        let folder = std::env::var_os("TRODDEN_SHARED").map_or_else(beside, PathBuf::from).join(path);
        if folder.is_dir() {
            return Some(folder);
        }
        self.missing(&format!("there is no folder {}", folder.display()));
        None
    }
}

#[test]
fn needs_are_required_by_name() {
    assert!(Need::Python.is_in("python") && Need::Python.is_in("cc, python") && Need::Cc.is_in("all"));
    assert!(!Need::Python.is_in("") && !Need::Python.is_in("cc,browser"));
}

#[test]
#[should_panic(expected = "names `pyton`, which no test needs")]
fn a_need_that_no_test_has_is_refused() {
    Need::Python.is_in("pyton");
}

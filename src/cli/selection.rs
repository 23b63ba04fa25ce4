//! What of a pipeline is asked for.

use clap_complete::engine::ArgValueCompleter;

use super::complete;
use crate::pipeline::selection::Selection;

/// How nodes are named, for the helps of commands.
pub(super) const NAMES: &str = "A NODE is a node (`labels/home_03`), a stage (`labels`: all its nodes), a part (`walks/home_03/chunk-02`, `model/epoch-07`), or a pattern that such names fit: `*` and `?` stand for characters but not for `/`, `[ab]` for one of those, `**` for whole levels (`'labels/*'`, `'*/home_0?'`, `'walks/home_00/chunk-*'`, `'**/chunk-00'`). What is the name of something means just that.";

/// What of a pipeline is asked for.
#[derive(Debug, Clone, clap::Args)]
pub struct SelectionArgs {
    /// Only these nodes and what they need; may be given more than once.
    #[arg(long, value_name = "NODE", conflicts_with = "until", add = ArgValueCompleter::new(complete::nodes))]
    only: Vec<String>,
    /// Everything but what lies behind these nodes; may be given more than once.
    #[arg(long, value_name = "NODE", add = ArgValueCompleter::new(complete::nodes))]
    until: Vec<String>,
    /// Without these nodes and all that reads them; may be given more than once.
    #[arg(long, value_name = "NODE", add = ArgValueCompleter::new(complete::nodes))]
    exclude: Vec<String>,
    /// Make these nodes again although they are on record; what reads them follows only if other bytes come out.
    #[arg(long, value_name = "NODE", add = ArgValueCompleter::new(complete::nodes))]
    force: Vec<String>,
}

impl From<&SelectionArgs> for Selection {
    fn from(args: &SelectionArgs) -> Self {
        let SelectionArgs { only, until, exclude, force } = args.clone();
        Self { only, until, exclude, force, elsewhere: false }
    }
}

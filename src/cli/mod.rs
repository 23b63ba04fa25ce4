//! Speaks. One file per command: it reads arguments, asks the other rooms, and prints.
//!
//! stdout is data, stderr is progress and errors. Exit codes: 0 done, 1 a stage or a disk failed, 2 a bad request, 3
//! a damaged store, 4 something would run (`plan --exit-code`), 130 interrupted.

#[cfg(not(all(feature = "pages", feature = "sql")))]
mod absent;
mod annotate;
mod check;
mod complete;
mod completions;
mod cost;
mod crowd_args;
mod diff;
mod error;
mod export;
mod follow;
mod gc;
pub(crate) mod heat_file;
mod how;
mod import_args;
mod init;
mod keep;
mod lineage;
mod log;
mod ls;
mod man;
pub(crate) mod model_files;
mod of_run;
mod out_folder;
#[cfg(feature = "pages")]
mod pages;
mod path;
mod paths;
mod plan;
mod plan_path;
mod pull;
mod push;
mod recheck;
mod remote_args;
mod report;
mod request;
mod run;
mod runs;
mod schema;
mod screen;
mod selection;
mod shared;
mod show;
mod signals;
mod simulate;
mod spread;
#[cfg(feature = "sql")]
mod sql;
mod status;
mod sweep;
mod table;
mod trace;
mod track_args;
mod transfer;
mod upward;
mod verify;
mod version;
mod watch;
mod why;
mod worker;

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};
use tracing_subscriber::filter::Targets;

use crate::domain::map::DECODER_THREAD;
#[cfg(not(feature = "pages"))]
use absent::pages;
#[cfg(not(feature = "sql"))]
use absent::sql;
use screen::{Color, Screen};
use upward::StorePlace;

pub(crate) use error::CliError;

use crate::pipeline::error::{PipelineError, SpecError};
use crate::pipeline::stage::Register;

/// The heading of the options that all commands have.
const GLOBAL: &str = "Options of all commands";

/// Learns where people walk: predicts from a floor plan how often each spot is visited.
#[derive(Debug, Parser)]
#[command(
    name = "trodden",
    bin_name = "trodden",
    version = version::short(),
    propagate_version = true,
    max_term_width = 100,
    after_help = "Examples:
  trodden run pipelines/quickstart.yaml                         everything, from maps to report
  trodden run pipelines/quickstart.yaml --set labels.classes=4  only what that changes
  trodden why labels                                            what changed
  trodden show heat/home_1000                                   a picture in the terminal
  trodden annotate my_map.yaml --out annotated                  where people walk on your map

Without a pipeline file, commands that take one look for `trodden.yaml` and `pipeline.yaml`, from this folder upward to the root of the project (`.git`).

The store is that of `--store`, or of TRODDEN_STORE, or the nearest folder `artifacts` with a store from this folder upward. Where there is none yet, it is made as `artifacts` in this folder, or for a pipeline file elsewhere at the root of the file's project.

Environment:
  TRODDEN_STORE             the store, as `--store`
  TRODDEN_JOBS              how many nodes may run at a time, as `--jobs`
  TRODDEN_LOG               what is told on stderr, as `-v`: `debug`, or `trodden::store=debug`
  TRODDEN_SIMD              the instruction set of the network: `avx512`, `avx2` or `portable`
  NO_COLOR, CLICOLOR_FORCE  colors nowhere, or everywhere

With `--json` every line on stdout is a JSON object, and so is every line on stderr but what `-v` tells: {\"error\", \"help\", \"code\"}, {\"warning\"}, {\"remark\"} or {\"help\"}. Events (`run`, `watch`, `status --follow`) have the time; the first of a run has the version of it all, `\"schema\": 1`. A version only ever gains fields."
)]
pub struct Cli {
    /// Go into this folder first.
    #[arg(short = 'C', long = "directory", global = true, value_name = "DIR", help_heading = GLOBAL)]
    directory: Option<PathBuf>,
    /// Folder of the artifact store [default: TRODDEN_STORE, or `artifacts` here or in a folder above].
    #[arg(long, global = true, value_name = "DIR", help_heading = GLOBAL)]
    store: Option<PathBuf>,
    /// Print one JSON object a line instead of text.
    #[arg(long, global = true, help_heading = GLOBAL)]
    json: bool,
    /// Print neither progress nor remarks.
    #[arg(long, short, global = true, help_heading = GLOBAL)]
    quiet: bool,
    /// Tell on stderr what goes on inside: runs and nodes; with `-vv` reads and writes of the store, too.
    #[arg(long, short, global = true, action = clap::ArgAction::Count, help_heading = GLOBAL)]
    verbose: u8,
    /// Print in color: `auto`, `always` or `never`.
    #[arg(long, global = true, value_name = "WHEN", value_enum, default_value = "auto", hide_possible_values = true, help_heading = GLOBAL)]
    color: Color,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a pipeline: everything that is not in the store yet.
    Run(run::Args),
    /// Run many variants of a pipeline at once: what they share is made once.
    Sweep(sweep::Args),
    /// Compare runs and variants in a table: what differs, and what came of it.
    Table(table::Args),
    /// Run a pipeline, and again whenever its file or a source file changes.
    Watch(watch::Args),
    /// Show what a run would do.
    Plan(plan::Args),
    /// Say why a node ran, or would run: what differs from the pipeline's previous run.
    Why(why::Args),
    /// Show the newest run of each pipeline and what the store holds.
    Status(status::Args),
    /// List runs, or the nodes and artifacts of a run.
    Ls(ls::Args),
    /// List runs, give them names, or remove the records of some.
    Runs(runs::Args),
    /// Show an artifact: a raster as a picture, a table as a table.
    Show(show::Args),
    /// Print what a command of your own printed while it made an artifact.
    Log(log::Args),
    /// Ask the artifacts in SQL: `SELECT * FROM 'labels/home_00' LIMIT 5`.
    Sql(sql::Args),
    /// Compare two runs, or the contents of two artifacts.
    Diff(diff::Args),
    /// Show everything behind an artifact, down to the files outside of the store.
    Lineage(lineage::Args),
    /// Print where the files of an artifact lie in the store.
    Path(path::Args),
    /// Write the report of a run as one HTML file.
    Report(report::Args),
    /// Mark a run, so that `gc` keeps what it reaches.
    Keep(keep::Args),
    /// Remove what no run needs any more.
    Gc(gc::Args),
    /// Give results to a shared store.
    Push(push::Args),
    /// Bring results here from a shared store.
    Pull(pull::Args),
    /// Do work of a run that was submitted with `run --on`.
    Worker(worker::Args),
    /// Read everything in the store and name what is damaged.
    Verify(verify::Args),
    /// Check a pipeline file without running it.
    Check(check::Args),
    /// Print the JSON Schema of pipeline files.
    Schema(schema::Args),
    /// Write a pipeline file to start from.
    Init(init::Args),
    /// Annotate a map of your own, without a pipeline.
    Annotate(annotate::Args),
    /// Simulate people on a map of your own, without a pipeline.
    Simulate(simulate::Args),
    /// Plan a path on a map of your own that stays out of people's way.
    PlanPath(plan_path::Args),
    /// Write what the store holds in the form that others take.
    Export(export::Args),
    /// Print completions for a shell.
    Completions(completions::Args),
    /// Write pages for `man`.
    Man(man::Args),
    /// Print the version, what was built in, and what this machine can compute with.
    Version(version::Args),
}

/// Parses a command line, which begins with the program's name, runs the command over the
/// stages, sources and kinds of a register and returns its exit code.
#[must_use]
pub fn main(register: &Register, arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    hush_decoder();
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    match complete::answer(Cli::command, &arguments) {
        Ok(false) => {}
        Ok(true) => return ExitCode::SUCCESS,
        Err(error) => return complain(&error, &Screen::new(false, false, Color::Auto)),
    }
    let cli = match Cli::try_parse_from(&arguments) {
        Ok(cli) => cli,
        Err(said) => return explain(&said, &arguments),
    };
    let targets = trace::wanted(cli.verbose);
    // Lines would run through bars that move.
    let is_traced = matches!(targets, Ok(Some(_)));
    let screen = Screen::new(cli.json, cli.quiet, cli.color);
    let screen = if is_traced { screen.without_bars() } else { screen };
    let done = targets.and_then(|targets| begin(&cli, targets)).and_then(|()| dispatch(&cli, register, &screen));
    let done = done.and_then(|code| screen.flush().map(|()| code));
    done.unwrap_or_else(|error| complain(&error, &screen))
}

/// Goes where the command is to work, and begins to tell of it if that is wanted.
fn begin(cli: &Cli, targets: Option<Targets>) -> Result<(), CliError> {
    if let Some(targets) = targets {
        trace::begin(targets);
    }
    cli.directory.as_ref().map_or(Ok(()), |folder| {
        std::env::set_current_dir(folder).map_err(|source| CliError::File {
            action: "go into",
            path: folder.clone(),
            source,
        })
    })
}

/// Lets no panic of the decoder of images be printed.
pub(crate) fn hush_decoder() {
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        // What panics there comes back as an error that names the file.
        if std::thread::current().name() != Some(DECODER_THREAD) {
            hook(panic);
        }
    }));
}

/// Prints the help that was asked for, or what is wrong with the command line.
fn explain(said: &clap::Error, arguments: &[OsString]) -> ExitCode {
    // What cannot be understood may still say how to say so.
    let json = arguments.iter().take_while(|word| *word != "--").any(|word| word == "--json");
    let screen = Screen::new(json, false, Color::Auto);
    let code = u8::try_from(said.exit_code()).unwrap_or(2);
    if json && said.use_stderr() {
        let text = said.render().to_string();
        let (message, help) = text.split_once("\n\n").unwrap_or((&text, ""));
        let help = Some(help.trim()).filter(|help| !help.is_empty());
        screen.error(message.trim().trim_start_matches("error: "), help, code);
        return ExitCode::from(code);
    }
    match said.print().map_err(CliError::output).and_then(|()| screen.flush()) {
        Err(error) if !said.use_stderr() => complain(&error, &screen),
        _ => ExitCode::from(code),
    }
}

/// Prints an error to stderr and returns its exit code.
fn complain(error: &CliError, screen: &Screen) -> ExitCode {
    match error {
        CliError::Closed => {}
        CliError::Pipeline(PipelineError::Spec(spec)) if screen.json() => screen.fault(&faults(spec, error)),
        CliError::Pipeline(error @ PipelineError::Spec(_)) => screen.complain(&error.render(screen.color())),
        other => screen.error(&other.message(), other.help().as_deref(), other.code()),
    }
    ExitCode::from(error.code())
}

/// Returns all that is wrong with a pipeline file, with the places.
fn faults(spec: &SpecError, error: &CliError) -> serde_json::Value {
    let problems = spec.problems().iter().map(|problem| {
        let (file, line, column) = spec.place(problem);
        let (message, help) = (&problem.message, &problem.help);
        serde_json::json!({ "file": file, "line": line, "column": column, "message": message, "help": help })
    });
    let problems: Vec<_> = problems.collect();
    serde_json::json!({ "error": error.message(), "help": error.help(), "code": error.code(), "problems": problems })
}

fn dispatch(cli: &Cli, register: &Register, screen: &Screen) -> Result<ExitCode, CliError> {
    let place = StorePlace::new(cli.store.clone());
    let store = &*place.root();
    match &cli.command {
        Command::Run(args) => args.run(register, &place, screen),
        Command::Sweep(args) => args.run(register, &place, screen),
        Command::Table(args) => args.run(register, store, screen),
        Command::Watch(args) => args.run(register, &place, screen),
        Command::Plan(args) => args.run(register, &place, screen),
        Command::Why(args) => args.run(register, &place, screen),
        Command::Status(args) => args.run(store, screen),
        Command::Ls(args) => args.run(store, screen),
        Command::Runs(args) => args.run(store, screen),
        Command::Show(args) => args.run(store, screen),
        Command::Log(args) => args.run(store, screen),
        Command::Sql(args) => args.run(store, screen),
        Command::Diff(args) => args.run(store, screen),
        Command::Lineage(args) => args.run(store, screen),
        Command::Path(args) => args.run(store, screen),
        Command::Report(args) => args.run(store, screen),
        Command::Keep(args) => args.run(store, screen),
        Command::Gc(args) => args.run(store, screen),
        Command::Push(args) => args.run(register, &place, screen),
        Command::Pull(args) => args.run(register, &place, screen),
        Command::Worker(args) => args.run(register, cli.store.as_deref(), screen),
        Command::Verify(args) => args.run(store, screen),
        Command::Check(args) => args.run(register, screen),
        Command::Schema(args) => args.run(register, screen),
        Command::Init(args) => args.run(screen),
        Command::Annotate(args) => args.run(store, screen),
        Command::Simulate(args) => args.run(store, screen),
        Command::PlanPath(args) => args.run(store, screen),
        Command::Export(args) => args.run(store, screen),
        Command::Completions(args) => args.run(screen),
        Command::Man(args) => args.run(Cli::command(), screen),
        Command::Version(args) => args.run(screen),
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn no_two_arguments_of_a_command_have_one_id() {
        for command in Cli::command().get_subcommands() {
            let mut seen = BTreeSet::new();
            for argument in command.get_arguments() {
                assert!(seen.insert(argument.get_id().as_str()), "`{}` of `{}`", argument.get_id(), command.get_name());
            }
        }
    }
}

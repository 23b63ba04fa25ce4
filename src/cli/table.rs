//! `table`: runs and variants side by side.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap_complete::engine::ArgValueCompleter;

use super::complete;
use super::error::CliError;
use super::pages;
use super::request::find_run;
use super::screen::{Screen, columns};
use crate::kinds::plain_metrics;
use crate::pipeline::spec::suggest;
use crate::pipeline::stage::Register;
use crate::report::ReportError;
use crate::report::study::{Figure, Front, Study, StudyTable, build};
use crate::store::{Run, Store, write_whole};

/// The most columns of figures that a terminal gets without being asked.
const MOST_FIGURES: usize = 8;

/// Arguments of `table`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "A sweep has a row for each variant, other runs have one each. Parameters and figures that never differ are \
                  left out. A figure of a stage that is made for many maps is the mean over them. `time` and `size` are \
                  those of all that is behind a row, shared work included.

Examples:
  trodden table                                          the newest run
  trodden table 20261126-18 20261127-09                  two runs, by the beginnings of their ids
  trodden table --metrics 'scores.*' --sort scores.auc
  trodden table --html study.html --front scores.auc,-seconds
  trodden table --csv study.csv --each"
)]
pub struct Args {
    /// Runs: ids, their beginnings, or `latest` [default: the newest].
    #[arg(value_name = "RUN", add = ArgValueCompleter::new(complete::runs))]
    runs: Vec<String>,
    #[command(flatten)]
    table: TableArgs,
}

/// What a table is to have, and where it goes.
#[derive(Debug, Default, clap::Args)]
pub(super) struct TableArgs {
    /// Only figures of these names; `*` stands for anything.
    #[arg(long, value_name = "PATTERN", value_delimiter = ',')]
    metrics: Vec<String>,
    /// All figures, those too that never differ.
    #[arg(long)]
    all: bool,
    /// Sort by this figure, the largest first; with `-` before it the smallest.
    #[arg(long, value_name = "FIGURE", allow_hyphen_values = true)]
    sort: Option<String>,
    /// Take the rows together that differ in these parameters alone [default: those called `seed`].
    #[arg(long, value_name = "PATH", value_delimiter = ',')]
    over: Option<Vec<String>>,
    /// A row for each variant, seeds too.
    #[arg(long, conflicts_with = "over")]
    each: bool,
    /// Write the table as CSV.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write the table as Parquet.
    #[arg(long, value_name = "FILE")]
    parquet: Option<PathBuf>,
    /// Write a page: the table, parallel coordinates, a front, and pictures side by side.
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// The two figures of the front, `seconds` and `bytes` among them; with `-` before one less of it is better.
    #[arg(long, value_name = "FIGURE,FIGURE", allow_hyphen_values = true)]
    front: Option<String>,
}

impl Args {
    pub(super) fn run(&self, register: &Register, store: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        pages::check(self.table.html.is_some())?;
        let store = Store::open_existing(store)?;
        let runs: Vec<Run> = if self.runs.is_empty() {
            vec![find_run(&store, None, None)?]
        } else {
            self.runs.iter().map(|id| Ok(store.run(id)?)).collect::<Result<_, CliError>>()?
        };
        print_study(&store, &runs, &self.table, register, screen)?;
        Ok(ExitCode::SUCCESS)
    }
}

/// Prints the table of some runs, and writes it where it is to go.
pub(super) fn print_study(
    store: &Store,
    runs: &[Run],
    args: &TableArgs,
    register: &Register,
    screen: &Screen,
) -> Result<(), CliError> {
    let metrics = |kind: &str, artifact: &_| match register.kind(kind) {
        Some(known) => {
            let metrics = known.metrics(store, artifact).map_err(|error| ReportError::Own(Box::new(error)))?;
            Ok(metrics.into_iter().map(|metric| (metric.name, metric.value)).collect())
        }
        None => Ok(plain_metrics(store, artifact)?),
    };
    let mut study = build(store, runs, &metrics)?;
    let patterns = args.patterns()?;
    let wanted = |name: &str| patterns.is_empty() || patterns.iter().any(|pattern| pattern.matches(name));
    study.retain_metrics(&wanted, args.all);
    let over = match (&args.over, args.each) {
        (_, true) => Vec::new(),
        (Some(over), _) => over.clone(),
        (None, false) => study.seeds(),
    };
    if let Some(unknown) = over.iter().find(|path| !study.settings.contains(path)) {
        let help = suggest::help(unknown, study.settings.iter().map(String::as_str));
        return Err(request(format!("`{unknown}` is no parameter that differs"), help));
    }
    let mut table = StudyTable::new(&study, &over);
    if let Some(sort) = &args.sort {
        let (name, descending) = sort.strip_prefix('-').map_or((sort.as_str(), true), |name| (name, false));
        match figure(&study, name)? {
            Figure::Metric(at) => table.sort(at, descending),
            _ => return Err(CliError::request(format!("a table is sorted by one of its figures, not by `{name}`"))),
        }
    }
    let write = |path: &Path, bytes: &[u8]| {
        write_whole(path, bytes).map_err(|source| CliError::File { action: "write", path: path.to_owned(), source })?;
        screen.remark(format!("wrote {}", path.display()));
        Ok::<_, CliError>(())
    };
    if let Some(path) = &args.csv {
        write(path, table.csv().as_bytes())?;
    }
    if let Some(path) = &args.parquet {
        write(path, &table.parquet().map_err(ReportError::from)?)?;
    }
    if let Some(path) = &args.html {
        let front = args.front(&study)?;
        let title = runs.first().map_or("study", |run| run.pipeline.as_str());
        write(path, pages::of_study(store, runs, &table, front, title)?.as_bytes())?;
    }
    if screen.json() {
        return table.json().iter().try_for_each(|row| screen.object(row));
    }
    print(&table, args, screen)
}

fn print(table: &StudyTable, args: &TableArgs, screen: &Screen) -> Result<(), CliError> {
    let (mut header, mut rows) = table.text();
    let hidden = table.study.metrics.len().saturating_sub(MOST_FIGURES);
    if hidden > 0 && args.metrics.is_empty() && !args.all {
        // Figures stand before time and size.
        let (first, last) = (header.len() - 2 - hidden, header.len() - 2);
        header.drain(first..last);
        rows.iter_mut().for_each(|row| drop(row.drain(first..last)));
        screen.remark(format!("{hidden} more figures: `--all` shows them, `--metrics PATTERN` some"));
    }
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    screen.line(columns(&header, &rows))
}

impl TableArgs {
    fn patterns(&self) -> Result<Vec<glob::Pattern>, CliError> {
        let read = |text: &String| {
            glob::Pattern::new(text).map_err(|error| CliError::request(format!("`{text}` is no pattern: {error}")))
        };
        self.metrics.iter().map(read).collect()
    }

    /// Reads what the front is of; without that it is of the first figure and the time.
    fn front(&self, study: &Study) -> Result<Option<Front>, CliError> {
        let Some(text) = &self.front else {
            let first = (!study.metrics.is_empty()).then_some(Figure::Metric(0));
            return Ok(first.map(|first| Front { figures: [first, Figure::Seconds], larger: [true, false] }));
        };
        let Some((x, y)) = text.split_once(',') else {
            return Err(CliError::advised("a front is of two figures", "write `--front scores.auc,-seconds`"));
        };
        let read = |text: &str| {
            let (name, larger) = text.strip_prefix('-').map_or((text, true), |name| (name, false));
            Ok::<_, CliError>((figure(study, name)?, larger))
        };
        let ((x, x_larger), (y, y_larger)) = (read(x.trim())?, read(y.trim())?);
        Ok(Some(Front { figures: [x, y], larger: [x_larger, y_larger] }))
    }
}

fn figure(study: &Study, name: &str) -> Result<Figure, CliError> {
    match (name, study.metrics.iter().position(|metric| metric == name)) {
        (_, Some(at)) => Ok(Figure::Metric(at)),
        ("seconds", None) => Ok(Figure::Seconds),
        ("bytes", None) => Ok(Figure::Bytes),
        _ => {
            let names = study.metrics.iter().map(String::as_str).chain(["seconds", "bytes"]);
            let help = suggest::help(name, names);
            Err(request(format!("there is no figure `{name}` in this table"), help))
        }
    }
}

fn request(message: String, help: Option<String>) -> CliError {
    match help {
        Some(help) => CliError::advised(message, help),
        None => CliError::request(message),
    }
}

//! What a run does, while it does it: bars on a terminal, lines elsewhere, or a stream of JSON.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::time::{Duration, Instant};

use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::line::Line;
use super::plain::{one_line, plain, plain_but_colors, plain_json};
use crate::pipeline::event::{Counts, Event, RunState};
use crate::store::{Outcome, RunStatus};

use super::amounts::{bytes, seconds};

/// How a run is followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BarStyle {
    /// Bars on stderr: one for the run and one for each node that runs.
    Terminal,
    /// A line on stderr for each node that ran, failed or was skipped.
    Plain,
    /// Every event but progress as one line of JSON on stdout.
    Json,
    /// Only warnings, as lines on stderr.
    Quiet,
}

/// The most bars of running nodes.
const MOST_BARS: usize = 8;
/// How often a bar is drawn anew while nothing happens.
const TICK: Duration = Duration::from_millis(200);
/// The least time between two reports of the progress of one node.
const PAUSE: Duration = Duration::from_millis(50);

/// Follows a run.
#[derive(Debug)]
pub struct Bars {
    style: BarStyle,
    state: RunState,
    clock: Option<fn() -> String>,
    drawn: Option<Drawn>,
    /// What first went wrong on stdout.
    failure: Option<io::Error>,
}

/// The bars on a terminal.
#[derive(Debug)]
struct Drawn {
    all: MultiProgress,
    run: ProgressBar,
    nodes: BTreeMap<String, NodeBar>,
}

#[derive(Debug)]
struct NodeBar {
    bar: ProgressBar,
    sized: bool,
    moved: Instant,
}

impl Bars {
    /// Starts with nothing to show yet.
    #[must_use]
    pub fn new(style: BarStyle) -> Self {
        Self { style, state: RunState::default(), clock: None, drawn: None, failure: None }
    }

    /// Prints with every event as JSON when it was told.
    #[must_use]
    pub fn with_clock(self, clock: fn() -> String) -> Self {
        Self { clock: Some(clock), ..self }
    }

    /// Returns where the run stands.
    #[must_use]
    pub const fn state(&self) -> &RunState {
        &self.state
    }

    /// Takes in the next event and shows it.
    pub fn hear(&mut self, event: &Event) {
        self.state.apply(event);
        match self.style {
            BarStyle::Quiet if matches!(event, Event::Warning { .. }) => self.say(event),
            BarStyle::Quiet => {}
            BarStyle::Json => self.print_json(event),
            BarStyle::Plain => self.say(event),
            BarStyle::Terminal => self.draw(event),
        }
    }

    /// Returns what first kept an event from being printed on stdout; that nobody reads it any more is none.
    pub fn take_failure(&mut self) -> Option<io::Error> {
        self.failure.take()
    }

    fn say(&self, event: &Event) {
        for line in self.lines(event, false) {
            complain(&line);
        }
    }

    fn print_json(&mut self, event: &Event) {
        if matches!(event, Event::Progress { .. } | Event::Exchange { .. }) {
            return;
        }
        let line = self.clock.map_or_else(|| Line::new(event), |clock| Line::now(event, clock));
        let line = serde_json::to_string(&line).expect("an event is JSON");
        // The run goes on all the same.
        if let Err(error) = writeln!(io::stdout().lock(), "{}", plain_json(&line))
            && error.kind() != io::ErrorKind::BrokenPipe
        {
            self.failure.get_or_insert(error);
        }
    }

    /// Returns what an event is worth saying in lines.
    fn lines(&self, event: &Event, color: bool) -> Vec<String> {
        let paint = |code: &str, text: &str| if color { format!("\x1b[{code}m{text}\x1b[0m") } else { text.to_owned() };
        match event {
            Event::RunStarted { pipeline, nodes, id, .. } if !color => {
                vec![format!("{}: {nodes} nodes, run {id}", one_line(pipeline))]
            }
            Event::Node { node, outcome, wall_s, pulled, error, help, .. } => match outcome {
                // What only its recipe was brought of is no news.
                Outcome::Hit if pulled.is_none_or(|bytes| bytes == 0) => Vec::new(),
                Outcome::Hit => {
                    let place = format!("[{}/{}]", self.state.done(), self.state.nodes);
                    let (word, size) = (paint("36", "pulled"), paint("2", &bytes(pulled.unwrap_or(0))));
                    vec![format!("{} {word} {} {size}", paint("2", &place), one_line(&node.to_string()))]
                }
                Outcome::Ran => {
                    let place = format!("[{}/{}]", self.state.done(), self.state.nodes);
                    let (ran, time) = (paint("32", "ran"), paint("2", &seconds(*wall_s)));
                    vec![format!("{} {ran} {} {time}", paint("2", &place), one_line(&node.to_string()))]
                }
                Outcome::Skipped => vec![format!("{} {}", paint("33", "skipped"), one_line(&node.to_string()))],
                Outcome::Failed => {
                    let message = plain(error.as_deref().unwrap_or("no reason was given"));
                    let mut lines =
                        vec![format!("{} {}: {message}", paint("1;31", "failed"), one_line(&node.to_string()))];
                    lines.extend(help.iter().map(|help| format!("  help: {}", plain(help))));
                    lines
                }
            },
            Event::Waiting { node } => {
                vec![format!("{} for another process, which makes {node}", paint("33", "waiting"))]
            }
            Event::Checked { node, same: false, before, now } => {
                let node = one_line(&node.to_string()).into_owned();
                vec![format!("{} {node}: {before} is on record, {now} came out", paint("1;31", "differs"))]
            }
            Event::Warning { node, message } => {
                let place =
                    node.as_ref().map_or_else(String::new, |node| format!("`{}`: ", one_line(&node.to_string())));
                vec![format!("{}: {place}{}", paint("33", "warning"), plain(message))]
            }
            Event::Run { status, wall_s, .. } => vec![summary(&self.state.counts, *status, *wall_s)],
            _ => Vec::new(),
        }
    }

    fn draw(&mut self, event: &Event) {
        if let Event::RunStarted { nodes, pipeline, .. } = event {
            self.drawn = Some(Drawn::new(pipeline, *nodes));
        }
        let lines = self.lines(event, true);
        let Some(drawn) = &mut self.drawn else {
            lines.iter().for_each(|line| complain(line));
            return;
        };
        // Bars would flicker for nodes that are over at once: a line is printed only for what went wrong.
        let failed = matches!(event, Event::Node { outcome: Outcome::Failed, .. } | Event::Warning { .. });
        if failed {
            for line in &lines {
                let _ = drawn.all.println(plain_but_colors(line));
            }
        }
        drawn.follow(event, &self.state);
        if matches!(event, Event::Run { .. }) {
            self.drawn = None;
            lines.iter().for_each(|line| complain(line));
        }
    }
}

impl Drawn {
    fn new(pipeline: &str, nodes: usize) -> Self {
        let all = MultiProgress::with_draw_target(ProgressDrawTarget::stderr_with_hz(10));
        let run = all.add(ProgressBar::new(nodes as u64));
        run.set_style(style("{prefix:.bold} {bar:32.green/black.bright} {pos}/{len}  {elapsed}  {wide_msg}"));
        run.set_prefix(one_line(pipeline).into_owned());
        Self { all, run, nodes: BTreeMap::new() }
    }

    fn follow(&mut self, event: &Event, state: &RunState) {
        match event {
            Event::Waiting { node } => {
                if self.nodes.len() < MOST_BARS {
                    let bar = self.all.add(ProgressBar::new_spinner());
                    bar.set_style(style("  {spinner:.yellow} {prefix}  waiting for another process  {elapsed:.dim}"));
                    bar.set_prefix(node.to_string());
                    bar.enable_steady_tick(TICK);
                    self.nodes.insert(node.to_string(), NodeBar { bar, sized: false, moved: Instant::now() });
                }
                self.run.enable_steady_tick(TICK);
            }
            Event::NodeStarted { node, .. } => {
                self.close(node);
                if self.nodes.len() < MOST_BARS {
                    let bar = self.all.add(ProgressBar::new_spinner());
                    bar.set_style(style("  {spinner:.cyan} {prefix}  {elapsed:.dim}"));
                    bar.set_prefix(one_line(&node.to_string()).into_owned());
                    bar.enable_steady_tick(TICK);
                    self.nodes.insert(node.to_string(), NodeBar { bar, sized: false, moved: Instant::now() });
                }
                self.run.enable_steady_tick(TICK);
            }
            Event::Progress { node, done, total } => {
                if let Some(shown) = self.nodes.get_mut(node) {
                    shown.advance(*done, *total);
                }
            }
            Event::Node { node, .. } => {
                self.close(node);
                self.run.set_position(state.done() as u64);
                self.run.set_message(message(state));
            }
            Event::Exchange { pulling, pushing } => {
                self.run.set_message(message(state));
                if pulling + pushing > 0 {
                    self.run.enable_steady_tick(TICK);
                }
            }
            Event::Run { .. } => {
                self.nodes.values().for_each(|shown| shown.bar.finish_and_clear());
                self.run.finish_and_clear();
                let _ = self.all.clear();
            }
            Event::RunStarted { .. } | Event::Checked { .. } | Event::Warning { .. } => {}
        }
    }
}

impl Drawn {
    /// Takes away the bar of a node, if it has one.
    fn close(&mut self, node: &str) {
        if let Some(shown) = self.nodes.remove(node) {
            shown.bar.finish_and_clear();
            self.all.remove(&shown.bar);
        }
    }
}

/// The bar of one piece of work, outside of any run; it is cleared when it is dropped.
#[derive(Debug)]
pub struct WorkBar(NodeBar);

impl WorkBar {
    /// Begins to show the work on stderr, if that is a terminal.
    #[must_use]
    pub fn new(name: &str, is_terminal: bool) -> Self {
        let target = if is_terminal { ProgressDrawTarget::stderr_with_hz(10) } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(None, target);
        bar.set_prefix(one_line(name).into_owned());
        bar.enable_steady_tick(TICK);
        Self(NodeBar { bar, sized: false, moved: Instant::now() })
    }

    /// Takes the bar away while something is said on stderr.
    pub fn said(&self, say: impl FnOnce()) {
        self.0.bar.suspend(say);
    }

    /// Shows that so much of all is done.
    pub fn advance(&mut self, done: usize, total: usize) {
        self.0.advance(done as u64, total as u64);
    }
}

impl Drop for WorkBar {
    fn drop(&mut self) {
        self.0.bar.finish_and_clear();
    }
}

impl NodeBar {
    fn advance(&mut self, done: u64, total: u64) {
        if !self.sized && total > 0 {
            self.sized = true;
            self.bar.set_length(total);
            self.bar.set_style(style("  {spinner:.cyan} {prefix}  {bar:24.cyan/black.bright} {pos}/{len}  {eta:.dim}"));
        } else if done < total && self.moved.elapsed() < PAUSE {
            return;
        }
        self.moved = Instant::now();
        self.bar.set_position(done);
    }
}

fn style(template: &str) -> ProgressStyle {
    let style = ProgressStyle::with_template(template).expect("the templates of this file are well formed");
    style.progress_chars("━╸─").tick_chars("⠋⠙⠹⠸⠼⠴⠦⠧⠇⠏ ")
}

/// Says how many nodes ended in each way, and what is under way between two stores.
fn message(state: &RunState) -> String {
    let parts = [(state.exchange.0, "pulling"), (state.exchange.1, "pushing")];
    let moving = parts.iter().filter(|(count, _)| *count > 0).map(|(count, word)| format!(", {word} {count}"));
    tally(&state.counts) + &moving.collect::<String>()
}

/// Says how many nodes ended in each way: `12 ran, 48 hit (30 pulled)`.
#[must_use]
pub fn tally(counts: &Counts) -> String {
    let pulled = if counts.pulled > 0 { format!(" ({} pulled)", counts.pulled) } else { String::new() };
    let parts = [
        (counts.ran, "ran", ""),
        (counts.hit, "hit", &pulled),
        (counts.failed, "failed", ""),
        (counts.skipped, "skipped", ""),
    ];
    let named: Vec<String> = parts
        .iter()
        .filter(|(count, ..)| *count > 0)
        .map(|(count, name, more)| format!("{count} {name}{more}"))
        .collect();
    if named.is_empty() { "no nodes".to_owned() } else { named.join(", ") }
}

fn summary(counts: &Counts, status: RunStatus, wall_s: f64) -> String {
    let end = match status {
        RunStatus::Finished => "finished",
        RunStatus::Failed => "failed",
        RunStatus::Interrupted => "interrupted",
        RunStatus::Killed => "killed",
        RunStatus::Running => "running",
    };
    format!("{end} in {}: {}", seconds(wall_s), tally(counts))
}

/// Prints to stderr; there is nowhere left to say that it is closed.
fn complain(line: &str) {
    let _ = writeln!(io::stderr().lock(), "{}", plain_but_colors(line));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::Role;

    fn node(name: &str, outcome: Outcome) -> Event {
        Event::Node {
            node: name.into(),
            outcome,
            digest: None,
            role: Role::Node,
            stage: "quantize".to_owned(),
            kind: "Labels".to_owned(),
            wall_s: 1.25,
            pulled: None,
            error: (outcome == Outcome::Failed).then(|| "no free cell".to_owned()),
            help: (outcome == Outcome::Failed).then(|| "draw one".to_owned()),
        }
    }

    fn lines(events: &[Event]) -> Vec<String> {
        let mut bars = Bars::new(BarStyle::Quiet);
        let mut said = Vec::new();
        for event in events {
            bars.hear(event);
            said.extend(bars.lines(event, false));
        }
        said
    }

    #[test]
    fn hits_are_counted_but_not_told() {
        let said = lines(&[
            Event::RunStarted { id: "r1".to_owned(), pipeline: "homes".to_owned(), file: String::new(), nodes: 4 },
            node("labels/a", Outcome::Hit),
            Event::Waiting { node: "labels/b".into() },
            node("labels/b", Outcome::Ran),
            Event::Warning { node: Some("labels/b".to_owned()), message: "odd".to_owned() },
            node("labels/c", Outcome::Failed),
            node("tiles", Outcome::Skipped),
            Event::Run {
                ran: 1,
                hit: 1,
                failed: 1,
                skipped: 1,
                wall_s: 75.0,
                id: "r1".to_owned(),
                status: RunStatus::Failed,
                shared: None,
            },
        ]);
        assert_eq!(
            said,
            [
                "homes: 4 nodes, run r1",
                "waiting for another process, which makes labels/b",
                "[2/4] ran labels/b 1.2 s",
                "warning: `labels/b`: odd",
                "failed labels/c: no free cell",
                "  help: draw one",
                "skipped tiles",
                "failed in 1 min 15 s: 1 ran, 1 hit, 1 failed, 1 skipped",
            ]
        );
    }

    #[test]
    fn names_and_messages_give_no_orders() {
        let odd = "a\x1b]0;owned\x07\nb".to_owned();
        let started = Event::RunStarted { id: "r".to_owned(), pipeline: odd.clone(), file: String::new(), nodes: 1 };
        let warning = Event::Warning { node: Some(odd.clone()), message: odd.clone() };
        let events =
            [started, node(&odd, Outcome::Ran), node(&odd, Outcome::Failed), node(&odd, Outcome::Skipped), warning];
        let bars = Bars::new(BarStyle::Quiet);
        for event in &events {
            let said = bars.lines(event, false).join("\n");
            assert!(said.contains("a\\u{1b}]0;owned\\u{7}\\u{a}b") && !said.contains('\x1b'), "{said}");
            assert!(!bars.lines(event, true).join("").contains("\x1b]"));
        }
    }

    #[test]
    fn bars_survive_any_order_of_events() {
        // Nothing can be seen here: stderr is no terminal. The templates are parsed and bars come and go.
        let mut bars = Bars::new(BarStyle::Terminal);
        let started = |node: &str| Event::NodeStarted { node: node.into(), stage: String::new(), role: Role::Node };
        bars.hear(&Event::RunStarted { id: "r".to_owned(), pipeline: "p".to_owned(), file: String::new(), nodes: 30 });
        for i in 0..20 {
            bars.hear(&Event::Waiting { node: format!("walks/{i}").as_str().into() });
            bars.hear(&started(&format!("walks/{i}")));
            bars.hear(&Event::Progress { node: format!("walks/{i}"), done: 3, total: 7 });
            bars.hear(&Event::Progress { node: "unknown".to_owned(), done: 3, total: 0 });
        }
        for i in 0..20 {
            bars.hear(&node(&format!("walks/{i}"), Outcome::Ran));
        }
        assert_eq!((bars.state().done(), bars.state().running.len()), (20, 0));
        let drawn = bars.drawn.as_ref().expect("the run has begun");
        assert_eq!((drawn.run.position(), drawn.nodes.len()), (20, 0));
    }

    #[test]
    fn a_single_bar_follows_its_work() {
        let mut bar = WorkBar::new("annotate", false);
        bar.advance(0, 9);
        assert_eq!((bar.0.bar.length(), bar.0.bar.position()), (Some(9), 0));
        bar.advance(9, 9);
        assert_eq!(bar.0.bar.position(), 9);
    }
}

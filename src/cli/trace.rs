//! Tells on stderr what the program does inside: runs, nodes, waiting for locks, reads and writes of the store, commands.

use std::io;

use tracing_subscriber::filter::Targets;
use tracing_subscriber::fmt;
use tracing_subscriber::fmt::format::FmtSpan;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;

use super::error::CliError;
use super::upward::variable;

/// The environment variable that says of what and how much is told.
const VARIABLE: &str = "TRODDEN_LOG";

/// Returns what is to be told: as often as `-v` was given, or else by the environment; `None` for nothing.
///
/// # Errors
/// [`CliError::Request`] if the environment asks for what there is not.
pub(super) fn wanted(verbose: u8) -> Result<Option<Targets>, CliError> {
    let level = match verbose {
        0 => return variable(VARIABLE).map(|value| parse(&value.to_string_lossy())).transpose(),
        1 => tracing::Level::INFO,
        2 => tracing::Level::DEBUG,
        _ => tracing::Level::TRACE,
    };
    Ok(Some(Targets::new().with_target("trodden", level)))
}

fn parse(text: &str) -> Result<Targets, CliError> {
    text.parse().map_err(|_| {
        CliError::advised(
            format!("{VARIABLE} is `{text}`"),
            "write a level (`info`, `debug`, `trace`) or levels of rooms, such as `trodden::store=debug,trodden::pipeline=info`",
        )
    })
}

/// Begins to tell.
pub(super) fn begin(targets: Targets) {
    let lines = fmt::layer().with_writer(io::stderr).with_span_events(FmtSpan::CLOSE);
    // Where somebody listens already, they go on.
    let _ = tracing_subscriber::registry().with(lines).with(targets).try_init();
}

#[cfg(test)]
mod tests {
    use tracing::Level;

    use super::*;

    #[test]
    fn levels_go_by_how_often_they_are_asked_for() {
        let told = |verbose, level| {
            let targets = wanted(verbose).expect("is understood").expect("is wanted");
            targets.would_enable("trodden::store", &level) && !targets.would_enable("other", &level)
        };
        assert!(told(1, Level::INFO) && !told(1, Level::DEBUG));
        assert!(told(2, Level::DEBUG) && !told(2, Level::TRACE));
        assert!(told(3, Level::TRACE));
    }

    #[test]
    fn levels_of_rooms_are_read() {
        let targets = parse("trodden::store=debug,warn").expect("is understood");
        assert!(targets.would_enable("trodden::store::object", &Level::DEBUG));
        assert!(!targets.would_enable("trodden::pipeline", &Level::INFO));
        assert!(parse("trodden=loud").is_err());
    }
}

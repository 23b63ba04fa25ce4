//! Figures as people read them: with intervals, units, and a dash where they are not defined.

use crate::domain::score::{Estimate, Measure};

/// Names a measure for people.
pub const fn measure_name(measure: Measure) -> &'static str {
    match measure {
        Measure::SpearmanFree => "Spearman’s ρ, free floor",
        Measure::SpearmanVisited => "Spearman’s ρ, visited floor",
        Measure::AucThird => "AUC, above a third of the most visits",
        Measure::AucVisited => "AUC, visited or not",
        Measure::Divergence => "divergence",
        Measure::EarthMover => "earth mover’s distance",
        Measure::DoorsR2 => "R² at doors",
        Measure::Flow => "likelihood of directions (a guess: 1)",
    }
}

/// Writes a measure with its interval and its unit.
pub fn measured(measure: Measure, estimate: Option<Estimate>) -> String {
    match measure {
        Measure::Divergence => with_interval(estimate, |value| with_unit(value, "nats")),
        Measure::EarthMover => with_interval(estimate, |value| with_unit(value, "m")),
        Measure::Flow => with_interval(estimate, |value| with_unit(value, "×")),
        _ => with_interval(estimate, figure),
    }
}

fn with_unit(value: Option<f64>, unit: &str) -> String {
    value.map_or_else(|| "–".to_owned(), |value| format!("{value:.2} {unit}"))
}

/// Writes a figure between −1 and 1 that may not be defined.
pub fn figure(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), |value| format!("{value:.3}").replace('-', "−"))
}

/// Writes a share that may not be defined.
pub fn percent(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), |value| format!("{:.1} %", 100.0 * value))
}

/// Writes a figure and in brackets the interval around it; `write` writes one number.
pub fn with_interval(estimate: Option<Estimate>, write: fn(Option<f64>) -> String) -> String {
    let Some(Estimate { value, low, high }) = estimate else { return write(None) };
    format!("{} [{}, {}]", write(Some(value)), write(Some(low)), write(Some(high)))
}

/// Writes a probability that may be very small.
pub fn probability(value: f64) -> String {
    if value < 0.001 { "< 0.1 %".to_owned() } else { percent(Some(value)) }
}

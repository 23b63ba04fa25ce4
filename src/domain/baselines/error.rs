//! Why a baseline could not be computed.

/// What keeps a baseline from being computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum BaselineError {
    #[error("`{field}` is `{value}`, allowed is {allowed}")]
    Range { field: &'static str, value: f64, allowed: &'static str },
}

/// Checks that a value is in its range.
pub(super) fn check_range(
    field: &'static str,
    value: f64,
    range: std::ops::RangeInclusive<f64>,
    allowed: &'static str,
) -> Result<(), BaselineError> {
    if range.contains(&value) { Ok(()) } else { Err(BaselineError::Range { field, value, allowed }) }
}

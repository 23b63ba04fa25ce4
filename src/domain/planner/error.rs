//! What keeps a planner from planning.

/// What keeps a planner from planning.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum PlannerError {
    #[error(
        "of {drawn} pairs of places that were drawn {found} are at least {least} m of way apart, {wanted} are wanted"
    )]
    NoPairs { drawn: u32, found: usize, wanted: u32, least: f64 },
}

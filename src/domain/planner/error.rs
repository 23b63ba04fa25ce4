//! What keeps a planner from planning.

use crate::domain::crowd::CrowdError;
use crate::domain::social::SocialError;

/// What keeps a planner from planning.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum PlannerError {
    #[error("`{field}` is {value}, allowed are {allowed}")]
    Range { field: &'static str, value: String, allowed: &'static str },
    #[error(transparent)]
    Cost(#[from] SocialError),
    #[error(transparent)]
    Crowd(#[from] CrowdError),
    #[error(
        "of {drawn} pairs of places that were drawn {found} are at least {least} m of way apart, {wanted} are wanted"
    )]
    NoPairs { drawn: u32, found: usize, wanted: u32, least: f64 },
}

//! Why episodes cannot be given a cost.

/// What keeps episodes from being given a cost.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum SocialError {
    #[error("`{field}` is `{value}` m, allowed is above 0 and up to 100")]
    Range { field: &'static str, value: f64 },
    #[error("episode {episode} has {robot} steps of the robot and {pedestrians} of the pedestrians")]
    Steps { episode: u32, robot: usize, pedestrians: usize },
    #[error("step {step} of the robot in episode {episode} has no finite position")]
    Position { episode: u32, step: usize },
    #[error("a heat has {rows} × {cols} cells, its frame {frame_rows} × {frame_cols}")]
    FrameMismatch { rows: usize, cols: usize, frame_rows: usize, frame_cols: usize },
    #[error("there is no episode to rank")]
    NoEpisode,
}

//! `NavEpisodes`: the columns of `Trajectories` and `robot` bool; one file, ordered by episode, id and frame. What happened in
//! the episodes is a `summary` in the metadata.

use std::collections::BTreeMap;
use std::sync::Arc;

use arrow::array::{ArrayRef, AsArray, BooleanArray};
use arrow::datatypes::DataType;

use super::parquet::{Column, GROUP_ROWS, Table};
use super::trajectories::{self, Buffer, Order, check_rate};
use super::{KindError, Placed, SingleFile};
use crate::domain::crowd::Summary;
use crate::domain::geometry::Point;
use crate::domain::social::NavSteps;
use crate::domain::tracks::Sample;

const KIND: &str = "NavEpisodes";

/// The tracks of some episodes of a robot among pedestrians, in the map's local frame.
#[derive(Debug, Clone, PartialEq)]
pub struct NavEpisodes {
    /// Frames per second.
    pub frame_rate: f64,
    /// Samples ordered by (episode, id, frame).
    pub samples: Vec<NavSample>,
    /// What happened in the episodes, if they were simulated.
    pub summary: Option<Summary>,
}

/// One agent at one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NavSample {
    /// Where somebody was in a frame.
    pub sample: Sample,
    /// Whether the agent is the robot.
    pub robot: bool,
}

impl NavEpisodes {
    /// Arranges the tracks by episode and step, as eq. 2 and 3 need them: a step is a frame that has the robot.
    #[must_use]
    pub fn steps(&self) -> Vec<NavSteps> {
        // Of each episode and frame the robot, and the pedestrians by id.
        let mut frames: BTreeMap<(u32, i64), (Option<Point>, Vec<Point>)> = BTreeMap::new();
        for NavSample { sample, robot } in &self.samples {
            let step = frames.entry((sample.episode, sample.frame)).or_default();
            if *robot {
                step.0 = Some(sample.position);
            } else {
                step.1.push(sample.position);
            }
        }
        let mut episodes: Vec<NavSteps> = Vec::new();
        for ((episode, _), (robot, pedestrians)) in frames {
            let Some(robot) = robot else { continue };
            if episodes.last().is_none_or(|last| last.episode != episode) {
                episodes.push(NavSteps { episode, robot: Vec::new(), pedestrians: Vec::new() });
            }
            let steps = episodes.last_mut().expect("just pushed");
            steps.robot.push(robot);
            steps.pedestrians.push(pedestrians);
        }
        episodes
    }
}

fn columns() -> Vec<Column> {
    let mut columns = trajectories::columns();
    columns.push(Column::new("robot", DataType::Boolean));
    columns
}

impl SingleFile for Placed<NavEpisodes> {
    const NAME: &'static str = KIND;
    const FORMAT: u32 = 2;

    fn to_bytes(&self) -> Result<Vec<u8>, KindError> {
        let frame_rate = check_rate(KIND, self.value.frame_rate)?;
        let mut layout = trajectories::layout(KIND, <Self as SingleFile>::FORMAT, columns(), &self.frame, frame_rate);
        if let Some(summary) = &self.value.summary {
            layout = layout.with("summary", serde_json::to_string(summary).expect("a summary is JSON"));
        }
        let mut writer = layout.writer(Vec::new())?;
        let mut order = Order::new(KIND);
        for group in self.value.samples.chunks(GROUP_ROWS) {
            let mut buffer = Buffer::default();
            for NavSample { sample, .. } in group {
                order.check(sample)?;
                buffer.push(&self.frame, sample);
            }
            let mut arrays = buffer.take();
            let robots: Vec<bool> = group.iter().map(|sample| sample.robot).collect();
            arrays.push(Arc::new(BooleanArray::from(robots)) as ArrayRef);
            writer.write(arrays)?;
        }
        writer.finish()
    }

    fn from_bytes(bytes: Vec<u8>) -> Result<Self, KindError> {
        let table = Table::open(KIND, <Self as SingleFile>::FORMAT, bytes)?;
        let (frame, frame_rate) = (table.frame()?, check_rate(KIND, table.finite("frame_rate")?)?);
        let mut samples = Vec::new();
        let mut order = Order::new(KIND);
        for batch in table.batches(&columns())? {
            let batch = batch?;
            let robots = batch.arrays[trajectories::columns().len()].as_boolean().values();
            for (sample, robot) in trajectories::samples(&batch, &frame).into_iter().zip(robots.iter()) {
                order.check(&sample)?;
                samples.push(NavSample { sample, robot });
            }
        }
        let summary = match table.text("summary") {
            Ok(text) => Some(serde_json::from_str(text).map_err(|_| table.wrong_metadata("summary", "a summary"))?),
            Err(_) => None,
        };
        Ok(Self::new(frame, NavEpisodes { frame_rate, samples, summary }))
    }
}

//! The note by which a job is found again.

use serde::{Deserialize, Serialize};

use super::super::error::CliError;
use crate::cluster::slurm::Array;
use crate::cluster::{Job, Shelf};
use crate::pipeline::selection::Selection;
use crate::pipeline::spec::Pipeline;
use crate::remote::Remote;
use crate::store::{Digest, Run, Store};

/// How many jobs are looked at for one to go on with.
const RECENT: usize = 20;

/// What is noted of a job beside it, to find it again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Note {
    pipeline: String,
    source: String,
    asked: Vec<(String, String)>,
    pub arrays: Vec<Array>,
    pub over: bool,
}

impl Note {
    /// Reads that of a job; `None` if it is not there, or none that this version understands.
    pub(super) fn read(remote: &Remote, id: &str) -> Result<Option<Self>, CliError> {
        let text = remote.note(&format!("{id}/state.json"))?;
        Ok(text.and_then(|text| serde_json::from_slice(&text).ok()))
    }
}

/// Looks at the newest jobs of the pipeline: finds one of the same that has not ended, and takes what others have made and is
/// not on record here to the shelf.
pub(super) fn survey(
    pipeline: &Pipeline,
    selection: &Selection,
    store: &Store,
    shelf: &mut Shelf,
    remote: &Remote,
) -> Result<Option<(Job, Note)>, CliError> {
    let mine = note_of(pipeline, selection, Vec::new());
    let runs = store.runs()?;
    for id in remote.note_folders()?.into_iter().rev().take(RECENT) {
        let Some(note) = Note::read(remote, &id)? else { continue };
        if note.pipeline != mine.pipeline {
            continue;
        }
        let is_here = runs.iter().any(|run| run.id == id);
        let is_same = (&note.source, &note.asked) == (&mine.source, &mine.asked);
        if is_here && (note.over || !is_same) {
            continue;
        }
        let job = Job::read(remote, &id)?;
        if !is_here {
            shelf.add(&job)?;
        }
        if !note.over && is_same {
            return Ok(Some((job, note)));
        }
    }
    Ok(None)
}

/// Describes what is asked for.
pub(super) fn note_of(pipeline: &Pipeline, selection: &Selection, arrays: Vec<Array>) -> Note {
    let Selection { only, until, exclude, force, .. } = selection;
    let asked = Run {
        only: only.clone(),
        until: until.clone(),
        exclude: exclude.clone(),
        force: force.clone(),
        ..Run::default()
    };
    let asked = asked.asked().map(|(option, value)| (option.to_owned(), value.to_owned()));
    let axes = pipeline.axes.iter().map(|axis| ("axis".to_owned(), axis.clone()));
    let drawn = pipeline.sample.iter().map(|(count, seed)| ("sample".to_owned(), format!("{count} {seed}")));
    let asked = asked.chain(axes).chain(drawn).collect();
    let source = Digest::of(pipeline.source.as_bytes()).to_hex();
    Note { pipeline: pipeline.name.clone(), source, asked, arrays, over: false }
}

//! The text of a DXF file: pairs of a group code and a value, a line each.

use super::super::error::PlanError;
use crate::domain::map::position::Position;

/// A value and what it stands for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Group<'a> {
    pub code: i32,
    pub value: &'a str,
    /// The line of the code, from 1.
    pub line: u64,
}

/// What begins with a group of code 0: a section, a block, an entity.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Record<'a> {
    pub name: &'a str,
    pub line: u64,
    pub groups: Vec<Group<'a>>,
}

impl<'a> Record<'a> {
    /// Returns the first value of a code.
    pub fn text(&self, code: i32) -> Option<&'a str> {
        self.groups.iter().find(|group| group.code == code).map(|group| group.value)
    }

    /// Returns the first number of a code, if there is one.
    pub fn number(&self, code: i32) -> Result<Option<f64>, PlanError> {
        self.groups.iter().find(|group| group.code == code).map(Group::number).transpose()
    }

    /// Returns the first number of a code.
    pub fn required(&self, code: i32) -> Result<f64, PlanError> {
        self.number(code)?.ok_or_else(|| PlanError::DxfGroup {
            entity: self.name.to_owned(),
            code,
            at: self.position(),
        })
    }

    /// Returns where it begins.
    pub fn position(&self) -> Position {
        at(self.line)
    }

    /// Returns the numbers of a code, in order.
    pub fn numbers(&self, code: i32) -> Result<Vec<f64>, PlanError> {
        self.groups.iter().filter(|group| group.code == code).map(Group::number).collect()
    }

    /// Returns whole numbers, such as flags; 0 where there is none.
    pub fn whole(&self, code: i32) -> Result<i64, PlanError> {
        Ok(self.number(code)?.unwrap_or(0.0) as i64)
    }
}

impl Group<'_> {
    /// Returns the value as a finite number.
    pub fn number(&self) -> Result<f64, PlanError> {
        let number = self.value.parse::<f64>().ok().filter(|number| number.is_finite());
        number.ok_or_else(|| refused("a number", self.value, self.line + 1))
    }
}

/// Splits a text into records; comments are dropped.
///
/// # Errors
/// [`PlanError`] with the line of what is no group code, or of a code without a value.
pub(super) fn records(text: &str) -> Result<Vec<Record<'_>>, PlanError> {
    if text.starts_with("AutoCAD Binary DXF") {
        return Err(PlanError::DxfBinary);
    }
    let mut records: Vec<Record<'_>> = Vec::new();
    let mut lines = text.lines().zip(1u64..);
    while let Some((code, line)) = lines.next() {
        let number = code.trim().parse::<i32>();
        if number.is_err() && code.trim().is_empty() && lines.clone().all(|(rest, _)| rest.trim().is_empty()) {
            break;
        }
        let code = number.map_err(|_| refused("the number of a group", code, line))?;
        let (value, _) = lines.next().ok_or_else(|| refused("the value of a group", "", line + 1))?;
        let value = value.trim();
        match (code, records.last_mut()) {
            (999, _) => {}
            (0, _) => records.push(Record { name: value, line, groups: Vec::new() }),
            (_, Some(record)) => record.groups.push(Group { code, value, line }),
            (_, None) => return Err(refused("a `SECTION`", value, line)),
        }
    }
    Ok(records)
}

fn at(line: u64) -> Position {
    Position { line, column: 1 }
}

fn refused(expected: &'static str, found: &str, line: u64) -> PlanError {
    let found: String = found.trim().chars().take(20).collect();
    let found = if found.is_empty() { "nothing".to_owned() } else { format!("`{found}`") };
    PlanError::Dxf { expected, found, at: at(line) }
}

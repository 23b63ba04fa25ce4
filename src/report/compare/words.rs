//! What differs, in words.

use super::bytes::BytesChange;
use super::files::{Compared, Content};
use super::raster::{At, ClassesChange, LayerChange, Overlap, RasterChange, ValuesChange};
use super::settings::Setting;
use super::table::{Fate, RowChange, RowValue, TableChange, Value};
use super::weights::WeightsChange;
use crate::report::table::decimal;

/// Significant digits that are written.
const DIGITS: i32 = 6;
/// Letters of an entry that are written at most.
const LONGEST: usize = 100;
/// Values of a row that are written at most.
const MOST_VALUES: usize = 4;

/// Says how a file differs, in lines; of long lists at most `most` entries.
#[must_use]
pub fn lines(compared: &Compared, most: usize) -> Vec<String> {
    match &compared.content {
        Content::Same => vec!["the same, byte for byte".to_owned()],
        Content::Removed => vec!["only before".to_owned()],
        Content::Added => vec!["only after".to_owned()],
        Content::Raster(change) => raster(change),
        Content::Table(change) => table(change, most),
        Content::Weights(change) => weights(change, most),
        Content::Settings { entries } if entries.is_empty() => vec!["the same JSON, written otherwise".to_owned()],
        Content::Settings { entries } => settings(entries, most),
        Content::Bytes(change) => vec![bytes(change)],
    }
}

fn number(value: f64) -> String {
    decimal(value, DIGITS).replace('-', "−")
}

fn signed(value: f64) -> String {
    if value > 0.0 { format!("+{}", number(value)) } else { number(value) }
}

fn share(part: usize, whole: usize) -> String {
    format!("{part} of {whole} ({:.1} %)", 100.0 * part as f64 / whole.max(1) as f64)
}

fn raster(change: &RasterChange) -> Vec<String> {
    let mut lines = frames(change);
    for layer in &change.layers {
        match layer {
            LayerChange::Values(change) => lines.extend(values(change)),
            LayerChange::Classes(change) => lines.extend(classes(change)),
        }
    }
    lines.extend(change.removed.iter().map(|name| format!("{name}: only before")));
    lines.extend(change.added.iter().map(|name| format!("{name}: only after")));
    lines.extend(settings(&change.metadata, usize::MAX).into_iter().map(|line| format!("metadata {line}")));
    lines
}

/// Says how the grids lie if not on each other.
fn frames(change: &RasterChange) -> Vec<String> {
    let [before, after] = &change.frames;
    if before == after {
        return Vec::new();
    }
    let told = |frame: &crate::domain::geometry::Frame| {
        let yaw =
            if frame.yaw == 0.0 { String::new() } else { format!(", turned by {}°", number(frame.yaw.to_degrees())) };
        let (x, y) = (number(frame.origin.x), number(frame.origin.y));
        format!("{} × {} cells of {} m from ({x}, {y}) m{yaw}", frame.cols, frame.rows, number(frame.resolution))
    };
    let mut lines = vec![format!("the grids differ: {} → {}", told(before), told(after))];
    lines.push(match &change.overlap {
        Some(Overlap { cells, only_before, only_after, .. }) => {
            format!("{cells} cells are in both, {only_before} only before, {only_after} only after")
        }
        None => "they do not lie cell on cell, so their values are not compared".to_owned(),
    });
    lines
}

fn values(change: &ValuesChange) -> Vec<String> {
    let ValuesChange { column, cells, differing, undefined, mean_difference, largest_difference, sums, .. } = change;
    if *differing == 0 {
        return if *cells == 0 { Vec::new() } else { vec![format!("{column}: the same in all {cells} cells")] };
    }
    let undefined = if *undefined > 0 { format!(", {undefined} a number in one of both only") } else { String::new() };
    let mut lines = vec![
        format!("{column}: {} cells differ{undefined}", share(*differing, *cells)),
        format!(
            "  by {} at most and {} on average over all cells; the sum is {} → {} ({})",
            number(*largest_difference),
            number(*mean_difference),
            number(sums[0]),
            number(sums[1]),
            signed(sums[1] - sums[0])
        ),
    ];
    let place = |name: &str, at: &At| {
        let At { row, col, x, y, before, after } = *at;
        let (x, y) = (number((x * 1e4).round() / 1e4), number((y * 1e4).round() / 1e4));
        let change = signed(after - before);
        format!("  {name}: {} → {} ({change}) at ({x}, {y}) m, row {row}, column {col}", number(before), number(after))
    };
    lines.extend(change.most_more.iter().map(|at| place("risen most", at)));
    lines.extend(change.most_less.iter().map(|at| place("fallen most", at)));
    lines
}

/// Names a class of one of our own columns.
fn class_name(column: &str, class: i64) -> String {
    match (column, class) {
        ("class", -1) => "unlabeled".to_owned(),
        ("class" | "free", 0) => "blocked".to_owned(),
        ("free", 1) | ("observed", 1) => "free".to_owned(),
        ("observed", 0) => "occupied".to_owned(),
        ("observed", 2) => "unknown".to_owned(),
        _ => class.to_string(),
    }
}

fn classes(change: &ClassesChange) -> Vec<String> {
    let ClassesChange { column, cells, differing, classes, counts } = change;
    if *differing == 0 {
        return if *cells == 0 { Vec::new() } else { vec![format!("{column}: the same in all {cells} cells")] };
    }
    let names = || classes.iter().map(|class| class_name(column, *class));
    let mut rows = vec![std::iter::once("before ↓  after →".to_owned()).chain(names()).collect::<Vec<_>>()];
    rows.extend(names().zip(counts).map(|(name, counts)| {
        let counts = counts.iter().map(|count| if *count == 0 { "·".to_owned() } else { count.to_string() });
        std::iter::once(name).chain(counts).collect()
    }));
    let mut lines = vec![format!("{column}: {} cells differ", share(*differing, *cells))];
    lines.extend(aligned(&rows));
    lines
}

fn table(change: &TableChange, most: usize) -> Vec<String> {
    let TableChange { rows, key, only_before, only_after, differing, .. } = change;
    let by = if key.is_empty() { "their positions".to_owned() } else { key.join(", ") };
    let mut lines = vec![match rows[0] == rows[1] {
        true => format!("{} rows, held against each other by {by}", rows[0]),
        false => format!("{} → {} rows, held against each other by {by}", rows[0], rows[1]),
    }];
    if only_before + only_after > 0 {
        lines.push(format!("{only_before} rows only before, {only_after} only after"));
    }
    let shared = rows[0] - only_before;
    lines.push(match differing {
        0 => format!("the {shared} rows in both are the same"),
        _ => format!("{} rows in both differ", share(*differing, shared)),
    });
    lines.extend(change.removed.iter().map(|column| format!("column {} ({}): only before", column.name, column.data)));
    lines.extend(change.added.iter().map(|column| format!("column {} ({}): only after", column.name, column.data)));
    let retyped = change.retyped.iter();
    lines.extend(retyped.map(|column| format!("column {}: {} → {}", column.name, column.before, column.after)));
    if !change.columns.is_empty() {
        lines.extend(columns(change, most));
    }
    lines.extend(change.first_rows.iter().take(most).map(row));
    lines.extend(settings(&change.metadata, usize::MAX).into_iter().map(|line| format!("metadata {line}")));
    lines
}

/// Lists the columns that differ, with their largest changes.
fn columns(change: &TableChange, most: usize) -> Vec<String> {
    let header = ["column", "rows that differ", "mean change", "largest", "before", "after", "in the row"];
    let mut rows = vec![header.map(str::to_owned).to_vec()];
    for column in change.columns.iter().take(most) {
        let value = |of: &dyn Fn(&RowValue) -> Option<String>| {
            column.largest.as_ref().and_then(of).unwrap_or_else(|| "–".to_owned())
        };
        rows.push(vec![
            column.name.clone(),
            column.differing.to_string(),
            column.mean_difference.map_or_else(|| "–".to_owned(), number),
            value(&|value| value.difference.as_ref().map(|difference| written(difference, true))),
            value(&|value| Some(written(&value.before, false))),
            value(&|value| Some(written(&value.after, false))),
            value(&|value| Some(value.row.join(", "))),
        ]);
    }
    let mut lines = aligned(&rows);
    let more = change.columns.len().saturating_sub(most);
    if more > 0 {
        lines.push(format!("… and {more} more columns"));
    }
    lines
}

fn written(value: &Value, with_sign: bool) -> String {
    match value {
        Value::Absent => "–".to_owned(),
        Value::Whole(value) if with_sign && *value > 0 => format!("+{value}"),
        Value::Whole(value) => value.to_string().replace('-', "−"),
        Value::Real(value) if with_sign => signed(*value),
        Value::Real(value) => number(*value),
        Value::Text(text) => text.clone(),
    }
}

fn row(row: &RowChange) -> String {
    let name = row.row.join(", ");
    match row.change {
        Fate::Removed => format!("- row {name}"),
        Fate::Added => format!("+ row {name}"),
        Fate::Changed => {
            let value = |cell: &super::table::CellChange| {
                format!("{} {} → {}", cell.column, written(&cell.before, false), written(&cell.after, false))
            };
            let values: Vec<String> = row.values.iter().take(MOST_VALUES).map(value).collect();
            let more = if row.values.len() > MOST_VALUES { ", …" } else { "" };
            format!("~ row {name}: {}{more}", values.join(", "))
        }
    }
}

fn weights(change: &WeightsChange, most: usize) -> Vec<String> {
    let header = ["layer", "numbers", "that differ", "norm", "norm of change", "relative", "largest"];
    let mut rows = vec![header.map(str::to_owned).to_vec()];
    for layer in change.layers.iter().take(most).chain([&change.total]) {
        rows.push(vec![
            layer.layer.clone(),
            layer.numbers.to_string(),
            layer.differing.to_string(),
            number(layer.norm),
            number(layer.change),
            layer.relative.map_or_else(|| "–".to_owned(), |relative| format!("{:.2} %", 100.0 * relative)),
            number(layer.largest),
        ]);
    }
    let mut lines = aligned(&rows);
    let more = change.layers.len().saturating_sub(most);
    if more > 0 {
        lines.push(format!("… and {more} more layers"));
    }
    let shape =
        |shape: &Option<Vec<usize>>| shape.as_ref().map_or_else(|| "nothing".to_owned(), |shape| format!("{shape:?}"));
    let arrays = change.reshaped.iter();
    lines.extend(arrays.map(|array| format!("{}: {} → {}", array.array, shape(&array.before), shape(&array.after))));
    lines
}

fn settings(entries: &[Setting], most: usize) -> Vec<String> {
    let side = |value: &Option<String>| match value {
        None => "nothing".to_owned(),
        Some(text) if text.chars().count() > LONGEST => format!("{}…", text.chars().take(LONGEST).collect::<String>()),
        Some(text) => text.clone(),
    };
    let line = |entry: &Setting| format!("{}: {} → {}", entry.name, side(&entry.before), side(&entry.after));
    let mut lines: Vec<String> = entries.iter().take(most).map(line).collect();
    let more = entries.len().saturating_sub(most);
    if more > 0 {
        lines.push(format!("… and {more} more"));
    }
    lines
}

fn bytes(change: &BytesChange) -> String {
    let [before, after] = change.bytes;
    let first = change.first.map_or_else(String::new, |first| format!(", the first difference is byte {first}"));
    format!("{before} → {after} bytes{first}")
}

/// Arranges cells in columns, the first one at the left, all others at the right; a step further in than other lines.
fn aligned(rows: &[Vec<String>]) -> Vec<String> {
    let length = |text: &String| text.chars().count();
    let columns = rows.first().map_or(0, Vec::len);
    let widths: Vec<usize> =
        (0..columns).map(|column| rows.iter().map(|row| length(&row[column])).max().unwrap_or(0)).collect();
    let line = |row: &Vec<String>| {
        let cells = row.iter().zip(&widths).enumerate().map(|(at, (cell, width))| {
            let pad = " ".repeat(width - length(cell));
            if at == 0 { format!("{cell}{pad}") } else { format!("{pad}{cell}") }
        });
        format!("  {}", cells.collect::<Vec<_>>().join("  ").trim_end())
    };
    rows.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::geometry::{Frame, Grid};
    use crate::domain::quantize::Labels;
    use crate::domain::raster::VisitCounts;
    use crate::kinds::{Placed, SingleFile};
    use crate::report::compare::files::of_bytes;

    const FRAME: Frame = Frame::at_zero(0.5, 2, 3);

    fn check(before: Vec<u8>, after: Vec<u8>, expected: &str) {
        assert_eq!(lines(&of_bytes("", before, after), 20).join("\n"), expected);
    }

    #[test]
    fn rasters_are_told_cell_by_cell() {
        let visits = |counts: [u32; 6]| {
            let counts = Grid::from_vec(2, 3, counts.to_vec());
            Placed::new(FRAME, VisitCounts { counts, paths: 9, flow: None }).to_bytes().expect("encodes")
        };
        check(
            visits([0, 1, 2, 3, 4, 5]),
            visits([0, 1, 4, 3, 1, 5]),
            "visits: 2 of 6 (33.3 %) cells differ\n  by 3 at most and 0.833333 on average over all cells; the sum is 15 → 14 (−1)\n  \
             risen most: 2 → 4 (+2) at (1.25, 0.75) m, row 0, column 2\n  fallen most: 4 → 1 (−3) at (0.75, 0.25) m, row 1, column 1",
        );
        check(visits([1; 6]), visits([1; 6]), "the same, byte for byte");
    }

    #[test]
    fn labels_are_told_by_what_became_of_them() {
        let labels = |classes: [i8; 6], count| {
            let classes = Grid::from_vec(2, 3, classes.to_vec());
            Placed::new(FRAME, Labels { classes, count }).to_bytes().expect("encodes")
        };
        check(
            labels([-1, 0, 1, 1, 2, 2], 2),
            labels([-1, 0, 2, 1, 1, -1], 3),
            "class: 3 of 6 (50.0 %) cells differ\n  \
             before ↓  after →  unlabeled  blocked  1  2\n  \
             unlabeled                  1        ·  ·  ·\n  \
             blocked                    ·        1  ·  ·\n  \
             1                          ·        ·  1  1\n  \
             2                          1        ·  1  ·\n\
             metadata classes: 2 → 3",
        );
    }

    #[test]
    fn what_is_of_no_known_form_is_told_by_its_bytes() {
        check(b"PAR1 no".to_vec(), b"PAR1 yes".to_vec(), "7 → 8 bytes, the first difference is byte 5");
        check(b"{\"a\": 1}".to_vec(), b"{\"a\": 2}".to_vec(), "a: 1 → 2");
        check(b"{\"a\": 1}".to_vec(), b"{\"a\":1}".to_vec(), "the same JSON, written otherwise");
        check(b"abc".to_vec(), b"abd".to_vec(), "3 → 3 bytes, the first difference is byte 2");
    }
}

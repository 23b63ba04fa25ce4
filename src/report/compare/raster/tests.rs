use super::*;
use crate::domain::raster::VisitCounts;
use crate::kinds::parquet::read_any;
use crate::kinds::{Placed, SingleFile};

const FRAME: Frame = Frame { resolution: 0.5, origin: Point::new(1.0, 2.0), yaw: 0.0, rows: 2, cols: 3 };

fn raster(frame: Frame, layer: Layer) -> Raster {
    Raster { frame, layers: vec![("value".to_owned(), layer)], metadata: BTreeMap::new() }
}

fn numbers(frame: Frame, values: &[f64]) -> Raster {
    raster(frame, Layer::Values(Grid::from_vec(frame.rows, frame.cols, values.to_vec())))
}

fn of_values(change: &RasterChange) -> &ValuesChange {
    match change.layers.as_slice() {
        [LayerChange::Values(change)] => change,
        other => panic!("{other:?}"),
    }
}

#[test]
fn values_are_subtracted_cell_by_cell() {
    let before = numbers(FRAME, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    let after = numbers(FRAME, &[0.0, 1.0, 4.0, 3.0, 1.0, 5.0]);
    let change = compare(&before, &after);
    assert_eq!(change.overlap, Some(Overlap { offset: [0, 0], cells: 6, only_before: 0, only_after: 0 }));
    let change = of_values(&change);
    // +2 in the upper right corner, −3 in the middle of the lower row.
    assert_eq!((change.cells, change.differing, change.undefined), (6, 2, 0));
    assert_eq!((change.mean_difference, change.largest_difference, change.sums), (5.0 / 6.0, 3.0, [15.0, 14.0]));
    let at = |row, col, x, y, before, after| Some(At { row, col, x, y, before, after });
    assert_eq!(change.most_more, at(0, 2, 2.25, 2.75, 2.0, 4.0));
    assert_eq!(change.most_less, at(1, 1, 1.75, 2.25, 4.0, 1.0));
    let same = compare(&before, &before);
    assert_eq!((of_values(&same).differing, of_values(&same).most_more), (0, None));
}

#[test]
fn what_is_no_number_is_told_apart_from_what_differs() {
    let before = numbers(FRAME, &[f64::NAN, f64::NAN, 1.0, f64::INFINITY, f64::INFINITY, 2.0]);
    let after = numbers(FRAME, &[f64::NAN, 1.0, f64::NAN, f64::INFINITY, 1.0, 2.5]);
    let change = compare(&before, &after);
    let change = of_values(&change);
    // Three cells are a finite number in one of both only, one rises by a half.
    assert_eq!((change.differing, change.undefined), (4, 3));
    assert_eq!((change.mean_difference, change.sums), (0.5, [2.0, 2.5]));
}

#[test]
fn grids_that_lie_on_each_other_are_compared_where_both_are() {
    // One column further to the right, and one row higher.
    let other = Frame { origin: Point::new(1.5, 2.0), rows: 3, ..FRAME };
    let field = |frame: Frame| {
        let value = |cell| frame.to_map(frame.center(cell));
        let values: Vec<f64> = (0..frame.rows * frame.cols)
            .map(|at| value(Cell::new(at / frame.cols, at % frame.cols)))
            .map(|at| at.x + 10.0 * at.y)
            .collect();
        numbers(frame, &values)
    };
    let change = compare(&field(FRAME), &field(other));
    assert_eq!(change.overlap, Some(Overlap { offset: [1, -1], cells: 4, only_before: 2, only_after: 5 }));
    assert_eq!((of_values(&change).cells, of_values(&change).differing), (4, 0));
    for apart in [
        Frame { resolution: 0.25, ..FRAME },
        Frame { yaw: 0.1, ..FRAME },
        Frame { origin: Point::new(1.2, 2.0), ..FRAME },
        Frame { origin: Point::new(9.0, 2.0), ..FRAME },
    ] {
        let change = compare(&field(FRAME), &field(apart));
        assert_eq!((change.overlap, of_values(&change).cells), (None, 0), "{apart:?}");
    }
}

#[test]
fn classes_are_counted_by_what_became_of_them() {
    let classes = |values: [i64; 6]| raster(FRAME, Layer::Classes(Grid::from_vec(2, 3, values.to_vec())));
    let change = compare(&classes([-1, 0, 1, 1, 2, 3]), &classes([-1, 0, 2, 1, 1, -1]));
    let [LayerChange::Classes(change)] = change.layers.as_slice() else { panic!("{change:?}") };
    assert_eq!((change.cells, change.differing), (6, 3));
    assert_eq!(change.classes, [-1, 0, 1, 2, 3]);
    let expected: [[u64; 5]; 5] = [[1, 0, 0, 0, 0], [0, 1, 0, 0, 0], [0, 0, 1, 1, 0], [0, 0, 1, 0, 0], [1, 0, 0, 0, 0]];
    assert_eq!(change.counts, expected);
}

#[test]
fn our_rasters_are_known_by_their_rows_and_metadata() {
    let counts = |most| Grid::from_fn(2, 3, |cell| if cell == Cell::new(1, 2) { most } else { 1 });
    let table = |most, paths| {
        let visits = Placed::new(FRAME, VisitCounts { counts: counts(most), paths, flow: None });
        read_any(visits.to_bytes().expect("encodes")).expect("decodes")
    };
    let raster = |most, paths| Raster::of(&table(most, paths)).expect("it is one");
    let change = compare(&raster(7, 9), &raster(8, 10));
    assert_eq!((of_values(&change).column.as_str(), of_values(&change).sums), ("visits", [12.0, 13.0]));
    let [paths] = change.metadata.as_slice() else { panic!("{change:?}") };
    assert_eq!(
        (paths.name.as_str(), paths.before.as_deref(), paths.after.as_deref()),
        ("paths", Some("9"), Some("10"))
    );
    let mut cut = table(7, 9);
    cut.metadata.insert("rows".to_owned(), "3".to_owned());
    assert_eq!(Raster::of(&cut), None);
}

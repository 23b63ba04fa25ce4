use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use super::*;
use crate::domain::geometry::{Cell, Frame};
use crate::domain::planes::Plane;
use crate::domain::random::Stream;
use crate::domain::unet::Outputs;

/// A predictor that needs no network: what it says of a cell depends on the cells around it and on where the cell lies
/// in the image, as with zero padding.
fn synthetic(images: &[u8], rows: usize, cols: usize, n: usize, out: &mut [f32]) {
    assert_eq!((images.len(), out.len()), (n * rows * cols, n * rows * cols * 4));
    for (cell, out) in out.chunks_exact_mut(4).enumerate() {
        let (image, row, col) = (cell / (rows * cols), cell / cols % rows, cell % cols);
        let at = |dr: isize, dc: isize| {
            let (r, c) = (row as isize + dr, col as isize + dc);
            let inside = r >= 0 && c >= 0 && r < rows as isize && c < cols as isize;
            if inside { f32::from(images[image * rows * cols + r as usize * cols + c as usize]) } else { 0.0 }
        };
        let weights = [1.0 + at(0, 0), 2.0 * at(-2, 0) + 0.1, at(0, 3) + at(1, -1), 0.3 + at(5, 5)];
        let sum: f32 = weights.iter().sum();
        out.copy_from_slice(&weights.map(|w| w / sum));
    }
}

/// Predicts by [`synthetic`] and counts the images.
#[derive(Default)]
struct Synthetic {
    images: AtomicUsize,
    rows: AtomicUsize,
}

impl Predict for Synthetic {
    fn images(&self, images: &[u8], rows: usize, cols: usize, n: usize, out: &mut [f32]) {
        self.images.fetch_add(n, Relaxed);
        self.rows.store(rows, Relaxed);
        synthetic(images, rows, cols, n, out);
    }

    fn outputs(&self) -> Outputs {
        Outputs::Classes(3)
    }

    fn period(&self) -> usize {
        8
    }

    fn sight(&self) -> usize {
        5
    }

    fn edge(&self) -> usize {
        22
    }
}

fn maps() -> [OccupancyMap; 3] {
    let map = |rows, cols, density: f64| {
        let mut stream = Stream::new(5, &[0; 32], rows as u64, "annotate");
        let free = Grid::from_fn(rows, cols, |_| stream.unit() > density);
        OccupancyMap::new(free, Frame::at_zero(0.1, rows, cols)).expect("something is free")
    };
    [map(11, 17, 0.4), map(5, 3, 0.2), map(30, 9, 0.97)]
}

fn exact(overlap: Overlap) -> AnnotateConfig {
    AnnotateConfig { mode: Mode::Exact(overlap), ..AnnotateConfig::default() }
}

fn dense(offsets: u32) -> AnnotateConfig {
    AnnotateConfig { mode: Mode::Dense { offsets, augment: false }, ..AnnotateConfig::default() }
}

fn run(map: &OccupancyMap, window: usize, config: &AnnotateConfig) -> Annotation {
    annotate(map, window, config, &Synthetic::default(), &mut |_, _| ControlFlow::Continue(())).expect("in range")
}

/// Algorithm 1 read aloud: for each cell, every placement, one window at a time.
fn slow(map: &OccupancyMap, window: usize, stride: usize, counts: impl Fn(usize, usize) -> bool) -> Grid<f64> {
    let (n, free) = (window as isize, map.free());
    Grid::from_fn(free.rows(), free.cols(), |cell| {
        let (mut sum, mut covering) = (0.0, 0);
        for top in (-n..free.rows() as isize).filter(|top| top.rem_euclid(stride as isize) == 0) {
            for left in (-n..free.cols() as isize).filter(|left| left.rem_euclid(stride as isize) == 0) {
                let (row, col) = (cell.row as isize - top, cell.col as isize - left);
                if !(0..n).contains(&row) || !(0..n).contains(&col) || !counts(row as usize, col as usize) {
                    continue;
                }
                let image: Vec<u8> = (0..n * n).map(|i| u8::from(map.is_free(top + i / n, left + i % n))).collect();
                if !image.contains(&1) {
                    continue;
                }
                let mut out = vec![0.0; window * window * 4];
                synthetic(&image, window, window, 1, &mut out);
                let p = &out[(row as usize * window + col as usize) * 4..][..4];
                sum += (f64::from(p[0]) * 0.5 + f64::from(p[1]) + f64::from(p[2]) * 2.0) / 3.0 + f64::from(p[3]);
                covering += 1;
            }
        }
        if free[cell] { sum / f64::from(covering) } else { 0.0 }
    })
}

fn assert_close(found: &Grid<f32>, expected: &Grid<f64>) {
    for cell in expected.cells() {
        assert!((f64::from(found[cell]) - expected[cell]).abs() < 1e-6, "{cell:?}: {} {}", found[cell], expected[cell]);
    }
}

#[test]
fn algorithm_1_agrees_with_a_direct_computation() {
    for map in &maps() {
        for (window, stride) in [(8, 1), (8, 3), (16, 4)] {
            let config = exact(Overlap::Full { stride: stride as u32 });
            assert_close(&run(map, window, &config).heat, &slow(map, window, stride, |_, _| true));
        }
    }
}

#[test]
fn ablations_agree_with_a_direct_computation() {
    for map in &maps() {
        let config = exact(Overlap::None);
        assert_close(&run(map, 8, &config).heat, &slow(map, 8, 8, |_, _| true));
        let config = exact(Overlap::PerPixel { stride: 1 });
        assert_close(&run(map, 8, &config).heat, &slow(map, 8, 1, |row, col| (row, col) == (4, 4)));
        let config = exact(Overlap::PerPixel { stride: 2 });
        let center = |i: usize| i == 3 || i == 4;
        assert_close(&run(map, 8, &config).heat, &slow(map, 8, 2, |row, col| center(row) && center(col)));
    }
}

/// In windows of 64 the central cells do not depend on the edge, so the whole map is predicted at once.
#[test]
fn central_cells_agree_with_a_direct_computation() {
    let map = &maps()[1];
    // How many images are predicted: one for each offset at which windows begin, or (`None`) window by window.
    for (stride, expected) in [(1, Some(5 * 3)), (3, Some(3 * 2)), (16, Some(1)), (20, Some(2 * 2)), (21, None)] {
        let config = exact(Overlap::PerPixel { stride });
        let from = (64 - stride as usize).div_ceil(2);
        let center = |i: usize| (from..from + stride as usize).contains(&i);
        let predict = Synthetic::default();
        let found = annotate(map, 64, &config, &predict, &mut |_, _| ControlFlow::Continue(()));
        assert_close(&found.expect("in range").heat, &slow(map, 64, stride as usize, |r, c| center(r) && center(c)));
        let (images, rows) = (predict.images.into_inner(), predict.rows.into_inner());
        assert_eq!((rows != 64).then_some(images), expected, "{stride}");
    }
}

#[test]
fn probabilities_are_means_and_blocked_cells_are_zero() {
    let map = &maps()[0];
    let annotation = run(map, 8, &exact(Overlap::Full { stride: 4 }));
    for cell in map.free().cells() {
        let p: Vec<f32> = annotation.probabilities.iter().map(|grid| grid[cell]).collect();
        let sum: f32 = p.iter().sum();
        if map.free()[cell] {
            let heat = p[0] / 6.0 + p[1] / 3.0 + p[2] * 2.0 / 3.0 + p[3];
            assert!((sum - 1.0).abs() < 1e-5 && (annotation.heat[cell] - heat).abs() < 1e-5, "{cell:?}");
        } else {
            assert_eq!((sum, annotation.heat[cell]), (0.0, 0.0));
        }
    }
    let config = AnnotateConfig { normalize: Normalize::Max, ..exact(Overlap::Full { stride: 4 }) };
    let scaled = run(map, 8, &config).heat;
    assert_eq!(scaled.as_slice().iter().fold(0.0, |a: f32, b| a.max(*b)), 1.0);
}

/// The synthetic predictor sees no further than five cells, so with a margin its answer depends on the map alone.
#[test]
fn dense_mode_shows_every_cell_its_whole_surroundings() {
    for map in &maps() {
        for offsets in [1, 5, 64] {
            let config = dense(offsets);
            // One window whose center is the cell, large enough to hold all that the predictor sees.
            let config = run(map, 8, &config).heat;
            assert_close(&config, &slow(map, 16, 1, |row, col| (row, col) == (8, 8)));
        }
    }
}

/// Says as rank how far to the left the next blocked cell is (up to four cells), and as density one more.
struct Leftward;

impl Predict for Leftward {
    fn images(&self, images: &[u8], rows: usize, cols: usize, n: usize, out: &mut [f32]) {
        assert_eq!(images.len(), n * rows * cols);
        for (cell, out) in out.chunks_exact_mut(2).enumerate() {
            let (start, col) = (cell / cols * cols, cell % cols);
            let far = (0..4.min(col)).take_while(|far| images[start + col - 1 - far] == 1).count();
            out.copy_from_slice(&[far as f32 / 4.0, 1.0 + far as f32]);
        }
    }
    fn outputs(&self) -> Outputs {
        Outputs::Ranks { density: true, flow: false }
    }
    fn period(&self) -> usize {
        8
    }
    fn sight(&self) -> usize {
        4
    }
    fn edge(&self) -> usize {
        4
    }
}

/// Eight passes, one in each transform: the mean of what is seen to the left, right, above and below, each twice.
#[test]
fn augmented_predictions_do_not_prefer_a_direction() {
    for map in &maps() {
        let config = AnnotateConfig { mode: Mode::Dense { offsets: 8, augment: true }, ..AnnotateConfig::default() };
        let found = annotate(map, 8, &config, &Leftward, &mut |_, _| ControlFlow::Continue(())).expect("in range");
        let far = |cell: Cell, step: (isize, isize)| {
            let free = |k: isize| map.is_free(cell.row as isize + k * step.0, cell.col as isize + k * step.1);
            (1..=4).take_while(|k| free(*k)).count() as f64
        };
        let expected = Grid::from_fn(map.free().rows(), map.free().cols(), |cell| {
            let sum: f64 = [(0, -1), (0, 1), (-1, 0), (1, 0)].into_iter().map(|step| far(cell, step)).sum();
            if map.free()[cell] { sum / 16.0 } else { 0.0 }
        });
        assert_close(&found.heat, &expected);
        // Densities are 1 + 4 · rank in the mean, over the mean of that.
        let free = map.free().cells().filter(|cell| map.free()[*cell]);
        let (sum, count) = free.fold((0.0, 0.0), |(sum, count), cell| (sum + 1.0 + 4.0 * expected[cell], count + 1.0));
        let relative = |cell| if map.free()[cell] { (1.0 + 4.0 * expected[cell]) / (sum / count) } else { 0.0 };
        let density = Grid::from_fn(map.free().rows(), map.free().cols(), relative);
        assert_close(found.density.as_ref().expect("it says densities"), &density);
        assert!(found.probabilities.is_empty());
    }
}

/// Says as rank what the second plane, of paths, shows.
struct Shown;

impl Predict for Shown {
    fn images(&self, images: &[u8], rows: usize, cols: usize, n: usize, out: &mut [f32]) {
        let planes = images.chunks_exact(rows * cols).skip(1).step_by(2);
        assert_eq!((images.len(), planes.len()), (2 * n * rows * cols, n));
        out.iter_mut().zip(planes.flatten()).for_each(|(out, code)| *out = f32::from(*code) / 255.0);
    }
    fn besides(&self) -> &[Plane] {
        &[Plane::Paths]
    }
    fn outputs(&self) -> Outputs {
        Outputs::Ranks { density: false, flow: false }
    }
    fn period(&self) -> usize {
        8
    }
    fn sight(&self) -> usize {
        1
    }
    fn edge(&self) -> usize {
        1
    }
}

/// In every window, at every offset and in every transform a cell is shown with its own codes.
#[test]
fn planes_lie_on_the_map() {
    let map = &maps()[0];
    let dense = AnnotateConfig { mode: Mode::Dense { offsets: 16, augment: true }, ..AnnotateConfig::default() };
    for config in [dense, exact(Overlap::Full { stride: 3 })] {
        let found = annotate(map, 16, &config, &Shown, &mut |_, _| ControlFlow::Continue(())).expect("in range");
        assert_close(&found.heat, &Plane::Paths.of(map).map(|code| f64::from(*code) / 255.0));
    }
}

#[test]
fn dense_mode_does_not_depend_on_its_blocks() {
    let free = Grid::from_fn(6, 800, |cell| cell.col % 7 != 3 || cell.row == 2);
    let map = OccupancyMap::new(free, Frame::at_zero(0.1, 6, 800)).expect("free");
    let config = dense(2);
    assert_close(&run(&map, 8, &config).heat, &slow(&map, 16, 1, |row, col| (row, col) == (8, 8)));
}

#[test]
fn quantized_heat_has_the_given_distribution() {
    let map =
        OccupancyMap::new(Grid::from_fn(10, 11, |cell| cell.col != 10), Frame::at_zero(0.1, 10, 11)).expect("free");
    let mut stream = Stream::new(2, &[0; 32], 0, "heat");
    let heat = Grid::from_fn(10, 11, |_| stream.unit() as f32);
    let thresholds = thresholds(&heat, &map, &[0.8, 0.15, 0.05]);
    let classes = quantize(&heat, &map, &thresholds);
    let count = |class| classes.as_slice().iter().filter(|c| **c == class).count();
    assert_eq!([count(0), count(1), count(2), count(3)], [10, 80, 15, 5]);
    let hottest =
        |class| map.free().cells().filter(|c| classes[*c] == class).map(|c: Cell| heat[c]).fold(0.0, f32::max);
    assert!(hottest(1) < hottest(2) && hottest(2) < hottest(3));
}

#[test]
fn parameters_out_of_range_are_named() {
    let full = |stride| exact(Overlap::Full { stride });
    for stride in [0, 65] {
        assert_eq!(full(stride).check_with(64), Err(AnnotateError::Stride { stride, window: 64 }));
        let centers = exact(Overlap::PerPixel { stride });
        assert_eq!(centers.check_with(64), Err(AnnotateError::Stride { stride, window: 64 }));
    }
    assert_eq!(dense(65).check(), Err(AnnotateError::Offsets(65)));
    assert_eq!(dense(0).check(), Err(AnnotateError::Offsets(0)));
    assert_eq!(full(1).check_with(12), Err(AnnotateError::Window(12)));
    assert_eq!((full(64).check_with(64), dense(64).check_with(8)), (Ok(()), Ok(())));
    /// A network that halves its input more often, or less.
    struct Other(usize);
    impl Predict for Other {
        fn images(&self, _: &[u8], _: usize, _: usize, _: usize, _: &mut [f32]) {
            unreachable!("the parameters are refused")
        }
        fn outputs(&self) -> Outputs {
            Outputs::Ranks { density: false, flow: false }
        }
        fn period(&self) -> usize {
            self.0
        }
        fn sight(&self) -> usize {
            1
        }
        fn edge(&self) -> usize {
            1
        }
    }
    let refused = |period, window, config: AnnotateConfig| {
        annotate(&maps()[0], window, &config, &Other(period), &mut |_, _| ControlFlow::Continue(())).err()
    };
    assert_eq!(refused(32, 40, dense(1)), Some(AnnotateError::WindowOfNetwork { window: 40, period: 32 }));
    assert_eq!(refused(4, 40, dense(17)), Some(AnnotateError::OffsetsOfNetwork { offsets: 17, all: 16 }));
}

#[test]
fn progress_may_end_the_work() {
    let config = exact(Overlap::Full { stride: 8 });
    let result = annotate(&maps()[0], 24, &config, &Synthetic::default(), &mut |_, _| ControlFlow::Break(()));
    assert_eq!(result, Err(AnnotateError::Cancelled));
}

//! From the drawing to pixels: turned by any angle, scaled, mirrored.

use super::super::outline::Outline;
use super::super::site::Drawing;
use crate::domain::geometry::{Grid, Point};

/// The edge of a cell of the drawing, in meters.
const DRAWN: f64 = 0.1;

/// How a drawing comes to lie.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pose {
    /// In radians.
    pub angle: f64,
    /// Factor of all lengths.
    pub scale: f64,
    pub mirrored: bool,
    /// How much thinner walls are on each side than drawn, in cells of the drawing, below 0.5.
    pub skin: f64,
}

/// A drawing that is being turned.
struct Turned<'a> {
    drawing: &'a Drawing,
    pose: Pose,
    sin: f64,
    cos: f64,
    /// Pixels of a cell of the drawing.
    zoom: f64,
    rows: usize,
    cols: usize,
}

/// Draws in pixels of so many meters; `true` is free.
pub(super) fn pixels(drawing: &Drawing, pose: Pose, pixel: f64) -> Grid<bool> {
    let zoom = DRAWN * pose.scale / pixel;
    let (sin, cos) = if pose.angle == 0.0 { (0.0, 1.0) } else { (libm::sin(pose.angle), libm::cos(pose.angle)) };
    let (height, width) = (drawing.free.rows() as f64 * zoom, drawing.free.cols() as f64 * zoom);
    let rows = (height * cos.abs() + width * sin.abs()).ceil() as usize + 4;
    let cols = (width * cos.abs() + height * sin.abs()).ceil() as usize + 4;
    let turned = Turned { drawing, pose, sin, cos, zoom, rows, cols };
    let mut free = Grid::from_fn(rows, cols, |cell| {
        turned.is_free(turned.back(Point::new(cell.col as f64 + 0.5, cell.row as f64 + 0.5)))
    });
    for outline in &drawing.outlines {
        turned.paint(outline, &mut free);
    }
    free
}

impl Turned<'_> {
    /// Returns where a point of the pixels lies in the drawing.
    fn back(&self, at: Point) -> Point {
        let (x, y) = (at.x - self.cols as f64 / 2.0, at.y - self.rows as f64 / 2.0);
        let (x, y) = ((self.cos * x + self.sin * y) / self.zoom, (self.cos * y - self.sin * x) / self.zoom);
        let x = if self.pose.mirrored { -x } else { x };
        Point::new(x + self.drawing.free.cols() as f64 / 2.0, y + self.drawing.free.rows() as f64 / 2.0)
    }

    /// Returns where a point of the drawing lies in the pixels.
    fn forth(&self, at: Point) -> Point {
        let (x, y) = (at.x - self.drawing.free.cols() as f64 / 2.0, at.y - self.drawing.free.rows() as f64 / 2.0);
        let x = if self.pose.mirrored { -x } else { x };
        let (x, y) = (x * self.zoom, y * self.zoom);
        Point::new(
            self.cos * x - self.sin * y + self.cols as f64 / 2.0,
            self.sin * x + self.cos * y + self.rows as f64 / 2.0,
        )
    }

    /// Tells whether a point of the drawing is free, or as near to a free cell as walls are thinner than drawn.
    fn is_free(&self, at: Point) -> bool {
        let cell = |x: f64, y: f64| self.drawing.free.get(y.floor() as isize, x.floor() as isize) == Some(&true);
        let skin = self.pose.skin;
        cell(at.x, at.y)
            || (skin > 0.0
                && [(-skin, -skin), (skin, -skin), (skin, skin), (-skin, skin)]
                    .into_iter()
                    .any(|(x, y)| cell(at.x + x, at.y + y)))
    }

    /// Blocks the pixels whose centers lie in an outline.
    fn paint(&self, outline: &Outline, free: &mut Grid<bool>) {
        let (left, top) = (f64::from(self.drawing.x), f64::from(self.drawing.y));
        let bounds = outline.bounds();
        let corners = [
            (bounds.left, bounds.top),
            (bounds.right, bounds.top),
            (bounds.right, bounds.bottom),
            (bounds.left, bounds.bottom),
        ]
        .map(|(x, y)| self.forth(Point::new(f64::from(x) + left, f64::from(y) + top)));
        let low = |pick: fn(&Point) -> f64| corners.iter().map(pick).fold(f64::INFINITY, f64::min).max(0.0) as usize;
        let high = |pick: fn(&Point) -> f64| corners.iter().map(pick).fold(0.0, f64::max).ceil() as usize;
        for row in low(|p| p.y)..high(|p| p.y).min(self.rows) {
            for col in low(|p| p.x)..high(|p| p.x).min(self.cols) {
                let at = self.back(Point::new(col as f64 + 0.5, row as f64 + 0.5));
                if outline.covers(Point::new(at.x - left, at.y - top)) {
                    free.as_mut_slice()[row * self.cols + col] = false;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::geometry::Cell;

    const STILL: Pose = Pose { angle: 0.0, scale: 1.0, mirrored: false, skin: 0.0 };

    fn drawing(rows: &[&str], outlines: Vec<Outline>) -> Drawing {
        let free = Grid::from_fn(rows.len(), rows[0].len(), |c| rows[c.row].as_bytes()[c.col] == b'.');
        Drawing { free, x: 0, y: 0, outlines }
    }

    /// The rows of pixels that are not blocked all along, without their blocked margins.
    fn drawn(free: &Grid<bool>) -> Vec<String> {
        let text = |row: usize| free.row(row).iter().map(|free| if *free { '.' } else { '#' }).collect::<String>();
        let rows = (0..free.rows()).map(text).map(|row| row.trim_matches('#').to_owned());
        rows.filter(|row| !row.is_empty()).collect()
    }

    #[test]
    fn a_drawing_that_is_not_turned_stays_as_it_is() {
        let room = drawing(&["#####", "#..##", "#...#", "#####"], Vec::new());
        assert_eq!(drawn(&pixels(&room, STILL, 0.05)), ["....", "....", "......", "......"]);
        // A quarter of a cell on each side of a wall of two cells is one of eight pixels.
        let walls = drawing(&["########", "#..##..#", "########"], Vec::new());
        let thin = Pose { skin: 0.25, ..STILL };
        assert_eq!(drawn(&pixels(&walls, STILL, 0.025))[0], "........########........");
        assert_eq!(drawn(&pixels(&walls, thin, 0.025))[0], "..........######..........");
        let large = Pose { scale: 1.25, ..STILL };
        assert_eq!(drawn(&pixels(&walls, large, 0.025))[0], "..........##########..........");
    }

    #[test]
    fn a_quarter_turn_swaps_rows_and_columns() {
        let room = drawing(&["####", "#..#", "#..#", "#..#", "####"], Vec::new());
        let quarter = Pose { angle: std::f64::consts::FRAC_PI_2, ..STILL };
        assert_eq!(drawn(&pixels(&room, quarter, 0.05)), ["......"; 4]);
    }

    #[test]
    fn areas_stay_under_any_angle() {
        let rows = vec![format!("#{}#", ".".repeat(40)); 30];
        let rows: Vec<&str> = rows.iter().map(String::as_str).collect();
        let column = Outline::Disc { center: Point::new(20.0, 15.0), radius: 8.0 };
        for angle in [0.3, 1.0, 2.5, 4.0] {
            for mirrored in [false, true] {
                let pose = Pose { angle, mirrored, ..STILL };
                let free = pixels(&drawing(&rows, vec![column.clone()]), pose, 0.05);
                let area = free.cells().filter(|cell: &Cell| free[*cell]).count() as f64 * 0.0025;
                // 3 m by 4 m, less a disc of 0.8 m.
                let expected = 12.0 - std::f64::consts::PI * 0.64;
                assert!((area / expected - 1.0).abs() < 0.01, "{angle}: {area:.2} instead of {expected:.2}");
            }
        }
    }
}

//! Figures as PNG: title, meter axes, color bar or legend, in pixels that print well.

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use crate::domain::geometry::Grid;

use super::axis::{Axis, Tick};
use super::canvas::{Canvas, Font};
use super::colors::{self, Rgb};
use super::picture::{Key, Picture, Scale, ink_at};

/// Length of the longer edge of the plot in pixels, about.
const EDGE: usize = 960;
/// Most pixels along the edge of a cell.
const BIGGEST_CELL: usize = 24;
const MARGIN: usize = 18;
const TICK: usize = 6;
const BAR: usize = 22;

/// Draws a picture as a figure: the bytes of a PNG file.
#[must_use]
pub fn figure(picture: &Picture, scale: Scale, title: &str) -> Vec<u8> {
    let layout = Layout::of(picture, &picture.key(scale), title);
    let mut canvas = Canvas::new(layout.width, layout.height);
    canvas.text(layout.left, MARGIN, title, Font::TITLE);
    layout.plot(&mut canvas, &picture.paint(scale));
    layout.axes(&mut canvas);
    if let Some((axis, unit)) = &layout.key.bar {
        layout.bar(&mut canvas, axis, unit);
    }
    layout.legend(&mut canvas);
    let (width, height, bytes) = canvas.into_rgb();
    encode(width, height, &bytes)
}

/// Encodes a raster, one pixel for each of its cells.
#[must_use]
pub(super) fn raster(pixels: &Grid<Rgb>) -> Vec<u8> {
    encode(pixels.cols(), pixels.rows(), &pixels.as_slice().concat())
}

fn encode(width: usize, height: usize, bytes: &[u8]) -> Vec<u8> {
    let size = |edge: usize| u32::try_from(edge).expect("a figure has fewer than 2³² pixels along an edge");
    let mut png = Vec::new();
    PngEncoder::new_with_quality(&mut png, CompressionType::Level(7), FilterType::NoFilter)
        .write_image(bytes, size(width), size(height), ExtendedColorType::Rgb8)
        .expect("encoding into memory does not fail");
    png
}

/// The axes of a picture: names and marks, x from left to right and y from bottom to top.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Axes {
    pub x: Vec<Tick>,
    pub y: Vec<Tick>,
    pub x_name: String,
    pub y_name: String,
}

impl Axes {
    /// Returns the axes of a picture that lies somewhere, with at most about so many marks.
    ///
    /// They are in the map's frame; a grid that is turned against it has axes of its own, along its edges.
    #[must_use]
    pub fn of(picture: &Picture, across: usize, up: usize) -> Option<Self> {
        let frame = picture.frame()?;
        let turned = frame.yaw.abs() > 1e-9;
        let (x, y) = if turned { (0.0, 0.0) } else { (frame.origin.x, frame.origin.y) };
        let side = |low: f64, cells: usize, count| {
            Axis { low, high: low + cells as f64 * frame.resolution, scale: Scale::Linear }.ticks(count)
        };
        let name = |axis: &str| if turned { format!("along the grid's {axis} [m]") } else { format!("{axis} [m]") };
        Some(Self { x: side(x, frame.cols, across), y: side(y, frame.rows, up), x_name: name("x"), y_name: name("y") })
    }
}

/// Where everything of a figure goes, in pixels.
struct Layout {
    key: Key,
    axes: Option<Axes>,
    /// Pixels along the edge of a cell.
    cell: usize,
    left: usize,
    top: usize,
    plot_width: usize,
    plot_height: usize,
    width: usize,
    height: usize,
}

impl Layout {
    fn of(picture: &Picture, key: &Key, title: &str) -> Self {
        let (rows, cols) = (picture.rows(), picture.cols());
        let cell = (EDGE / rows.max(cols).max(1)).clamp(1, BIGGEST_CELL);
        let (plot_width, plot_height) = (cols * cell, rows * cell);
        let axes = Axes::of(picture, (plot_width / 110).clamp(2, 10), (plot_height / 80).clamp(2, 10));
        let widest = |ticks: &[Tick]| ticks.iter().map(|tick| Font::SMALL.width(&tick.text)).max().unwrap_or(0);
        let left = axes.as_ref().map_or(MARGIN, |axes| MARGIN + Font::SMALL.height() + 6 + widest(&axes.y) + TICK + 4);
        let right = key.bar.as_ref().map_or(MARGIN, |(axis, _)| {
            MARGIN + BAR + TICK + 4 + widest(&axis.ticks(6)) + 6 + Font::SMALL.height() + MARGIN
        });
        let wanted = [
            left + plot_width + right,
            left + Font::TITLE.width(title) + MARGIN,
            left + key.legend.iter().map(|(name, _)| legend_width(name)).max().unwrap_or(0),
        ];
        let width = wanted.into_iter().max().unwrap_or(0);
        let top = MARGIN + Font::TITLE.height() + 14;
        let mut layout = Self { key: key.clone(), axes, cell, left, top, plot_width, plot_height, width, height: 0 };
        layout.height = layout.legend_top() + layout.legend_rows() * (Font::SMALL.height() + 6) + MARGIN - 6;
        layout
    }

    const fn bottom(&self) -> usize {
        self.top + self.plot_height
    }

    fn legend_top(&self) -> usize {
        self.bottom() + if self.axes.is_some() { TICK + 4 + 2 * Font::SMALL.height() + 14 } else { 14 }
    }

    fn legend_rows(&self) -> usize {
        self.legend_places().last().map_or(0, |(_, row)| row + 1)
    }

    /// Returns column in pixels and row of each entry of the legend.
    fn legend_places(&self) -> Vec<(usize, usize)> {
        let (mut x, mut row) = (self.left, 0);
        let mut places = Vec::new();
        for (name, _) in &self.key.legend {
            let wide = legend_width(name);
            if x > self.left && x + wide > self.width {
                (x, row) = (self.left, row + 1);
            }
            places.push((x, row));
            x += wide;
        }
        places
    }

    fn plot(&self, canvas: &mut Canvas, pixels: &Grid<Rgb>) {
        for cell in pixels.cells() {
            let (x, y) = (self.left + cell.col * self.cell, self.top + cell.row * self.cell);
            canvas.fill(x, y, self.cell, self.cell, pixels[cell]);
        }
        canvas.frame(self.left, self.top, self.plot_width, self.plot_height, colors::INK);
    }

    fn axes(&self, canvas: &mut Canvas) {
        let Some(axes) = &self.axes else { return };
        let (font, half) = (Font::SMALL, Font::SMALL.height() / 2);
        for tick in &axes.x {
            let x = self.left + along(tick.at, self.plot_width);
            canvas.fill(x, self.bottom(), 1, TICK, colors::INK);
            let wide = font.width(&tick.text);
            canvas.text(x.saturating_sub(wide / 2), self.bottom() + TICK + 3, &tick.text, font);
        }
        for tick in &axes.y {
            let y = self.bottom() - 1 - along(tick.at, self.plot_height);
            canvas.fill(self.left - TICK, y, TICK, 1, colors::INK);
            let wide = font.width(&tick.text);
            canvas.text(self.left - TICK - 4 - wide, y.saturating_sub(half), &tick.text, font);
        }
        let middle = self.left + (self.plot_width.saturating_sub(font.width(&axes.x_name))) / 2;
        canvas.text(middle, self.bottom() + TICK + 5 + font.height(), &axes.x_name, font);
        let start = self.bottom() - (self.plot_height.saturating_sub(font.width(&axes.y_name))) / 2;
        canvas.text_upwards(MARGIN, start, &axes.y_name, font);
    }

    fn bar(&self, canvas: &mut Canvas, axis: &Axis, unit: &str) {
        let (x, font) = (self.left + self.plot_width + MARGIN, Font::SMALL);
        for row in 0..self.plot_height {
            let share = 1.0 - row as f64 / (self.plot_height - 1).max(1) as f64;
            canvas.fill(x, self.top + row, BAR, 1, ink_at(axis, share).color());
        }
        canvas.frame(x, self.top, BAR, self.plot_height, colors::INK);
        let ticks = axis.ticks((self.plot_height / 60).clamp(2, 8));
        for tick in &ticks {
            let y = self.bottom() - 1 - along(tick.at, self.plot_height);
            canvas.fill(x + BAR, y, TICK, 1, colors::INK);
            canvas.text(x + BAR + TICK + 3, y.saturating_sub(font.height() / 2), &tick.text, font);
        }
        let log = if axis.scale == Scale::Log { ", log scale" } else { "" };
        let name = format!("{unit}{log}");
        let start = self.bottom() - (self.plot_height.saturating_sub(font.width(&name))) / 2;
        canvas.text_upwards(self.width - MARGIN - font.height(), start, &name, font);
    }

    fn legend(&self, canvas: &mut Canvas) {
        let (font, side) = (Font::SMALL, Font::SMALL.height() - 4);
        for ((name, color), (x, row)) in self.key.legend.iter().zip(self.legend_places()) {
            let y = self.legend_top() + row * (font.height() + 6);
            canvas.fill(x + 1, y + 3, side, side, *color);
            canvas.frame(x + 1, y + 3, side, side, colors::INK);
            canvas.text(x + side + 8, y, name, font);
        }
    }
}

fn legend_width(name: &str) -> usize {
    Font::SMALL.height() + 4 + Font::SMALL.width(name) + 22
}

fn along(share: f64, length: usize) -> usize {
    (share * (length - 1) as f64).round() as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::geometry::{Cell, Frame, Point};

    fn picture(frame: Frame) -> Picture {
        let values = Grid::from_fn(frame.rows, frame.cols, |c| (c.row * c.col) as f32);
        let walls = Grid::from_fn(frame.rows, frame.cols, |c| c.row == 0);
        Picture::values(frame, values, Some(walls), "visits", Some("not visited"))
    }

    fn decoded(png: &[u8]) -> image::RgbImage {
        image::load_from_memory(png).expect("decodes").to_rgb8()
    }

    #[test]
    fn a_figure_holds_the_colors_of_its_cells() {
        for scale in [Scale::Linear, Scale::Log] {
            let picture = picture(Frame::at_zero(0.1, 30, 40));
            let image = decoded(&figure(&picture, scale, "visits/home_00"));
            let painted = picture.paint(scale);
            for cell in [Cell::new(0, 0), Cell::new(29, 39), Cell::new(5, 0), Cell::new(10, 10)] {
                let found = image.pixels().filter(|pixel| pixel.0 == painted[cell]).count();
                // A cell is 24 pixels a side.
                assert!(found >= 24 * 24, "{cell:?} {found}");
            }
        }
    }

    #[test]
    fn maps_of_any_size_have_a_figure() {
        for (rows, cols) in [(1, 1), (3, 900), (1500, 20)] {
            let frame = Frame { yaw: 0.3, origin: Point::new(-120.0, 3.0), ..Frame::at_zero(0.05, rows, cols) };
            let image = decoded(&figure(&picture(frame), Scale::Log, "a title that is longer than the map is wide"));
            assert!(image.width() as usize > cols && image.height() as usize > rows);
        }
    }

    #[test]
    fn axes_are_in_the_frame_of_the_map() {
        let frame = Frame { origin: Point::new(-1.0, 20.0), ..Frame::at_zero(0.1, 40, 30) };
        let axes = Axes::of(&picture(frame), 3, 4).expect("it lies somewhere");
        let texts = |ticks: &[Tick]| ticks.iter().map(|tick| tick.text.clone()).collect::<Vec<_>>();
        assert_eq!(texts(&axes.x), ["-1", "0", "1", "2"]);
        assert_eq!(texts(&axes.y), ["20", "21", "22", "23", "24"]);
        let turned = Axes::of(&picture(Frame { yaw: 1.0, ..frame }), 3, 4).expect("it lies somewhere");
        assert_eq!(texts(&turned.x), ["0", "1", "2", "3"]);
        assert_eq!(turned.x_name, "along the grid's x [m]");
    }
}

//! A picture as a figure of the page: the raster as PNG, everything else as SVG text and lines.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use maud::{Markup, PreEscaped, html};

use crate::report::axis::{Axis, Tick};
use crate::report::charts::{Anchor, Svg};
use crate::report::colors;
use crate::report::picture::{Picture, Scale, ink_at};
use crate::report::png::{self, Axes};

/// Width of a plot in pixels of the page.
const WIDTH: f64 = 270.0;
/// Width and height of a plot of a large map at most.
const LARGE: f64 = 560.0;
/// Width of a picture that lies nowhere, of many parts.
const WIDE: f64 = 720.0;
/// Height of a plot at most.
const TALLEST: f64 = 340.0;
const BAR: f64 = 11.0;

/// Draws a picture with its axes, color bar or legend, and caption.
#[must_use]
pub fn figure(picture: &Picture, scale: Scale, caption: &str, node: &str) -> Markup {
    let key = picture.key(scale);
    html! {
        figure {
            (PreEscaped(plot(picture, scale, caption)))
            @if !key.legend.is_empty() {
                ul.legend {
                    @for (name, color) in &key.legend {
                        li { i style=(format!("background:{}", colors::hex(*color))) {} (name) }
                    }
                }
            }
            figcaption { (caption) @if !node.is_empty() { " " code { (node) } } }
        }
    }
}

fn plot(picture: &Picture, scale: Scale, label: &str) -> String {
    let (rows, cols) = (picture.rows() as f64, picture.cols() as f64);
    let wide = plot_width(picture, rows, cols);
    let high = (wide * rows / cols).max(8.0);
    let axes = Axes::of(picture, (wide / 60.0) as usize, ((high / 45.0) as usize).max(1));
    let (left, bottom) = if axes.is_some() { (42.0, 34.0) } else { (4.0, 4.0) };
    let bar = picture.key(scale).bar;
    let right = bar.as_ref().map_or(10.0, |(axis, _)| 14.0 + BAR + beside_bar(axis, high) + 18.0);
    let top = 6.0;
    let mut svg = Svg::new(left + wide + right, top + high + bottom);
    // Cells larger than a pixel of the page keep their edges; smaller ones are averaged.
    let class = if cols <= wide { "cells" } else { "smooth" };
    let data = STANDARD.encode(png::raster(&picture.paint(scale)));
    svg.raw(format_args!(
        "<image x=\"{left}\" y=\"{top}\" width=\"{wide:.2}\" height=\"{high:.2}\" preserveAspectRatio=\"none\" \
         class=\"{class}\" href=\"data:image/png;base64,{data}\"/>"
    ));
    svg.rect([left, top, wide, high], "class=\"frame\"");
    if let Some(axes) = &axes {
        draw_axes(&mut svg, axes, [left, top, wide, high]);
    }
    if let Some((axis, unit)) = &bar {
        draw_bar(&mut svg, axis, unit, [left + wide + 14.0, top, BAR, high]);
    }
    svg.finish(label)
}

/// Chooses a width: a large map gets more room, so that its doors can be seen.
fn plot_width(picture: &Picture, rows: f64, cols: f64) -> f64 {
    let Some(frame) = picture.frame() else { return WIDE.min(WIDE * cols / rows) };
    // Pictures of tracks are finer than their map: count meters instead of cells.
    let (wide, high) = (frame.cols as f64 * frame.resolution * 10.0, frame.rows as f64 * frame.resolution * 10.0);
    let (most, tallest) = (wide.clamp(WIDTH, LARGE), high.clamp(TALLEST, LARGE));
    most.min(tallest * cols / rows).max(24.0)
}

fn draw_axes(svg: &mut Svg, axes: &Axes, [left, top, wide, high]: [f64; 4]) {
    let bottom = top + high;
    for tick in &axes.x {
        let x = left + tick.at * wide;
        svg.line([x, bottom, x, bottom + 4.0], "class=\"ink\"");
        svg.text([x, bottom + 15.0], Anchor::Middle, "tiny", &tick.text);
    }
    for tick in &axes.y {
        let y = bottom - tick.at * high;
        svg.line([left - 4.0, y, left, y], "class=\"ink\"");
        svg.text([left - 7.0, y + 3.5], Anchor::End, "tiny", &tick.text);
    }
    svg.text([left + wide / 2.0, bottom + 29.0], Anchor::Middle, "tiny muted", &axes.x_name);
    svg.text_upwards([11.0, top + high / 2.0], "tiny muted", &axes.y_name);
}

fn bar_ticks(axis: &Axis, high: f64) -> Vec<Tick> {
    axis.ticks(((high / 40.0) as usize).clamp(1, 6))
}

/// Returns how much room the numbers beside a color bar need.
fn beside_bar(axis: &Axis, high: f64) -> f64 {
    let letters = bar_ticks(axis, high).iter().map(|tick| tick.text.len()).max().unwrap_or(0);
    8.0 + 6.4 * letters as f64
}

fn draw_bar(svg: &mut Svg, axis: &Axis, unit: &str, [x, top, wide, high]: [f64; 4]) {
    const STEPS: usize = 64;
    for i in 0..STEPS {
        let share = 1.0 - (i as f64 + 0.5) / STEPS as f64;
        let y = top + high * i as f64 / STEPS as f64;
        // A little overlap leaves no hairlines between the steps.
        let color = format!("fill=\"{}\"", colors::hex(ink_at(axis, share).color()));
        svg.rect([x, y, wide, (high / STEPS as f64 + 0.6).min(top + high - y)], &color);
    }
    svg.rect([x, top, wide, high], "class=\"frame\"");
    for tick in bar_ticks(axis, high) {
        let y = top + high * (1.0 - tick.at);
        svg.line([x + wide, y, x + wide + 3.0, y], "class=\"ink\"");
        svg.text([x + wide + 6.0, y + 3.5], Anchor::Start, "tiny", &tick.text);
    }
    let log = if axis.scale == Scale::Log { ", log" } else { "" };
    svg.text_upwards(
        [x + wide + beside_bar(axis, high) + 11.0, top + high / 2.0],
        "tiny muted",
        &format!("{unit}{log}"),
    );
}

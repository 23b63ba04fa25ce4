//! Writes SVG.

use std::fmt::Write;

/// A drawing in the making; lengths are in pixels.
#[derive(Debug)]
pub struct Svg {
    width: f64,
    height: f64,
    body: String,
}

/// Where a text stands to its point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// At the start of the text.
    Start,
    /// In the middle of the text.
    Middle,
    /// At the end of the text.
    End,
}

impl Svg {
    /// Starts an empty drawing.
    #[must_use]
    pub const fn new(width: f64, height: f64) -> Self {
        Self { width, height, body: String::new() }
    }

    /// Draws a rectangle.
    pub fn rect(&mut self, [x, y, width, height]: [f64; 4], attributes: &str) {
        self.raw(format_args!(
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" {attributes}/>",
            short(x),
            short(y),
            short(width),
            short(height)
        ));
    }

    /// Draws a line.
    pub fn line(&mut self, [x1, y1, x2, y2]: [f64; 4], attributes: &str) {
        self.raw(format_args!(
            "<line x1=\"{}\" y1=\"{}\" x2=\"{}\" y2=\"{}\" {attributes}/>",
            short(x1),
            short(y1),
            short(x2),
            short(y2)
        ));
    }

    /// Draws a disc.
    pub fn circle(&mut self, [x, y]: [f64; 2], radius: f64, attributes: &str) {
        self.raw(format_args!(
            "<circle cx=\"{}\" cy=\"{}\" r=\"{}\" {attributes}/>",
            short(x),
            short(y),
            short(radius)
        ));
    }

    /// Draws a path.
    pub fn path(&mut self, path: &str, attributes: &str) {
        self.raw(format_args!("<path d=\"{path}\" {attributes}/>"));
    }

    /// Writes text.
    pub fn text(&mut self, [x, y]: [f64; 2], anchor: Anchor, class: &str, text: &str) {
        self.text_with([x, y], anchor, class, "", text);
    }

    /// Writes text with more attributes.
    pub fn text_with(&mut self, [x, y]: [f64; 2], anchor: Anchor, class: &str, attributes: &str, text: &str) {
        let anchor = match anchor {
            Anchor::Start => "",
            Anchor::Middle => " text-anchor=\"middle\"",
            Anchor::End => " text-anchor=\"end\"",
        };
        self.raw(format_args!(
            "<text x=\"{}\" y=\"{}\" class=\"{class}\"{anchor} {attributes}>{}</text>",
            short(x),
            short(y),
            escaped(text)
        ));
    }

    /// Writes text from bottom to top around a point.
    pub fn text_upwards(&mut self, [x, y]: [f64; 2], class: &str, text: &str) {
        let turn = format!("transform=\"rotate(-90 {} {})\"", short(x), short(y));
        self.text_with([x, y], Anchor::Middle, class, &turn, text);
    }

    /// Adds markup as it is.
    pub fn raw(&mut self, markup: std::fmt::Arguments<'_>) {
        self.body.write_fmt(markup).expect("writing to a string does not fail");
    }

    /// Ends the drawing; `label` is read to those who cannot see it.
    #[must_use]
    pub fn finish(self, label: &str) -> String {
        let (width, height) = (short(self.width), short(self.height));
        format!(
            "<svg viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" role=\"img\" \
             aria-label=\"{}\">{}</svg>",
            escaped(label),
            self.body
        )
    }
}

/// Writes a coordinate with two decimals at most.
#[must_use]
pub fn short(value: f64) -> String {
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// Returns about how wide a text is in the style sheet's small font.
#[must_use]
pub fn wide(text: &str) -> f64 {
    6.9 * text.chars().count() as f64
}

/// Makes text safe to stand between tags and in attributes.
#[must_use]
pub fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    // Control characters are none of XML's.
    let text: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    maud::Escaper::new(&mut safe).write_str(&text).expect("writing to a string does not fail");
    safe
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_break_out() {
        let mut svg = Svg::new(10.0, 20.5);
        svg.text([1.0, 2.0], Anchor::End, "t", "</text><script>");
        let text = svg.finish("a \"b\"");
        assert!(
            text.contains("&lt;/text&gt;&lt;script&gt;") && text.contains("aria-label=\"a &quot;b&quot;\""),
            "{text}"
        );
        assert!(text.starts_with("<svg viewBox=\"0 0 10 20.5\""), "{text}");
    }

    #[test]
    fn coordinates_are_short() {
        for (value, expected) in [(1.0, "1"), (0.126, "0.13"), (-0.001, "0"), (100.0, "100")] {
            assert_eq!(short(value), expected);
        }
    }
}

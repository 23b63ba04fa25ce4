//! Pictures in a terminal.

use crate::domain::geometry::{Cell, Grid};

use super::axis::Axis;
use super::colors::{self, Rgb};
use super::picture::{Ink, Picture, Scale, ink_at};

/// Shades for values where there is no color, from low to high.
const SHADES: &[u8] = b".:-=+*%@";
/// Letters for changes from the largest decrease to the largest increase.
const CHANGES: &[u8] = b"=- +*";
/// Columns where the terminal does not tell.
const COLUMNS: usize = 80;

/// Returns the number of columns of the terminal on stdout; 80 if it is none.
#[must_use]
pub fn width() -> usize {
    console::Term::stdout().size_checked().map_or(COLUMNS, |(_, columns)| usize::from(columns).max(20))
}

/// Draws a picture at most `width` columns wide, with a line below that explains it.
///
/// In color each letter shows two cells, one above the other; without, each letter is a shade, `#` a wall.
#[must_use]
pub fn raster(picture: &Picture, scale: Scale, width: usize, color: bool) -> String {
    let columns = width.clamp(1, 400).min(picture.cols());
    // A letter is about twice as high as wide.
    let lines = (picture.rows() * columns).div_ceil(picture.cols().max(1) * 2).max(1);
    let mut text = if color { colored(picture, scale, columns, lines) } else { shaded(picture, scale, columns, lines) };
    text.push_str(&explained(picture, scale, color, columns));
    text
}

/// Returns the cells of a picture that fall into part `(row, col)` of one with `rows` × `cols` parts.
fn block<T: Copy>(grid: &Grid<T>, at: Cell, rows: usize, cols: usize) -> impl Iterator<Item = T> + '_ {
    let span = |part: usize, parts: usize, all: usize| {
        let first = part * all / parts;
        first..((part + 1) * all).div_ceil(parts).clamp(first + 1, all.max(first + 1)).min(all)
    };
    let (down, across) = (span(at.row, rows, grid.rows()), span(at.col, cols, grid.cols()));
    down.flat_map(move |row| across.clone().map(move |col| grid[Cell::new(row, col)]))
}

fn colored(picture: &Picture, scale: Scale, columns: usize, lines: usize) -> String {
    let painted = picture.paint(scale);
    let small = Grid::from_fn(lines * 2, columns, |at| mean(block(&painted, at, lines * 2, columns)));
    let mut text = String::new();
    for line in 0..lines {
        let (mut ink, mut ground) = (None, None);
        for column in 0..columns {
            let (above, below) = (small[Cell::new(2 * line, column)], small[Cell::new(2 * line + 1, column)]);
            if ink != Some(above) {
                text.push_str(&foreground(above));
                ink = Some(above);
            }
            if ground != Some(below) {
                text.push_str(&background(below));
                ground = Some(below);
            }
            text.push('▀');
        }
        text.push_str("\x1b[0m\n");
    }
    text
}

fn shaded(picture: &Picture, scale: Scale, columns: usize, lines: usize) -> String {
    let inks = picture.inks(scale);
    let mut text = String::new();
    for row in 0..lines {
        let letters = (0..columns).map(|col| shade(block(&inks, Cell::new(row, col), lines, columns)));
        text.push_str(letters.collect::<String>().trim_end());
        text.push('\n');
    }
    text
}

/// Chooses a letter: a wall if half of the cells are walls, else the highest value or class.
fn shade(inks: impl Iterator<Item = Ink>) -> char {
    let (mut walls, mut all, mut value, mut class, mut dark) = (0, 0, None::<f64>, None::<i8>, 0.0f64);
    let mut change = 0.0f64;
    for ink in inks {
        all += 1;
        match ink {
            Ink::Wall => walls += 1,
            Ink::Value(share) => value = Some(value.map_or(share, |before| before.max(share))),
            Ink::Change(share) if share.abs() > change.abs() => change = share,
            Ink::Class(number, _) => class = class.max(Some(number)),
            Ink::Color(color) => dark = dark.max(1.0 - colors::luminance(color)),
            Ink::Change(_) | Ink::Empty | Ink::Free => {}
        }
    }
    if change != 0.0 {
        // The smallest change is to be seen.
        let place = if change > 0.0 { 3 + usize::from(change >= 0.5) } else { 1 - usize::from(change <= -0.5) };
        return char::from(CHANGES[place]);
    }
    match (2 * walls >= all, class, value) {
        (true, ..) => '#',
        (_, Some(class), _) => char::from_digit(class.unsigned_abs().into(), 36).unwrap_or('?'),
        (_, _, Some(share)) => char::from(SHADES[((share * SHADES.len() as f64) as usize).min(SHADES.len() - 1)]),
        _ if dark > 0.9 => '#',
        _ if dark > 0.3 => '+',
        _ => ' ',
    }
}

/// Says what the colors or letters mean.
fn explained(picture: &Picture, scale: Scale, color: bool, columns: usize) -> String {
    let key = picture.key(scale);
    // Colors of their own have only their darkness to tell them apart.
    let painted = picture.is_painted();
    let mut text = String::new();
    if let Some((axis, unit)) = &key.bar {
        text.push_str(&bar(axis, unit, color, columns));
    }
    let parts = key.legend.iter().map(|(name, swatch)| {
        if color {
            format!("{}██\x1b[0m {name}", foreground(*swatch))
        } else {
            let letter = match (name.as_str(), name.strip_prefix("class ")) {
                _ if painted => match shade(std::iter::once(Ink::Color(*swatch))) {
                    ' ' => "blank".to_owned(),
                    letter => letter.to_string(),
                },
                (_, Some(class)) => class.to_owned(),
                ("blocked", _) => "#".to_owned(),
                _ => "blank".to_owned(),
            };
            format!("{letter} {name}")
        }
    });
    text.push_str(&parts.collect::<Vec<_>>().join("   "));
    text.trim_end().to_owned()
}

/// Draws a color bar with its marks below.
fn bar(axis: &Axis, unit: &str, color: bool, columns: usize) -> String {
    let length = columns.clamp(SHADES.len(), 64);
    let mut text = String::new();
    for i in 0..length {
        let share = i as f64 / (length - 1) as f64;
        if color {
            text.push_str(&format!("{} ", background(ink_at(axis, share).color())));
        } else if let ink @ Ink::Change(_) = ink_at(axis, share) {
            text.push(shade(std::iter::once(ink)));
        } else {
            text.push(char::from(SHADES[(i * SHADES.len() / length).min(SHADES.len() - 1)]));
        }
    }
    if color {
        text.push_str("\x1b[0m");
    }
    let log = if axis.scale == Scale::Log { " (log scale)" } else { "" };
    let mut marks = vec![' '; length + 8];
    let mut free = 0;
    for tick in axis.ticks(length / 10) {
        let at = (tick.at * (length - 1) as f64).round() as usize;
        if at >= free && at + tick.text.len() <= marks.len() {
            marks.splice(at..at + tick.text.len(), tick.text.chars());
            free = at + tick.text.len() + 1;
        }
    }
    format!("{text} {unit}{log}\n{}\n", marks.iter().collect::<String>().trim_end())
}

fn mean(colors: impl Iterator<Item = Rgb>) -> Rgb {
    let (mut sum, mut count) = ([0u32; 3], 0);
    for color in colors {
        (0..3).for_each(|i| sum[i] += u32::from(color[i]));
        count += 1;
    }
    sum.map(|channel| u8::try_from(channel / count.max(1)).expect("a mean of bytes is a byte"))
}

fn foreground([red, green, blue]: Rgb) -> String {
    format!("\x1b[38;2;{red};{green};{blue}m")
}

fn background([red, green, blue]: Rgb) -> String {
    format!("\x1b[48;2;{red};{green};{blue}m")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::geometry::Frame;

    fn picture() -> Picture {
        let values = Grid::from_fn(4, 8, |c| if c.col < 2 { 0.0 } else { c.col as f32 });
        let walls = Grid::from_fn(4, 8, |c| c.col == 7);
        Picture::values(Frame::at_zero(0.1, 4, 8), values, Some(walls), "visits", Some("not visited"))
    }

    #[test]
    fn without_color_values_are_shades() {
        let text = raster(&picture(), Scale::Linear, 80, false);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[..2], ["  -+*%@#", "  -+*%@#"]);
        assert_eq!(lines[2], ".:-=+*%@ visits");
        assert_eq!(lines[4], "# blocked   blank not visited");
    }

    #[test]
    fn in_color_each_letter_shows_two_cells() {
        let text = raster(&picture(), Scale::Log, 80, true);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0].matches('▀').count(), 8);
        let [r, g, b] = colors::WALL;
        assert!(lines[0].contains(&format!("48;2;{r};{g};{b}m▀\x1b[0m")), "{text:?}");
        assert!(lines[2].contains("visits (log scale)"));
    }

    #[test]
    fn wide_pictures_are_made_to_fit() {
        let classes = Grid::from_fn(60, 200, |c| if c.col < 100 { 2 } else { -1 });
        let picture = Picture::classes(Frame::at_zero(0.1, 60, 200), classes, 3, "not visited");
        let text = raster(&picture, Scale::Linear, 50, false);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!((lines.len(), lines[0]), (9, "2".repeat(25).as_str()));
        assert_eq!(lines[8], "1 class 1   2 class 2   3 class 3   blank not visited   # blocked");
    }
}

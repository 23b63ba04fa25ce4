//! Colors: what walls, empty space, values and classes look like.
//!
//! The scale for values is laid through OKLab (B. Ottosson, 2020), a color space in which distance is difference to the eye:
//! from indigo over magenta and orange to light yellow, lightness ever rising, in 256 steps of equal distance. So equal
//! steps of a value look equally large, and the order survives gray print and color blindness. Walls are near black and
//! empty space light gray; neither has a hue, so neither is mistaken for a value.

use std::sync::LazyLock;

/// Red, green and blue in sRGB.
pub type Rgb = [u8; 3];

/// Blocked cells.
pub const WALL: Rgb = [27, 29, 34];
/// Free cells without a value.
pub const EMPTY: Rgb = [217, 220, 226];
/// Free cells of a bare map.
pub const FREE: Rgb = [250, 250, 248];
/// Background of figures.
pub const PAPER: Rgb = [255, 255, 255];
/// Text and axes of figures.
pub const INK: Rgb = [38, 41, 48];
/// Paths of robots.
pub const ROBOT: Rgb = [222, 73, 24];
/// Paths of pedestrians.
pub const PEDESTRIAN: Rgb = [52, 101, 164];

/// Lightness, chroma and hue in degrees of the points that the scale passes.
const STATIONS: [[f64; 3]; 6] = [
    [0.33, 0.15, 278.0],
    [0.44, 0.18, 308.0],
    [0.56, 0.19, 352.0],
    [0.69, 0.18, 394.0],
    [0.82, 0.15, 432.0],
    [0.96, 0.11, 465.0],
];

static SCALE: LazyLock<Vec<Rgb>> = LazyLock::new(|| equal_steps(256));

/// Returns the color of a value between 0 and 1.
#[must_use]
pub fn value(share: f64) -> Rgb {
    SCALE[(share.clamp(0.0, 1.0) * (SCALE.len() - 1) as f64).round() as usize]
}

/// Nothing has changed.
const SAME: Rgb = [247, 247, 245];
/// What a change passes on its way to the largest one, down and up: blue and orange, which color blindness leaves apart.
const LESS: [Rgb; 2] = [[112, 168, 214], [18, 66, 140]];
const MORE: [Rgb; 2] = [[244, 156, 92], [158, 34, 24]];

/// Returns the color of a change, from −1 over 0, where all stays the same, to 1.
#[must_use]
pub fn change(share: f64) -> Rgb {
    let [middle, end] = if share < 0.0 { LESS } else { MORE };
    match 2.0 * share.abs().min(1.0) {
        near if near <= 1.0 => mix(SAME, middle, near),
        far => mix(middle, end, far - 1.0),
    }
}

/// Returns the color of a class from 1 to `count`.
#[must_use]
pub fn class(class: i8, count: u8) -> Rgb {
    let place = (f64::from(class) - 1.0) / (f64::from(count) - 1.0).max(1.0);
    value(0.08 + 0.88 * place)
}

/// Writes a color for SVG and HTML.
#[must_use]
pub fn hex([red, green, blue]: Rgb) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

/// Mixes two colors; 0 is all of the first one.
#[must_use]
pub fn mix(a: Rgb, b: Rgb, share: f64) -> Rgb {
    let channel = |i: usize| (f64::from(a[i]) * (1.0 - share) + f64::from(b[i]) * share).round() as u8;
    [channel(0), channel(1), channel(2)]
}

/// Returns the relative luminance of a color (WCAG 2), from 0 to 1.
#[must_use]
pub fn luminance(color: Rgb) -> f64 {
    let [r, g, b] = color.map(linear);
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

fn linear(channel: u8) -> f64 {
    let c = f64::from(channel) / 255.0;
    if c <= 0.04045 { c / 12.92 } else { libm::pow((c + 0.055) / 1.055, 2.4) }
}

/// Samples the way through the stations in steps of equal distance in OKLab.
fn equal_steps(count: usize) -> Vec<Rgb> {
    const FINE: usize = 4096;
    let points: Vec<[f64; 3]> = (0..=FINE).map(|i| into_gamut(station(i as f64 / FINE as f64))).collect();
    let mut lengths = vec![0.0];
    for pair in points.windows(2) {
        lengths.push(lengths[lengths.len() - 1] + distance(pair[0], pair[1]));
    }
    let whole = lengths[FINE];
    (0..count)
        .map(|i| {
            let at = whole * i as f64 / (count - 1) as f64;
            let after = lengths.partition_point(|length| *length < at).min(FINE);
            to_srgb(points[after]).map(|channel| (channel.clamp(0.0, 1.0) * 255.0).round() as u8)
        })
        .collect()
}

/// Returns lightness, a and b at a share of the way.
fn station(share: f64) -> [f64; 3] {
    let at = share * (STATIONS.len() - 1) as f64;
    let before = (at as usize).min(STATIONS.len() - 2);
    let part = at - before as f64;
    let between = |i: usize| STATIONS[before][i] * (1.0 - part) + STATIONS[before + 1][i] * part;
    let (lightness, chroma, hue) = (between(0), between(1), between(2).to_radians());
    [lightness, chroma * libm::cos(hue), chroma * libm::sin(hue)]
}

/// Takes chroma away until a color can be shown.
fn into_gamut([lightness, a, b]: [f64; 3]) -> [f64; 3] {
    let faded = |share: f64| [lightness, a * share, b * share];
    let shown = |color: [f64; 3]| to_srgb(color).iter().all(|channel| (-0.0005..=1.0005).contains(channel));
    (0..=100).map(|i| faded(1.0 - f64::from(i) / 100.0)).find(|color| shown(*color)).unwrap_or_else(|| faded(0.0))
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]) * (a[i] - b[i])).sum::<f64>().sqrt()
}

fn to_srgb([lightness, a, b]: [f64; 3]) -> [f64; 3] {
    let cube = |root: f64| root * root * root;
    let l = cube(lightness + 0.396_337_777_4 * a + 0.215_803_757_3 * b);
    let m = cube(lightness - 0.105_561_345_8 * a - 0.063_854_172_8 * b);
    let s = cube(lightness - 0.089_484_177_5 * a - 1.291_485_548_0 * b);
    let gamma = |c: f64| if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * libm::pow(c, 1.0 / 2.4) - 0.055 };
    [
        gamma(4.076_741_662_1 * l - 3.307_711_591_3 * m + 0.230_969_929_2 * s),
        gamma(-1.268_438_004_6 * l + 2.609_757_401_1 * m - 0.341_319_396_5 * s),
        gamma(-0.004_196_086_3 * l - 0.703_418_614_7 * m + 1.707_614_701_0 * s),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lab(color: Rgb) -> [f64; 3] {
        let [r, g, b] = color.map(linear);
        let l = libm::cbrt(0.412_221_470_8 * r + 0.536_332_536_3 * g + 0.051_445_992_9 * b);
        let m = libm::cbrt(0.211_903_498_2 * r + 0.680_699_545_1 * g + 0.107_396_956_6 * b);
        let s = libm::cbrt(0.088_302_461_9 * r + 0.281_718_837_6 * g + 0.629_978_700_5 * b);
        [
            0.210_454_255_3 * l + 0.793_617_785_0 * m - 0.004_072_046_8 * s,
            1.977_998_495_1 * l - 2.428_592_205_0 * m + 0.450_593_709_9 * s,
            0.025_904_037_1 * l + 0.782_771_766_2 * m - 0.808_675_766_0 * s,
        ]
    }

    #[test]
    fn lightness_rises_in_equal_steps() {
        let colors: Vec<[f64; 3]> = (0..=16).map(|i| lab(value(f64::from(i) / 16.0))).collect();
        let steps: Vec<f64> = colors.windows(2).map(|pair| distance(pair[0], pair[1])).collect();
        let mean = steps.iter().sum::<f64>() / steps.len() as f64;
        assert!(colors.windows(2).all(|pair| pair[1][0] > pair[0][0]), "{colors:?}");
        assert!(steps.iter().all(|step| (step / mean - 1.0).abs() < 0.12), "{steps:?}");
    }

    #[test]
    fn walls_empty_cells_and_values_are_told_apart() {
        for i in 0..=64 {
            let color = lab(value(f64::from(i) / 64.0));
            for other in [WALL, EMPTY, FREE] {
                assert!(distance(color, lab(other)) > 0.1, "{i} {other:?}");
            }
        }
        assert!(distance(lab(WALL), lab(EMPTY)) > 0.5);
    }

    #[test]
    fn colors_are_written_as_html_wants_them() {
        assert_eq!(hex([255, 0, 10]), "#ff000a");
        assert_eq!(mix([0, 0, 0], [255, 255, 255], 0.2), [51, 51, 51]);
        assert!((luminance([255, 255, 255]) - 1.0).abs() < 1e-9);
    }
}

//! What JPEG does to the gray of unknown space: ripples around edges move it by far more than rounding does.

/// Sets to `gray` what JPEG made of areas of that gray, in rows of `cols` pixels of `channels` bytes.
///
/// An area begins where a pixel and three of its eight neighbors lie within `rounding` of the gray. All that hangs together
/// with it and is nearer to the gray than to white belongs to it, as far down as up.
pub(super) fn settle(bytes: &mut [u8], cols: usize, channels: usize, gray: u8, rounding: u8) {
    let ripple = (u8::MAX - gray) / 2;
    let within = |pixel: &[u8], reach: u8| pixel.iter().all(|value| value.abs_diff(gray) <= reach);
    let rows = bytes.len() / channels / cols;
    let near: Vec<bool> = bytes.chunks_exact(channels).map(|pixel| within(pixel, rounding)).collect();
    let mut rest: Vec<bool> = bytes.chunks_exact(channels).map(|pixel| within(pixel, ripple)).collect();
    let mut area = Vec::new();
    for start in (0..near.len()).filter(|at| near[*at]) {
        if rest[start] && around(start, rows, cols).filter(|at| near[*at]).count() >= 3 {
            rest[start] = false;
            area.push(start);
        }
        while let Some(pixel) = area.pop() {
            bytes[pixel * channels..(pixel + 1) * channels].fill(gray);
            area.extend(around(pixel, rows, cols).filter(|at| std::mem::take(&mut rest[*at])));
        }
    }
}

/// Returns the up to eight neighbors of a pixel.
fn around(pixel: usize, rows: usize, cols: usize) -> impl Iterator<Item = usize> {
    let (row, col) = (pixel / cols, pixel % cols);
    let span = |at: usize, count: usize| at.saturating_sub(1)..(at + 2).min(count);
    span(row, rows).flat_map(move |row| span(col, cols).map(move |col| row * cols + col)).filter(move |at| *at != pixel)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(rows: &[&[u8]], expected: &[&[u8]]) {
        for channels in [1, 3] {
            let spread = |rows: &[&[u8]]| -> Vec<u8> {
                rows.concat().iter().flat_map(|value| std::iter::repeat_n(*value, channels)).collect()
            };
            let mut found = spread(rows);
            settle(&mut found, rows[0].len(), channels, 205, 2);
            assert_eq!(found, spread(expected));
        }
    }

    #[test]
    fn ripples_belong_to_the_area_that_they_hang_on() {
        check(
            &[&[204, 206, 228, 254], &[203, 205, 182, 231], &[212, 199, 254, 225]],
            &[&[205, 205, 205, 254], &[205, 205, 205, 231], &[205, 205, 254, 205]],
        );
    }

    #[test]
    fn edges_between_black_and_white_are_no_areas() {
        let edge: [&[u8]; 4] = [&[0, 205, 254], &[0, 205, 254], &[0, 206, 254], &[0, 190, 220]];
        check(&edge, &edge);
    }
}

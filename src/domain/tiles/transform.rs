//! The eight rotations and mirrorings of a square.

use crate::domain::raster::DIRECTIONS;

/// One of the eight ways to lay a square onto itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Transform {
    /// As it is.
    Identity,
    /// A quarter turn to the left.
    Left,
    /// A half turn.
    Half,
    /// A quarter turn to the right.
    Right,
    /// Left and right exchanged.
    Mirror,
    /// Top and bottom exchanged.
    Flip,
    /// Rows and columns exchanged.
    Transpose,
    /// Rows and columns exchanged, followed by a half turn.
    AntiTranspose,
}

impl Transform {
    /// All eight, the rotations first.
    pub const ALL: [Self; 8] = [
        Self::Identity,
        Self::Left,
        Self::Half,
        Self::Right,
        Self::Mirror,
        Self::Flip,
        Self::Transpose,
        Self::AntiTranspose,
    ];

    /// Writes the transformed square `src` to `dst`; both are `size` × `size` in row-major order.
    ///
    /// # Panics
    /// If a slice does not hold `size`² values.
    pub fn apply<T: Copy>(self, size: usize, src: &[T], dst: &mut [T]) {
        assert!(src.len() == size * size && dst.len() == size * size, "a square holds size · size values");
        // Walking along a row of `dst` is walking through `src` from `start` in steps of `by`.
        let end = size.wrapping_sub(1);
        for (row, out) in dst.chunks_exact_mut(size.max(1)).enumerate() {
            let (start, by) = match self {
                Self::Identity => (row * size, 1),
                Self::Left => (end - row, size as isize),
                Self::Half => ((end - row) * size + end, -1),
                Self::Right => (end * size + row, -(size as isize)),
                Self::Mirror => (row * size + end, -1),
                Self::Flip => ((end - row) * size, 1),
                Self::Transpose => (row, size as isize),
                Self::AntiTranspose => (end * size + end - row, -(size as isize)),
            };
            let mut from = start;
            for value in out {
                *value = src[from];
                from = from.wrapping_add_signed(by);
            }
        }
    }

    /// Returns where a direction of flow points afterwards; directions are counted counter-clockwise from that of x, which
    /// is to the right.
    #[must_use]
    pub const fn direction(self, direction: usize) -> usize {
        const ALL: usize = DIRECTIONS;
        let turned = match self {
            Self::Identity => direction,
            Self::Left => direction + ALL / 4,
            Self::Half => direction + ALL / 2,
            Self::Right => direction + 3 * ALL / 4,
            Self::Mirror => ALL + ALL / 2 - direction,
            Self::Flip => ALL - direction,
            Self::Transpose => ALL + 3 * ALL / 4 - direction,
            Self::AntiTranspose => ALL + ALL / 4 - direction,
        };
        turned % ALL
    }

    /// Returns the transform that undoes this one.
    #[must_use]
    pub const fn inverse(self) -> Self {
        match self {
            Self::Left => Self::Right,
            Self::Right => Self::Left,
            other => other,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transforms_do_what_their_names_say() {
        let check = |transform: Transform, expected: &str| {
            let mut out = [b' '; 9];
            transform.apply(3, b"abcdefghi", &mut out);
            assert_eq!(std::str::from_utf8(&out), Ok(expected), "{transform:?}");
        };
        check(Transform::Identity, "abcdefghi");
        check(Transform::Left, "cfibehadg");
        check(Transform::Half, "ihgfedcba");
        check(Transform::Right, "gdahebifc");
        check(Transform::Mirror, "cbafedihg");
        check(Transform::Flip, "ghidefabc");
        check(Transform::Transpose, "adgbehcfi");
        check(Transform::AntiTranspose, "ifchebgda");
    }

    /// A step from the middle of a square of five cells a side to one of the eight neighbors at its rim, followed through
    /// the transform.
    #[test]
    fn directions_turn_with_the_square() {
        // Column and row of the rim's cell in each direction: up is towards row 0.
        let ends = [(4, 2), (4, 0), (2, 0), (0, 0), (0, 2), (0, 4), (2, 4), (4, 4)];
        for transform in Transform::ALL {
            for (direction, (col, row)) in ends.into_iter().enumerate() {
                let (mut square, mut turned) = ([0; 25], [0; 25]);
                square[row * 5 + col] = 1;
                transform.apply(5, &square, &mut turned);
                let found = turned.iter().position(|cell| *cell == 1).expect("it is somewhere");
                let (col, row) = ends[transform.direction(direction)];
                assert_eq!(found, row * 5 + col, "{transform:?} {direction}");
                assert_eq!(transform.inverse().direction(transform.direction(direction)), direction);
            }
        }
    }

    #[test]
    fn transforms_are_the_group_of_the_square() {
        let square: Vec<u8> = (0..25).collect();
        let apply = |transform: Transform, square: &[u8]| {
            let mut out = vec![0; 25];
            transform.apply(5, square, &mut out);
            out
        };
        let images: Vec<Vec<u8>> = Transform::ALL.iter().map(|t| apply(*t, &square)).collect();
        for (i, (transform, image)) in Transform::ALL.iter().zip(&images).enumerate() {
            assert!(images[i + 1..].iter().all(|other| other != image), "{transform:?} occurs twice");
            assert_eq!(apply(transform.inverse(), image), square, "{transform:?}");
            assert!(Transform::ALL.iter().all(|next| images.contains(&apply(*next, image))), "{transform:?}");
        }
    }
}

//! The boundaries of hatches: what they fill.

use super::super::error::PlanError;
use super::curves::{Ellipse, Spline, bulge_center, turn, turned};
use super::groups::{Group, Record};
use crate::domain::geometry::Point;

/// Reads the boundaries of a `HATCH`, ring by ring; what an odd number of them surrounds is filled.
///
/// # Errors
/// [`PlanError`] if a number is missing or none.
pub(super) fn rings(entity: &Record<'_>) -> Result<Vec<Vec<Point>>, PlanError> {
    let start = entity.groups.iter().position(|group| group.code == 91);
    let groups = start.map_or(&[][..], |start| &entity.groups[start + 1..]);
    let mut reader = Reader { entity, groups };
    let mut rings = Vec::new();
    while let Some(kind) = reader.next(92)? {
        let ring = if kind as i64 & 2 != 0 { reader.polyline()? } else { reader.edges()? };
        if ring.len() > 2 {
            rings.push(ring);
        }
    }
    Ok(rings)
}

/// The groups that are left.
struct Reader<'a, 'b> {
    entity: &'b Record<'a>,
    groups: &'b [Group<'a>],
}

impl Reader<'_, '_> {
    /// Returns the next number of a code, skipping others.
    fn next(&mut self, code: i32) -> Result<Option<f64>, PlanError> {
        let Some(at) = self.groups.iter().position(|group| group.code == code) else { return Ok(None) };
        let number = self.groups[at].number()?;
        self.groups = &self.groups[at + 1..];
        Ok(Some(number))
    }

    fn number(&mut self, code: i32) -> Result<f64, PlanError> {
        let missing = PlanError::DxfGroup { entity: self.entity.name.to_owned(), code, at: self.entity.position() };
        self.next(code)?.ok_or(missing)
    }

    fn point(&mut self, codes: [i32; 2]) -> Result<Point, PlanError> {
        Ok(Point::new(self.number(codes[0])?, self.number(codes[1])?))
    }

    /// Returns the next number if it has this code.
    fn if_next(&mut self, code: i32) -> Result<Option<f64>, PlanError> {
        if self.groups.first().is_some_and(|group| group.code == code) { self.next(code) } else { Ok(None) }
    }

    /// Reads how many of something follow; there cannot be more of them than groups.
    fn count(&mut self, code: i32) -> Result<usize, PlanError> {
        Ok((self.number(code)?.max(0.0) as usize).min(self.groups.len()))
    }

    /// Reads corners, each with the bulge of the piece behind it.
    fn polyline(&mut self) -> Result<Vec<Point>, PlanError> {
        let mut corners = Vec::new();
        for _ in 0..self.count(93)? {
            let corner = self.point([10, 20])?;
            corners.push((corner, self.if_next(42)?.unwrap_or(0.0)));
        }
        let mut ring = Vec::new();
        for (at, (from, bulge)) in corners.iter().enumerate() {
            let (to, _) = corners[(at + 1) % corners.len()];
            ring.push(*from);
            if *bulge != 0.0 {
                ring.extend(turned(*from, bulge_center(*from, to, *bulge), 4.0 * libm::atan(*bulge)));
            }
        }
        Ok(ring)
    }

    /// Reads edges, each of which begins where another one ends.
    fn edges(&mut self) -> Result<Vec<Point>, PlanError> {
        let mut ring: Vec<Point> = Vec::new();
        for _ in 0..self.count(93)? {
            let mut edge = match self.number(72)? as i64 {
                1 => vec![self.point([10, 20])?, self.point([11, 21])?],
                2 => self.arc()?,
                3 => self.ellipse()?,
                4 => self.spline()?,
                _ => Vec::new(),
            };
            if let (Some(last), [first, .., end]) = (ring.last(), &edge[..])
                && last.distance(*end) < last.distance(*first)
            {
                edge.reverse();
            }
            ring.extend(edge);
        }
        Ok(ring)
    }

    fn arc(&mut self) -> Result<Vec<Point>, PlanError> {
        let (center, radius) = (self.point([10, 20])?, self.number(40)?);
        let (from, turn) = self.angles()?;
        let start = center + Point::new(libm::cos(from), libm::sin(from)) * radius;
        Ok(std::iter::once(start).chain(turned(start, center, turn)).collect())
    }

    fn ellipse(&mut self) -> Result<Vec<Point>, PlanError> {
        let (center, axis, ratio) = (self.point([10, 20])?, self.point([11, 21])?, self.number(40)?);
        let (from, turn) = self.angles()?;
        Ok(Ellipse { center, axis, ratio }.points(from, turn).collect())
    }

    /// Reads where an arc begins, in radians, and how far it turns. Angles of clockwise ones count clockwise.
    fn angles(&mut self) -> Result<(f64, f64), PlanError> {
        let [from, to] = [self.number(50)?, self.number(51)?].map(f64::to_radians);
        let sign = if self.number(73)? == 0.0 { -1.0 } else { 1.0 };
        Ok((sign * from, sign * turn(from, to)))
    }

    fn spline(&mut self) -> Result<Vec<Point>, PlanError> {
        let degree = self.number(94)?.max(0.0) as usize;
        let (knots, controls) = (self.count(95)?, self.count(96)?);
        let knots = (0..knots).map(|_| self.number(40)).collect::<Result<_, _>>()?;
        let mut points = Vec::new();
        for _ in 0..controls {
            let control = self.point([10, 20])?;
            points.push((control, self.if_next(42)?.unwrap_or(1.0)));
        }
        let straight = points.iter().map(|(point, _)| *point).collect();
        Ok(Spline { degree, knots, controls: points }.points().unwrap_or(straight))
    }
}

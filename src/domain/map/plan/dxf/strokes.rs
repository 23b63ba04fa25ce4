//! The entities of a DXF file as strokes on layers: blocks are put where they are inserted, curves are made of chords.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use super::super::error::PlanError;
use super::super::shapes::MOST_POINTS;
use super::curves::{Ellipse, Spline, bulge_center, turn, turned};
use super::groups::{Group, Record};
use super::hatch;
use crate::domain::geometry::Point;

/// How deep blocks may lie in blocks.
const DEEPEST: usize = 16;

/// A straight piece.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stroke {
    pub from: Point,
    pub to: Point,
    /// Whether it is a chord of a curve.
    pub curved: bool,
}

/// What is drawn on a layer.
#[derive(Debug, Default)]
pub(super) struct Layer {
    pub strokes: Vec<Stroke>,
    /// What is filled: what an odd number of the rings of each surrounds.
    pub fills: Vec<Vec<Vec<Point>>>,
}

/// A block: what it is drawn of, and the point of it that is put where it is inserted.
struct Block<'a> {
    base: Point,
    entities: &'a [Record<'a>],
}

/// What is drawn in a file.
#[derive(Debug, Default)]
pub(super) struct Strokes {
    pub layers: BTreeMap<String, Layer>,
    /// How many entities there are of those that are no strokes, by name.
    pub others: BTreeMap<String, usize>,
    work: u64,
}

/// Where a block lies: x and y of a drawing's point are sums of products.
#[derive(Clone, Copy)]
struct Placement {
    right: Point,
    up: Point,
    origin: Point,
}

impl Placement {
    const HERE: Self = Self { right: Point::new(1.0, 0.0), up: Point::new(0.0, 1.0), origin: Point::new(0.0, 0.0) };

    fn of(&self, point: Point) -> Point {
        self.vector(point) + self.origin
    }

    fn vector(&self, point: Point) -> Point {
        self.right * point.x + self.up * point.y
    }
}

/// Where entities come from, while blocks are put into each other.
#[derive(Clone, Copy)]
struct Site<'a> {
    placement: Placement,
    /// The layer of what lies on layer `0` of a block.
    layer: &'a str,
    depth: usize,
}

impl Strokes {
    /// Draws all entities of a file in model space.
    ///
    /// # Errors
    /// [`PlanError`] if a number is missing or none, or if there is too much.
    pub fn of(records: &[Record<'_>]) -> Result<Self, PlanError> {
        let mut strokes = Self::default();
        let (entities, blocks) = (section(records, "ENTITIES"), blocks(section(records, "BLOCKS"))?);
        strokes.draw(entities, &blocks, Site { placement: Placement::HERE, layer: "0", depth: 0 })?;
        Ok(strokes)
    }

    /// Counts what is done, which a few bytes of blocks in blocks could make endless.
    fn count(&mut self) -> Result<(), PlanError> {
        self.work += 1;
        if self.work > MOST_POINTS {
            return Err(PlanError::TooManyPoints { points: self.work, most: MOST_POINTS });
        }
        Ok(())
    }

    fn draw(&mut self, entities: &[Record<'_>], blocks: &Blocks<'_>, site: Site<'_>) -> Result<(), PlanError> {
        let mut at = 0;
        while let Some(entity) = entities.get(at) {
            at += 1;
            self.count()?;
            if entity.whole(67)? != 0 {
                continue;
            }
            let layer = entity.text(8).filter(|layer| *layer != "0" || site.depth == 0).unwrap_or(site.layer);
            match entity.name {
                "LINE" => {
                    let from = Point::new(entity.required(10)?, entity.required(20)?);
                    let to = Point::new(entity.required(11)?, entity.required(21)?);
                    self.stroke(layer, site.placement, (from, to), false)?;
                }
                "LWPOLYLINE" => {
                    let corners = corners(&entity.groups)?;
                    self.path(layer, site.placement, entity, corners, entity.whole(70)? & 1 != 0)?;
                }
                "POLYLINE" => {
                    let vertices = entities[at..].iter().take_while(|vertex| vertex.name == "VERTEX");
                    let found = vertices.map(|vertex| corners(&vertex.groups)).collect::<Result<Vec<_>, _>>()?;
                    at += found.len();
                    let flags = entity.whole(70)?;
                    // Meshes are no lines.
                    if flags & (16 | 64) == 0 {
                        self.path(layer, site.placement, entity, found.concat(), flags & 1 != 0)?;
                    }
                }
                "ARC" => {
                    let [from, to] = [entity.required(50)?, entity.required(51)?].map(f64::to_radians);
                    self.arc(layer, site.placement, entity, from, turn(from, to))?;
                }
                "CIRCLE" => self.arc(layer, site.placement, entity, 0.0, TAU)?,
                "ELLIPSE" => self.chain(layer, site.placement, &ellipse(entity)?)?,
                "SPLINE" => self.chain(layer, site.placement, &spline(entity)?)?,
                "HATCH" => self.fill(layer, turned_over(site.placement, entity)?, &hatch::rings(entity)?)?,
                "SOLID" => self.fill(layer, turned_over(site.placement, entity)?, &[solid(entity)?])?,
                "INSERT" => self.insert(entity, blocks, Site { layer, ..site })?,
                "VERTEX" | "SEQEND" | "ATTRIB" | "ATTDEF" | "VIEWPORT" => {}
                other => *self.others.entry(other.to_owned()).or_default() += 1,
            }
        }
        Ok(())
    }

    fn stroke(&mut self, layer: &str, by: Placement, ends: (Point, Point), curved: bool) -> Result<(), PlanError> {
        self.count()?;
        self.layer(layer).strokes.push(Stroke { from: by.of(ends.0), to: by.of(ends.1), curved });
        Ok(())
    }

    fn layer(&mut self, name: &str) -> &mut Layer {
        if !self.layers.contains_key(name) {
            self.layers.insert(name.to_owned(), Layer::default());
        }
        self.layers.get_mut(name).expect("it is there by now")
    }

    /// Draws a curve through points.
    fn chain(&mut self, layer: &str, by: Placement, points: &[Point]) -> Result<(), PlanError> {
        points.windows(2).try_for_each(|pair| self.stroke(layer, by, (pair[0], pair[1]), true))
    }

    fn fill(&mut self, layer: &str, by: Placement, rings: &[Vec<Point>]) -> Result<(), PlanError> {
        rings.iter().flatten().try_for_each(|_| self.count())?;
        let placed = |ring: &Vec<Point>| ring.iter().map(|point| by.of(*point)).collect();
        self.layer(layer).fills.push(rings.iter().map(placed).collect());
        Ok(())
    }

    /// Draws corners in order, each with the bulge of the piece behind it: a quarter of its turn, as a tangent.
    fn path(
        &mut self,
        layer: &str,
        by: Placement,
        entity: &Record<'_>,
        corners: Vec<(Point, f64)>,
        closed: bool,
    ) -> Result<(), PlanError> {
        let by = turned_over(by, entity)?;
        let ends = corners.len().saturating_sub(usize::from(!closed));
        for at in 0..ends {
            let ((from, bulge), (to, _)) = (corners[at], corners[(at + 1) % corners.len()]);
            if bulge == 0.0 {
                self.stroke(layer, by, (from, to), false)?;
                continue;
            }
            self.chords(layer, by, (from, bulge_center(from, to, bulge)), 4.0 * libm::atan(bulge))?;
        }
        Ok(())
    }

    fn arc(&mut self, layer: &str, by: Placement, entity: &Record<'_>, from: f64, turn: f64) -> Result<(), PlanError> {
        let by = turned_over(by, entity)?;
        let (center, radius) = (Point::new(entity.required(10)?, entity.required(20)?), entity.required(40)?);
        let start = center + Point::new(libm::cos(from), libm::sin(from)) * radius;
        self.chords(layer, by, (start, center), turn)
    }

    /// Draws chords around a center, counter-clockwise if the turn is positive.
    fn chords(&mut self, layer: &str, by: Placement, of: (Point, Point), turn: f64) -> Result<(), PlanError> {
        let (start, center) = of;
        let points: Vec<Point> = std::iter::once(start).chain(turned(start, center, turn)).collect();
        self.chain(layer, by, &points)
    }

    /// Puts a block somewhere, once or in rows and columns.
    fn insert(&mut self, entity: &Record<'_>, blocks: &Blocks<'_>, site: Site<'_>) -> Result<(), PlanError> {
        let Some(block) = entity.text(2).and_then(|name| blocks.get(name)).filter(|_| site.depth < DEEPEST) else {
            *self.others.entry("INSERT".to_owned()).or_default() += 1;
            return Ok(());
        };
        let by = turned_over(site.placement, entity)?;
        let angle = entity.number(50)?.unwrap_or(0.0).to_radians();
        let right = Point::new(libm::cos(angle), libm::sin(angle));
        let (wide, high) = (entity.number(41)?.unwrap_or(1.0), entity.number(42)?.unwrap_or(1.0));
        let place = Point::new(entity.required(10)?, entity.required(20)?);
        let (beside, below) = (entity.number(44)?.unwrap_or(0.0), entity.number(45)?.unwrap_or(0.0));
        for row in 0..entity.whole(71)?.max(1) {
            for col in 0..entity.whole(70)?.max(1) {
                self.count()?;
                let corner = place + right * (col as f64 * beside) + right.perpendicular() * (row as f64 * below);
                let (along, up) = (right * wide, right.perpendicular() * high);
                let origin = by.of(corner - along * block.base.x - up * block.base.y);
                let placement = Placement { right: by.vector(along), up: by.vector(up), origin };
                self.draw(block.entities, blocks, Site { placement, depth: site.depth + 1, ..site })?;
            }
        }
        Ok(())
    }
}

/// Reads an ellipse; its coordinates are the drawing's, also on the back of the sheet, where it runs the other way round.
fn ellipse(entity: &Record<'_>) -> Result<Vec<Point>, PlanError> {
    let center = Point::new(entity.required(10)?, entity.required(20)?);
    let axis = Point::new(entity.required(11)?, entity.required(21)?);
    let back = entity.number(230)?.is_some_and(|up| up < 0.0);
    let ratio = entity.required(40)? * if back { -1.0 } else { 1.0 };
    let (from, to) = (entity.number(41)?.unwrap_or(0.0), entity.number(42)?.unwrap_or(TAU));
    Ok(Ellipse { center, axis, ratio }.points(from, turn(from, to)).collect())
}

/// Reads a spline by its control points, or else straight from one point that it runs through to the next.
fn spline(entity: &Record<'_>) -> Result<Vec<Point>, PlanError> {
    let points = |codes: [i32; 2]| {
        let [x, y] = codes.map(|code| entity.numbers(code));
        Ok::<_, PlanError>(x?.into_iter().zip(y?).map(|(x, y)| Point::new(x, y)).collect::<Vec<_>>())
    };
    let (knots, weights) = (entity.numbers(40)?, entity.numbers(41)?);
    let controls = points([10, 20])?;
    let weight = |at: usize| weights.get(at).copied().unwrap_or(1.0);
    let weighted = controls.iter().enumerate().map(|(at, point)| (*point, weight(at))).collect();
    let spline = Spline { degree: entity.whole(71)?.max(0) as usize, knots, controls: weighted };
    match spline.points() {
        Some(found) => Ok(found),
        None => {
            let passed = points([11, 21])?;
            Ok(if passed.is_empty() { controls } else { passed })
        }
    }
}

/// Reads a filled triangle or quadrangle, whose last two corners stand in the wrong order.
fn solid(entity: &Record<'_>) -> Result<Vec<Point>, PlanError> {
    let corner = |at: i32| Ok::<_, PlanError>(Point::new(entity.required(10 + at)?, entity.required(20 + at)?));
    let mut ring = vec![corner(0)?, corner(1)?];
    if entity.number(13)?.is_some() {
        ring.push(corner(3)?);
    }
    ring.push(corner(2)?);
    Ok(ring)
}

type Blocks<'a> = BTreeMap<&'a str, Block<'a>>;

/// Returns the records of a section.
fn section<'a, 'b>(records: &'b [Record<'a>], name: &str) -> &'b [Record<'a>] {
    let start = records.iter().position(|record| record.name == "SECTION" && record.text(2) == Some(name));
    let rest = start.map_or(&[][..], |start| &records[start + 1..]);
    let end = rest.iter().position(|record| record.name == "ENDSEC").unwrap_or(rest.len());
    &rest[..end]
}

fn blocks<'a>(records: &'a [Record<'a>]) -> Result<Blocks<'a>, PlanError> {
    let mut blocks = BTreeMap::new();
    for (at, block) in records.iter().enumerate().filter(|(_, record)| record.name == "BLOCK") {
        let rest = &records[at + 1..];
        let end = rest.iter().position(|record| matches!(record.name, "ENDBLK" | "BLOCK")).unwrap_or(rest.len());
        let base = Point::new(block.number(10)?.unwrap_or(0.0), block.number(20)?.unwrap_or(0.0));
        if let Some(name) = block.text(2) {
            blocks.insert(name, Block { base, entities: &rest[..end] });
        }
    }
    Ok(blocks)
}

/// Reads corners: each begins with a group 10; 20 is y, 42 the bulge.
fn corners(groups: &[Group<'_>]) -> Result<Vec<(Point, f64)>, PlanError> {
    let mut corners: Vec<(Point, f64)> = Vec::new();
    for group in groups {
        match (group.code, corners.last_mut()) {
            (10, _) => corners.push((Point::new(group.number()?, 0.0), 0.0)),
            (20, Some(corner)) => corner.0.y = group.number()?,
            (42, Some(corner)) => corner.1 = group.number()?,
            _ => {}
        }
    }
    Ok(corners)
}

/// Returns the placement of what is drawn on the back of the sheet: mirrored.
fn turned_over(by: Placement, entity: &Record<'_>) -> Result<Placement, PlanError> {
    let back = entity.number(230)?.is_some_and(|up| up < 0.0);
    Ok(if back { Placement { right: -by.right, ..by } } else { by })
}

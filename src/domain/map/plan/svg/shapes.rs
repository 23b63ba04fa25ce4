//! The shapes of an SVG document, in its user units.

use std::collections::BTreeMap;
use std::iter::successors;
use std::rc::Rc;
use std::str::FromStr;

use roxmltree::{Document, Node};
use simplecss::StyleSheet;
use svgtypes::{PointsParser, Transform, ViewBox};

use super::super::error::PlanError;
use super::super::shapes::MOST_POINTS;
use super::length::length;
use super::outline::Outline;
use super::style::Style;
use crate::domain::geometry::Point;
use crate::domain::map::position::Position;

/// How deep elements may lie in each other, `use` included.
const DEEPEST: usize = 256;
/// So many names and rules of style sheets are as much work as a point.
const NAMES: u64 = 16;

/// What an element can be named by: its label, its id and its classes, and those of the elements around it.
#[derive(Debug, Default)]
pub(super) struct Labels<'a> {
    own: Vec<&'a str>,
    outer: Option<Rc<Self>>,
}

impl<'a> Labels<'a> {
    /// Returns all of them, its own first.
    pub fn all(&self) -> impl Iterator<Item = &'a str> {
        successors(Some(self), |labels| labels.outer.as_deref()).flat_map(|labels| labels.own.iter().copied())
    }
}

/// Something that is drawn.
#[derive(Debug)]
pub(super) struct Shape<'a> {
    /// Names of its layers and groups and its own, and its classes.
    pub labels: Rc<Labels<'a>>,
    pub fill: Option<String>,
    pub stroke: Option<String>,
    /// Width of its line.
    pub width: f64,
    /// Whether the odd rule says what is surrounded.
    pub odd: bool,
    pub outlines: Vec<Outline>,
}

impl Shape<'_> {
    /// Returns what it can be named by: labels and colors.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.labels.all().chain(self.fill.iter().chain(&self.stroke).map(String::as_str))
    }
}

/// The part of the plane that is shown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct View {
    pub left: f64,
    pub bottom: f64,
}

impl View {
    /// Returns what a document shows: its `viewBox`, or else its size.
    pub fn of(document: &Document<'_>) -> Result<Self, PlanError> {
        let root = document.root_element();
        if root.tag_name().name() != "svg" {
            let found = format!("`{}`", root.tag_name().name());
            return Err(PlanError::Svg { what: "the outermost element".to_owned(), found, at: place(root) });
        }
        if let Some(text) = root.attribute("viewBox") {
            let ViewBox { x, y, h, .. } = ViewBox::from_str(text).map_err(|_| refused(root, "viewBox", text))?;
            return Ok(Self { left: x, bottom: y + h });
        }
        let bottom = root.attribute("height").and_then(length).unwrap_or(0.0);
        Ok(Self { left: 0.0, bottom })
    }
}

/// Where elements lie and how they look, as they inherit it.
#[derive(Clone)]
struct Site<'a> {
    transform: Affine,
    style: Style,
    labels: Rc<Labels<'a>>,
    depth: usize,
}

/// A change of coordinates: x and y of a point are sums of products.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Affine {
    right: Point,
    down: Point,
    origin: Point,
}

impl Affine {
    const HERE: Self = Self { right: Point::new(1.0, 0.0), down: Point::new(0.0, 1.0), origin: Point::new(0.0, 0.0) };

    const fn moved(x: f64, y: f64) -> Self {
        Self { origin: Point::new(x, y), ..Self::HERE }
    }

    fn vector(&self, point: Point) -> Point {
        self.right * point.x + self.down * point.y
    }

    fn of(&self, point: Point) -> Point {
        self.vector(point) + self.origin
    }

    /// Returns the change that makes another one first.
    fn after(&self, first: &Self) -> Self {
        Self { right: self.vector(first.right), down: self.vector(first.down), origin: self.of(first.origin) }
    }

    /// Returns by how much lengths grow, on the mean over directions.
    fn growth(&self) -> f64 {
        self.right.det(self.down).abs().sqrt()
    }
}

/// Returns all shapes that a document draws.
///
/// # Errors
/// [`PlanError`] with the place of what is not understood, or if there is too much.
pub(super) fn shapes<'a>(document: &'a Document<'_>) -> Result<Vec<Shape<'a>>, PlanError> {
    let mut sheet = StyleSheet::new();
    for style in document.descendants().filter(|node| node.has_tag_name(("http://www.w3.org/2000/svg", "style"))) {
        sheet.parse_more(style.text().unwrap_or_default());
    }
    let mut ids = BTreeMap::new();
    for node in document.descendants() {
        if let Some(id) = node.attribute("id") {
            ids.entry(id).or_insert(node);
        }
    }
    let mut artist = Artist { ids, sheet, shapes: Vec::new(), work: 0 };
    let labels = Rc::new(Labels::default());
    let site = Site { transform: Affine::HERE, style: Style::default(), labels, depth: 0 };
    artist.children(document.root_element(), &site)?;
    Ok(artist.shapes)
}

struct Artist<'a, 'i> {
    ids: BTreeMap<&'a str, Node<'a, 'i>>,
    sheet: StyleSheet<'a>,
    shapes: Vec<Shape<'a>>,
    /// Points and elements so far, and what it takes to name and style these: a few bytes of `use` within `use` could make them
    /// endless.
    work: u64,
}

impl<'a, 'i> Artist<'a, 'i> {
    fn children(&mut self, parent: Node<'a, 'i>, site: &Site<'a>) -> Result<(), PlanError> {
        parent.children().filter(Node::is_element).try_for_each(|node| self.draw(node, site))
    }

    fn draw(&mut self, node: Node<'a, 'i>, around: &Site<'a>) -> Result<(), PlanError> {
        let site = self.enter(node, around)?;
        self.count(1 + (self.sheet.rules.len() + site.labels.all().count()) as u64 / NAMES)?;
        if !site.style.displayed {
            return Ok(());
        }
        match node.tag_name().name() {
            "g" | "a" | "switch" => self.children(node, &site),
            "svg" => self.children(node, &site.moved(node)?),
            "use" => self.reuse(node, &site),
            _ => {
                let outlines = outlines(node)?;
                if !outlines.is_empty() && site.style.visible {
                    self.add(outlines, site)?;
                }
                Ok(())
            }
        }
    }

    /// Returns where an element lies within another one, and how it looks.
    fn enter(&self, node: Node<'a, 'i>, around: &Site<'a>) -> Result<Site<'a>, PlanError> {
        if around.depth == DEEPEST {
            let found = format!("more than {DEEPEST}");
            return Err(PlanError::Svg {
                what: "the number of elements within each other".to_owned(),
                found,
                at: place(node),
            });
        }
        let mut transform = around.transform;
        if let Some(text) = node.attribute("transform") {
            let own = Transform::from_str(text).map_err(|_| refused(node, "transform", text))?;
            let (right, down) = (Point::new(own.a, own.b), Point::new(own.c, own.d));
            transform = transform.after(&Affine { right, down, origin: Point::new(own.e, own.f) });
        }
        let label = node.attributes().find(|attribute| attribute.name() == "label").map(|attribute| attribute.value());
        let classes = node.attribute("class").unwrap_or_default().split_whitespace();
        let own = label.into_iter().chain(node.attribute("id")).chain(classes).collect();
        let labels = Rc::new(Labels { own, outer: Some(Rc::clone(&around.labels)) });
        Ok(Site { transform, style: around.style.of(node, &self.sheet), labels, depth: around.depth + 1 })
    }

    fn reuse(&mut self, node: Node<'a, 'i>, site: &Site<'a>) -> Result<(), PlanError> {
        let link = node.attributes().find(|attribute| attribute.name() == "href").map(|attribute| attribute.value());
        let id = link.and_then(|link| link.strip_prefix('#'));
        let Some(used) = id.and_then(|id| self.ids.get(id)).copied() else { return Ok(()) };
        let site = site.moved(node)?;
        if used.tag_name().name() == "symbol" {
            let site = self.enter(used, &site)?;
            return self.children(used, &site);
        }
        self.draw(used, &site)
    }

    fn add(&mut self, mut outlines: Vec<Outline>, site: Site<'a>) -> Result<(), PlanError> {
        let Site { transform, style, labels, .. } = site;
        for (point, _) in outlines.iter_mut().flat_map(|outline| &mut outline.points) {
            *point = transform.of(*point);
        }
        self.count(outlines.iter().map(|outline| outline.points.len() as u64).sum())?;
        let width = style.width * transform.growth();
        self.shapes.push(Shape { labels, fill: style.fill, stroke: style.stroke, width, odd: style.odd, outlines });
        Ok(())
    }

    fn count(&mut self, more: u64) -> Result<(), PlanError> {
        self.work += more;
        if self.work > MOST_POINTS {
            return Err(PlanError::TooManyPoints { points: self.work, most: MOST_POINTS });
        }
        Ok(())
    }
}

impl Site<'_> {
    /// Returns the site at the `x` and `y` of an element.
    fn moved(&self, node: Node<'_, '_>) -> Result<Self, PlanError> {
        let transform = self.transform.after(&Affine::moved(number(node, "x")?, number(node, "y")?));
        Ok(Self { transform, ..self.clone() })
    }
}

/// Returns the lines of a shape; none if an element is no shape.
fn outlines(node: Node<'_, '_>) -> Result<Vec<Outline>, PlanError> {
    let at = |x: &str, y: &str| Ok::<_, PlanError>(Point::new(number(node, x)?, number(node, y)?));
    Ok(match node.tag_name().name() {
        "path" => {
            let data = node.attribute("d").unwrap_or_default();
            Outline::of_path(data).map_err(|_| refused(node, "d", data))?
        }
        "line" => vec![Outline::straight([at("x1", "y1")?, at("x2", "y2")?], false)],
        name @ ("polyline" | "polygon") => {
            let points = PointsParser::from(node.attribute("points").unwrap_or_default());
            vec![Outline::straight(points.map(|(x, y)| Point::new(x, y)), name == "polygon")]
        }
        "rect" => {
            let (corner, size) = (at("x", "y")?, at("width", "height")?);
            let corners = [(0.0, 0.0), (size.x, 0.0), (size.x, size.y), (0.0, size.y)];
            vec![Outline::straight(corners.map(|(x, y)| corner + Point::new(x, y)), true)]
        }
        "circle" => vec![Outline::ellipse(at("cx", "cy")?, [number(node, "r")?; 2])],
        "ellipse" => vec![Outline::ellipse(at("cx", "cy")?, [number(node, "rx")?, number(node, "ry")?])],
        _ => Vec::new(),
    })
}

/// Returns a length of an element in user units; 0 if it is left out.
fn number(node: Node<'_, '_>, name: &str) -> Result<f64, PlanError> {
    let Some(text) = node.attribute(name) else { return Ok(0.0) };
    length(text).filter(|length| length.is_finite()).ok_or_else(|| refused(node, name, text))
}

fn place(node: Node<'_, '_>) -> Position {
    let at = node.document().text_pos_at(node.range().start);
    Position { line: at.row.into(), column: at.col.into() }
}

fn refused(node: Node<'_, '_>, attribute: &str, text: &str) -> PlanError {
    let shown: String = text.chars().take(20).collect();
    let what = format!("`{attribute}` of a `{}`", node.tag_name().name());
    PlanError::Svg { what, found: format!("`{shown}`"), at: place(node) }
}

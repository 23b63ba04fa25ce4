//! Well-known text: the polygons of JuPedSim's geometries.
//!
//! `POLYGON`, `MULTIPOLYGON` and `GEOMETRYCOLLECTION`, one or several in a file, with or without `SRID=…;`, `Z` and `M`; what
//! is no polygon is left out. Coordinates are meters unless `unit` says otherwise.

use super::error::PlanError;
use super::polygons::{Polygons, opened};
use super::shapes::Plan;
use crate::domain::geometry::Point;
use crate::domain::map::config::ImportConfig;
use crate::domain::map::position::Position;
use crate::domain::map::reading::Reading;
use crate::domain::map::unit::Unit;

/// How deep collections may lie in collections.
const DEEPEST: usize = 32;
/// What is no polygon.
const OTHERS: [&str; 13] = [
    "POINT",
    "LINESTRING",
    "LINEARRING",
    "MULTIPOINT",
    "MULTILINESTRING",
    "TRIANGLE",
    "TIN",
    "POLYHEDRALSURFACE",
    "CIRCULARSTRING",
    "COMPOUNDCURVE",
    "CURVEPOLYGON",
    "MULTICURVE",
    "MULTISURFACE",
];

/// Tells whether a text begins as one that can be read here.
#[must_use]
pub fn is_wkt(start: &str) -> bool {
    let mut reader = Reader { text: start, at: 0 };
    reader.skip_srid();
    let word = reader.word();
    let known = matches!(word.as_str(), "POLYGON" | "MULTIPOLYGON" | "GEOMETRYCOLLECTION");
    known && matches!((reader.peek(), reader.word().as_str()), (Some('('), _) | (_, "Z" | "M" | "ZM" | "EMPTY"))
}

/// Reads all polygons of a text.
///
/// # Errors
/// [`PlanError`] with the place of what is not understood.
pub(super) fn read(text: &str, config: &ImportConfig) -> Result<(Plan, Reading), PlanError> {
    let mut reader = Reader { text, at: 0 };
    let mut polygons = Polygons::default();
    while reader.peek().is_some() {
        reader.skip_srid();
        reader.geometry(&mut polygons, 0)?;
        reader.takes(';');
    }
    polygons.plan(config.unit.unwrap_or(Unit::Meter))
}

/// A text, and how far it is read.
struct Reader<'a> {
    text: &'a str,
    at: usize,
}

impl Reader<'_> {
    /// Returns the next character that is no space.
    fn peek(&mut self) -> Option<char> {
        let rest = &self.text[self.at..];
        self.at += rest.len() - rest.trim_start().len();
        self.text[self.at..].chars().next()
    }

    /// Passes a sign, if it comes next.
    fn takes(&mut self, sign: char) -> bool {
        let found = self.peek() == Some(sign);
        if found {
            self.at += sign.len_utf8();
        }
        found
    }

    fn expect(&mut self, sign: char, expected: &'static str) -> Result<(), PlanError> {
        if self.takes(sign) { Ok(()) } else { Err(self.refused(expected)) }
    }

    /// Says what was expected instead of what comes next.
    fn refused(&mut self, expected: &'static str) -> PlanError {
        self.peek();
        let rest = &self.text[self.at..];
        let end = rest.find([' ', '\n', '\r', '\t', ',', '(', ')']).unwrap_or(rest.len());
        let first = rest.chars().next().map_or(0, char::len_utf8);
        let found: String = rest[..end.max(first)].chars().take(20).collect();
        let found = if found.is_empty() { "the end of the file".to_owned() } else { format!("`{found}`") };
        PlanError::Wkt { expected, found, at: Position::of(self.text, self.at) }
    }

    /// Passes a word of letters, and returns it in capitals.
    fn word(&mut self) -> String {
        self.peek();
        let rest = &self.text[self.at..];
        let end = rest.find(|character: char| !character.is_ascii_alphabetic()).unwrap_or(rest.len());
        self.at += end;
        rest[..end].to_ascii_uppercase()
    }

    /// Passes `SRID=25832;`.
    fn skip_srid(&mut self) {
        self.peek();
        let rest = &self.text[self.at..];
        if rest.get(..5).is_some_and(|start| start.eq_ignore_ascii_case("SRID="))
            && let Some(end) = rest.find(';')
        {
            self.at += end + 1;
        }
    }

    fn geometry(&mut self, polygons: &mut Polygons, depth: usize) -> Result<(), PlanError> {
        self.peek();
        let start = self.at;
        let name = self.word();
        let known = matches!(name.as_str(), "POLYGON" | "MULTIPOLYGON" | "GEOMETRYCOLLECTION");
        if depth > DEEPEST || !known && !OTHERS.contains(&name.as_str()) {
            self.at = start;
            return Err(self.refused("`POLYGON`, `MULTIPOLYGON` or `GEOMETRYCOLLECTION`"));
        }
        if self.is_empty() {
            return Ok(());
        }
        match name.as_str() {
            "POLYGON" => self.polygon(polygons),
            "MULTIPOLYGON" => self.list(|reader| reader.polygon(polygons)),
            "GEOMETRYCOLLECTION" => self.list(|reader| reader.geometry(polygons, depth + 1)),
            other => {
                polygons.leave_out(other);
                self.skip_brackets()
            }
        }
    }

    /// Passes `Z`, `M` or `ZM`, and tells whether `EMPTY` follows, which it passes.
    fn is_empty(&mut self) -> bool {
        let start = self.at;
        let mut word = self.word();
        if matches!(word.as_str(), "Z" | "M" | "ZM") {
            word = self.word();
        }
        if !word.is_empty() && word != "EMPTY" {
            self.at = start;
        }
        word == "EMPTY"
    }

    /// Reads `(item, item, …)`.
    fn list(&mut self, mut item: impl FnMut(&mut Self) -> Result<(), PlanError>) -> Result<(), PlanError> {
        self.expect('(', "`(`")?;
        loop {
            item(self)?;
            if !self.takes(',') {
                return self.expect(')', "`,` or `)`");
            }
        }
    }

    fn polygon(&mut self, polygons: &mut Polygons) -> Result<(), PlanError> {
        let mut rings = Vec::new();
        if self.is_empty() {
            return Ok(());
        }
        self.list(|reader| {
            rings.push(reader.ring(polygons)?);
            Ok(())
        })?;
        polygons.add(rings);
        Ok(())
    }

    fn ring(&mut self, polygons: &mut Polygons) -> Result<Vec<Point>, PlanError> {
        self.peek();
        let (start, mut ring) = (self.at, Vec::new());
        self.list(|reader| {
            polygons.count()?;
            ring.push(Point::new(reader.number()?, reader.number()?));
            // Elevation and measure.
            while reader.peek().is_some_and(|next| next != ',' && next != ')') {
                reader.number()?;
            }
            Ok(())
        })?;
        opened(ring).ok_or_else(|| PlanError::Ring { at: Some(Position::of(self.text, start)), path: String::new() })
    }

    fn number(&mut self) -> Result<f64, PlanError> {
        self.peek();
        let rest = &self.text[self.at..];
        let end = rest.find(|next: char| next.is_whitespace() || matches!(next, ',' | '(' | ')')).unwrap_or(rest.len());
        let number = rest[..end].parse::<f64>().ok().filter(|number| number.is_finite());
        let number = number.ok_or_else(|| self.refused("a number"))?;
        self.at += end;
        Ok(number)
    }

    /// Passes everything in a pair of brackets.
    fn skip_brackets(&mut self) -> Result<(), PlanError> {
        self.expect('(', "`(`")?;
        let mut open = 1;
        for (at, sign) in self.text[self.at..].char_indices() {
            open += i64::from(sign == '(') - i64::from(sign == ')');
            if open == 0 {
                self.at += at + 1;
                return Ok(());
            }
        }
        self.at = self.text.len();
        Err(self.refused("`)`"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<(Plan, Reading), PlanError> {
        read(text, &ImportConfig::default())
    }

    /// Checks how many points the rings of each polygon have, and what is said.
    fn check(text: &str, expected: &[&[usize]], said: &[&str]) {
        let (plan, reading) = parse(text).unwrap_or_else(|error| panic!("{text}: {error}"));
        let found: Vec<Vec<usize>> = plan.floors.iter().map(|area| area.rings.iter().map(Vec::len).collect()).collect();
        assert_eq!(found, expected, "{text}");
        assert_eq!(reading.found, said, "{text}");
    }

    const SQUARE: &str = "((0 0, 8 0, 8 8, 0 8, 0 0), (1 1, 2 1, 2 2, 1 1))";

    #[test]
    fn polygons_are_read_with_their_holes() {
        let one = "1 polygon with 1 hole and 9 points in meters";
        check(&format!("POLYGON {SQUARE}"), &[&[4, 3]], &[one]);
        check(&format!(" srid=25832; polygon{SQUARE}\n"), &[&[4, 3]], &[one]);
        check("POLYGON Z ((0 0 1, 1 0 1, 1 1 1, 0 0 1))", &[&[3]], &["1 polygon with no holes and 4 points in meters"]);
        let two = "2 polygons with 2 holes and 18 points in meters";
        check(&format!("MULTIPOLYGON({SQUARE},\n{SQUARE})"), &[&[4, 3], &[4, 3]], &[two]);
        check(&format!("POLYGON {SQUARE}\nPOLYGON {SQUARE};"), &[&[4, 3], &[4, 3]], &[two]);
        let nested = "GEOMETRYCOLLECTION (POINT (1 2), GEOMETRYCOLLECTION (POLYGON EMPTY, MULTIPOLYGON ((";
        check(
            &format!("{nested}(0 0,1 0,1 1,0 0)))), LINESTRING (1 2, 3 4), MULTIPOINT ((1 2), (3 4)), POINT EMPTY)"),
            &[&[3]],
            &["1 polygon with no holes and 4 points in meters", "left out 1 × LINESTRING, 1 × MULTIPOINT, 1 × POINT"],
        );
    }

    #[test]
    fn a_unit_scales_the_coordinates() {
        let config = ImportConfig { unit: Some(Unit::Millimeter), ..ImportConfig::default() };
        let (plan, reading) = read("POLYGON ((0 0, 5e3 0, 5e3 -2500, 0 0))", &config).expect("a polygon");
        assert_eq!(plan.floors[0].rings[0][2], Point::new(5.0, -2.5));
        assert_eq!(reading.found, ["1 polygon with no holes and 4 points in millimeters"]);
    }

    #[test]
    fn errors_name_what_was_expected_and_where() {
        let check = |text: &str, says: &str, line, column| {
            let error = parse(text).expect_err(says);
            assert!(error.to_string().contains(says), "{text}: {error}");
            assert_eq!(error.position(), Some(Position { line, column }), "{text}: {error}");
        };
        let polygon = "expected `POLYGON`, `MULTIPOLYGON` or `GEOMETRYCOLLECTION`, not";
        check("(0 0)", &format!("{polygon} `(`"), 1, 1);
        check("POLYGONS ((0 0))", &format!("{polygon} `POLYGONS`"), 1, 1);
        check("POLYGON 7", "expected `(`, not `7`", 1, 9);
        check("POLYGON", "expected `(`, not the end of the file", 1, 8);
        check("POLYGON ((0 0, 1 0, 1 1, 0 0)", "expected `,` or `)`, not the end of the file", 1, 30);
        check("POLYGON ((0 0,\n  1 zero,", "expected a number, not `zero`", 2, 5);
        check("POLYGON ((0 0, 1, 2 2, 0 0))", "expected a number, not `,`", 1, 17);
        check("POLYGON ((0 0, nan 1, 2 2, 0 0))", "expected a number, not `nan`", 1, 16);
        check("POLYGON ((0 0, 1 0, 1 1))", "a ring ends where it begins and has three corners or more", 1, 10);
        check("POLYGON ((0 0, 1 0, 0 0))", "a ring ends where it begins", 1, 10);
        check("GEOMETRYCOLLECTION (POINT (1 2, POLYGON ((", "expected `)`, not the end of the file", 1, 43);
        let deep = format!("{}POLYGON EMPTY", "GEOMETRYCOLLECTION (".repeat(40));
        check(&deep, polygon, 1, 661);
    }

    #[test]
    fn texts_are_known_by_their_first_words() {
        let check = |text: &str, expected| assert_eq!(is_wkt(text), expected, "{text}");
        for text in ["POLYGON((0 0", "multipolygon EMPTY", "\n SRID=4326;GEOMETRYCOLLECTION Z (", "Polygon zm (("] {
            check(text, true);
        }
        for text in ["", "POLYGON", "polygon: 3", "POINT (1 2)", "# POLYGON ((", "{}"] {
            check(text, false);
        }
    }

    proptest::proptest! {
        #[test]
        fn what_is_cut_or_changed_is_read_or_refused(cut in 0usize..200, at in 0usize..200, sign in "\\PC") {
            let whole = format!("GEOMETRYCOLLECTION (POINT (1 2), POLYGON {SQUARE}, MULTIPOLYGON ({SQUARE}))");
            let mut text: String = whole.chars().take(cut).collect();
            drop(parse(&text));
            if at <= text.len() {
                text.insert_str(at, &sign);
            }
            drop(parse(&text));
        }
    }
}

use super::*;
use crate::domain::map::position::Position;

/// A drawing: its unit, blocks and entities, each written as `NAME code=value …`.
fn drawing(unit: &str, blocks: &str, entities: &str) -> String {
    let records = |text: &str| -> String {
        let record = |line: &str| {
            let mut words = line.split(' ');
            let name = format!("  0\n{}\n", words.next().unwrap_or_default());
            let groups = words.map(|word| word.replace('=', "\n") + "\n");
            name + &groups.collect::<String>()
        };
        text.lines().map(str::trim).filter(|line| !line.is_empty()).map(record).collect()
    };
    let header = if unit.is_empty() { String::new() } else { format!("  9\n$INSUNITS\n 70\n     {unit}\n") };
    let section = |name: &str, text: &str| format!("  0\nSECTION\n  2\n{name}\n{text}  0\nENDSEC\n");
    section("HEADER", &header)
        + &section("BLOCKS", &records(blocks))
        + &section("ENTITIES", &records(entities))
        + "  0\nEOF\n"
}

fn config() -> ImportConfig {
    let patterns = |pattern: &str| Some(vec![pattern.to_owned()]);
    ImportConfig { walls: patterns("*wall*"), doors: patterns("door?"), ..ImportConfig::default() }
}

/// The ends of segments in hundredths of a meter.
fn ends(segments: &[Segment]) -> Vec<[i32; 4]> {
    let rounded = |segment: &Segment| {
        [segment.from.x, segment.from.y, segment.to.x, segment.to.y].map(|value| (100.0 * value).round() as i32)
    };
    segments.iter().map(rounded).collect()
}

/// Checks the walls of a drawing in meters.
fn check(blocks: &str, entities: &str, expected: &[[i32; 4]]) {
    let (plan, _) =
        read(&drawing("6", blocks, entities), &config()).unwrap_or_else(|error| panic!("{entities}: {error}"));
    assert_eq!(ends(&plan.walls), expected, "{entities}");
}

#[test]
fn lines_and_polylines_are_walls() {
    check("", "LINE 8=Wall 10=1 20=2 11=3 21=4", &[[100, 200, 300, 400]]);
    let corners = "8=A-WALL 90=3 10=0 20=0 10=1 20=0 10=1 20=1";
    check("", &format!("LWPOLYLINE {corners} 70=0"), &[[0, 0, 100, 0], [100, 0, 100, 100]]);
    check("", &format!("LWPOLYLINE {corners} 70=129"), &[[0, 0, 100, 0], [100, 0, 100, 100], [100, 100, 0, 0]]);
    let old = "POLYLINE 8=wall 10=0 20=0 70=0\nVERTEX 8=0 10=0 20=0\nVERTEX 8=0 10=2 20=0\nSEQEND 8=0\n\
               LINE 8=wall 10=0 20=1 11=2 21=1";
    check("", old, &[[0, 0, 200, 0], [0, 100, 200, 100]]);
    // What lies on a sheet of paper is not part of the model.
    check("", "LINE 8=wall 67=1 10=0 20=0 11=9 21=9\nLINE 8=wall 10=0 20=0 11=1 21=1", &[[0, 0, 100, 100]]);
}

#[test]
fn curves_are_chords() {
    let walls = |entity: &str| {
        let (plan, _) = read(&drawing("6", "", entity), &config()).expect("a drawing");
        plan.walls
    };
    let circle = walls("CIRCLE 8=wall 10=5 20=5 40=2");
    assert_eq!(circle.len(), 72);
    assert!(circle.iter().all(|chord| (chord.from.distance(Point::new(5.0, 5.0)) - 2.0).abs() < 1e-9));
    // From 350° to 100°, through the right.
    let arc = ends(&walls("ARC 8=wall 10=0 20=0 40=1 50=350 51=100"));
    assert_eq!((arc.len(), arc[0][..2].to_vec(), arc[21][2..].to_vec()), (22, vec![98, -17], vec![-17, 98]));
    // The same on the back of the sheet.
    assert_eq!(ends(&walls("ARC 8=wall 10=0 20=0 40=1 50=350 51=100 230=-1"))[0][..2], [-98, -17]);
    // Half a circle below and a quarter to the left of the chord.
    let half = ends(&walls("LWPOLYLINE 8=wall 70=0 10=0 20=0 42=1 10=2 20=0"));
    assert_eq!((half.len(), half[17][2..].to_vec()), (36, vec![100, -100]));
    let quarter = ends(&walls("LWPOLYLINE 8=wall 70=0 10=0 20=0 42=-0.41421356 10=2 20=0"));
    assert_eq!((quarter.len(), quarter[8][2..].to_vec()), (18, vec![100, 41]));
}

#[test]
fn ellipses_and_splines_are_followed() {
    let walls = |entity: &str| ends(&read(&drawing("6", "", entity), &config()).expect("a drawing").0.walls);
    // A quarter from the end of the longer axis, 2 m upwards, to that of the shorter one, 1 m to the left; on the back of the sheet
    // to the right.
    let quarter = "ELLIPSE 8=wall 10=0 20=0 11=0 21=2 40=0.5 41=0 42=1.5707963267948966";
    let found = walls(quarter);
    assert_eq!((found.len(), found[0][..2].to_vec(), found[17][2..].to_vec()), (18, vec![0, 200], vec![-100, 0]));
    assert_eq!(walls(&format!("{quarter} 230=-1"))[17][2..], [100, 0]);
    assert_eq!(walls("ELLIPSE 8=wall 10=0 20=0 11=1 21=0 40=1").len(), 72);
    let spline = "SPLINE 8=wall 71=2 40=0 40=0 40=0 40=1 40=1 40=1 10=0 20=0 10=2 20=2 10=4 20=0";
    let found = walls(spline);
    // The middle of a parabola: (0 + 2 · 2 + 4) / 4 and (0 + 2 · 2 + 0) / 4.
    assert_eq!((found.len(), found[3][2..].to_vec(), found[7][2..].to_vec()), (8, vec![200, 100], vec![400, 0]));
    check("", "SPLINE 8=wall 71=3 11=0 21=0 11=1 21=1", &[[0, 0, 100, 100]]);
}

#[test]
fn hatches_are_solid() {
    let solids = |entity: &str| -> Vec<Vec<[i32; 2]>> {
        let (plan, _) = read(&drawing("6", "", entity), &config()).unwrap_or_else(|error| panic!("{entity}: {error}"));
        let rounded = |point: &Point| [point.x, point.y].map(|meters| (100.0 * meters).round() as i32);
        plan.solids.iter().flat_map(|area| &area.rings).map(|ring| ring.iter().map(rounded).collect()).collect()
    };
    let square = [[0, 0], [200, 0], [200, 100], [0, 100]];
    let corners = "10=0 20=0 10=2 20=0 10=2 20=1 10=0 20=1";
    let before = "HATCH 8=wall 10=0 20=0 30=0 210=0 220=0 230=1 2=SOLID 70=1";
    let after = "97=0 75=1 76=1 98=1 10=7 20=7";
    assert_eq!(solids(&format!("{before} 91=1 92=7 72=0 73=1 93=4 {corners} {after}")), [square]);
    // A hole.
    let inner = "92=2 72=0 73=1 93=3 10=0.5 20=0.5 10=1 20=0.5 10=1 20=0.7";
    let found = solids(&format!("{before} 91=2 92=3 72=0 73=1 93=4 {corners} 97=0 {inner} {after}"));
    assert_eq!((found.len(), found[1].clone()), (2, vec![[50, 50], [100, 50], [100, 70]]));
    // Edges; the last one is written the wrong way round.
    let edges =
        "92=1 93=4 72=1 10=0 20=0 11=2 21=0 72=1 10=2 20=0 11=2 21=1 72=1 10=2 20=1 11=0 21=1 72=1 10=0 20=0 11=0 21=1";
    let found = &solids(&format!("{before} 91=1 {edges} {after}"))[0];
    let mut turns = found.clone();
    turns.dedup();
    assert_eq!(turns, [square[0], square[1], square[2], square[3], square[0]]);
    // Half a disc: an arc from 0° to 180° and its diameter; clockwise, its angles count the other way round.
    let half = |direction: &str| {
        let edges = format!("92=1 93=2 72=2 10=0 20=0 40=1 50=0 51=180 73={direction} 72=1 10=-1 20=0 11=1 21=0");
        solids(&format!("{before} 91=1 {edges} {after}")).remove(0)
    };
    assert!(half("1").iter().all(|[_, y]| *y >= 0) && half("1").contains(&[0, 100]));
    assert!(half("0").iter().all(|[_, y]| *y <= 0) && half("0").contains(&[0, -100]));
    let bulged = solids(&format!("{before} 91=1 92=7 72=1 73=1 93=2 10=1 20=0 42=1 10=-1 20=0 42=0 {after}"));
    assert!(bulged[0].contains(&[0, 100]));
    assert_eq!(solids("SOLID 8=wall 10=0 20=0 11=2 21=0 12=0 22=1 13=2 23=1"), [square]);
    assert_eq!(solids("SOLID 8=wall 10=0 20=0 11=2 21=0 12=2 22=1"), [square[..3].to_vec()]);
    // What is hatched elsewhere is none.
    assert!(
        solids(&format!("LINE 8=wall 10=0 20=0 11=1 21=0\nHATCH 8=floor 91=1 92=7 72=0 73=1 93=4 {corners}"))
            .is_empty()
    );
}

#[test]
fn blocks_are_drawn_where_they_are_inserted() {
    let block = "BLOCK 2=unit 10=1 20=0\nLINE 8=0 10=1 20=0 11=3 21=0\nLINE 8=other 10=1 20=0 11=1 21=1\nENDBLK";
    check(block, "INSERT 8=wall 2=unit 10=10 20=20", &[[1000, 2000, 1200, 2000]]);
    check(block, "INSERT 8=wall 2=unit 10=10 20=20 41=2 42=3 50=90", &[[1000, 2000, 1000, 2400]]);
    check(block, "INSERT 8=wall 2=unit 10=0 20=0 70=2 44=5", &[[0, 0, 200, 0], [500, 0, 700, 0]]);
    let nested = format!("{block}\nBLOCK 2=floor 10=0 20=0\nINSERT 8=0 2=unit 10=0 20=4\nENDBLK");
    check(&nested, "INSERT 8=wall 2=floor 10=1 20=1 230=1", &[[100, 500, 300, 500]]);
    // A block in itself ends somewhere; blocks of blocks of nothing do not take for ever.
    let itself = "BLOCK 2=a\nINSERT 8=0 2=a 10=1 20=0\nLINE 8=wall 10=0 20=0 11=0 21=1\nENDBLK";
    let (plan, _) = read(&drawing("6", itself, "INSERT 8=0 2=a 10=0 20=0"), &config()).expect("a drawing");
    assert_eq!(plan.walls.len(), 16);
    let many = "BLOCK 2=a\nINSERT 8=0 2=a 10=0 20=0 70=30000 71=30000\nENDBLK";
    let error = read(&drawing("6", many, "INSERT 8=0 2=a 10=0 20=0"), &config()).expect_err("too many");
    assert!(matches!(error, PlanError::TooManyPoints { .. }), "{error}");
}

#[test]
fn layers_say_what_is_a_wall_or_a_door() {
    let entities = "LINE 8=A-WALL-EXT 10=0 20=0 11=9000 21=0\nLINE 8=Door1 10=1000 20=0 11=2000 21=0\n\
                    ARC 8=Door1 10=1000 20=0 40=1000 50=0 51=90\nLINE 8=door10 10=0 20=0 11=1 21=0\n\
                    CIRCLE 8=tables 10=0 20=0 40=1\nMTEXT 8=text 10=0\nMTEXT 8=text 10=0";
    let (plan, reading) = read(&drawing("4", "", entities), &config()).expect("a drawing");
    assert_eq!(ends(&plan.walls), [[0, 0, 900, 0]]);
    assert_eq!(ends(&plan.doors), [[100, 0, 200, 0]]);
    let said = [
        "1 wall line on `A-WALL-EXT` in millimeters",
        "1 door line on `Door1`",
        "left out `door10`, `tables`, 2 × MTEXT",
    ];
    assert_eq!((reading.found.as_slice(), reading.doubts.len()), (&said.map(str::to_owned)[..], 0));
    let (_, reading) = read(&drawing("4", "", "LINE 8=wall 10=0 20=0 11=1 21=0"), &config()).expect("a drawing");
    assert_eq!(reading.doubts, ["no layer is one of doors, only `wall`"]);
}

#[test]
fn the_unit_is_the_headers_or_one_that_is_told() {
    let line = "LINE 8=wall 10=0 20=0 11=100 21=0";
    let walls = |unit: &str, config: &ImportConfig| {
        read(&drawing(unit, "", line), config)
            .map(|(plan, _)| ends(&plan.walls)[0][2])
            .map_err(|error| error.to_string())
    };
    for (unit, length) in [("1", 254), ("2", 3048), ("4", 10), ("5", 100), ("6", 10000)] {
        assert_eq!(walls(unit, &config()), Ok(length), "{unit}");
    }
    let told = ImportConfig { unit: Some(Unit::Centimeter), ..config() };
    assert_eq!((walls("6", &told), walls("", &told)), (Ok(100), Ok(100)));
    for unit in ["", "0"] {
        assert_eq!(walls(unit, &config()), Err("the header of the drawing names no unit".to_owned()));
    }
    assert_eq!(
        walls("14", &config()),
        Err("the header of the drawing names the unit 14, which is not read".to_owned())
    );
}

#[test]
fn errors_name_what_is_wrong_and_where() {
    let check = |text: &str, says: &str, line: Option<u64>| {
        let error = read(text, &config()).expect_err(says);
        assert!(error.to_string().contains(says), "{error}");
        assert_eq!(error.position(), line.map(|line| Position { line, column: 1 }), "{error}");
    };
    check("AutoCAD Binary DXF\r\n\u{1a}\0", "the drawing is a binary DXF, only text is read", None);
    check("hello", "the DXF is not understood: expected the number of a group, not `hello`", Some(1));
    check("  0\nSECTION\n  2", "expected the value of a group, not nothing", Some(4));
    check("  2\nx\n", "expected a `SECTION`, not `x`", Some(1));
    check("{\"type\": 1}", "expected the number of a group", Some(1));
    let entity = |entity: &str| drawing("6", "", entity);
    check(&entity("LINE 8=wall 10=0 20=0 11=1"), "a `LINE` lacks the group 21", Some(21));
    check(&entity("LINE 8=wall 10=0 20=x"), "expected a number, not `x`", Some(28));
    check(&entity("LINE 8=wall 10=0 20=0 11=1e9 21=0"), "is no number of meters", None);
    check(
        &entity("LINE 8=base 10=0 20=0 11=1 21=0"),
        "no layer of the drawing is one of walls; its layers: `base`",
        None,
    );
    check(&entity(""), "no layer of the drawing is one of walls; its layers: none", None);
}

#[test]
fn files_are_known_by_their_first_lines() {
    ["  0\nSECTION", "0\r\nSECTION\r\n", "999\nby somebody\n0", "AutoCAD Binary DXF"]
        .iter()
        .for_each(|text| assert!(is_dxf(text)));
    ["", "0", "0\nLINE", "{}", "POLYGON ((0 0"].iter().for_each(|text| assert!(!is_dxf(text)));
}

proptest::proptest! {
    #[test]
    fn what_is_cut_or_changed_is_read_or_refused(cut in 0usize..400, at in 0usize..400, sign in "\\PC|\n|[0-9]{1,9}") {
        let block = "BLOCK 2=a\nINSERT 8=0 2=a 10=1 20=0\nARC 8=wall 10=0 20=0 40=1 50=0 51=9\nENDBLK";
        let whole = drawing("6", block, "INSERT 8=0 2=a 10=0 20=0 70=2\nLWPOLYLINE 8=wall 70=1 10=0 20=0 42=1 10=2 20=0");
        let mut text: String = whole.chars().take(cut).collect();
        drop(read(&text, &config()));
        if at <= text.len() {
            text.insert_str(at, &sign);
        }
        drop(read(&text, &config()));
    }
}

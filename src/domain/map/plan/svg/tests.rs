use super::*;

fn config(scale: f64) -> ImportConfig {
    let patterns = |pattern: &str| Some(vec![pattern.to_owned()]);
    ImportConfig {
        walls: patterns("wall*"),
        doors: patterns("door*"),
        image_resolution: Some(scale),
        ..ImportConfig::default()
    }
}

fn drawn(body: &str) -> (Plan, Reading) {
    let text = format!(
        "<?xml version='1.0'?><svg xmlns='http://www.w3.org/2000/svg' xmlns:xlink='http://www.w3.org/1999/xlink' \
         xmlns:inkscape='http://www.inkscape.org/namespaces/inkscape' viewBox='10 20 200 100'>{body}</svg>"
    );
    read(&text, &config(0.1)).unwrap_or_else(|error| panic!("{body}: {error}"))
}

/// The corners of solids, ring by ring, in hundredths of a meter.
fn corners(areas: &[Area]) -> Vec<Vec<[i32; 2]>> {
    let rounded = |point: &Point| [point.x, point.y].map(|meters| (100.0 * meters).round() as i32);
    areas.iter().flat_map(|area| &area.rings).map(|ring| ring.iter().map(rounded).collect()).collect()
}

/// Checks what a drawing of 20 × 10 m, whose upper left corner is (10, 20), shows as solid.
fn check(body: &str, expected: &[&[[i32; 2]]]) {
    assert_eq!(corners(&drawn(body).0.solids), expected, "{body}");
}

/// A wall of 1 m by 0.5 m that begins 2 m from the left and 2 m from the lower edge.
const BLOCK: &[[i32; 2]] = &[[200, 250], [300, 250], [300, 200], [200, 200]];

#[test]
fn what_is_filled_is_solid() {
    check("<rect id='wall' x='30' y='95' width='10' height='5'/>", &[BLOCK]);
    check("<g class='bare walls'><polygon points='30,95 40,95 40,100 30,100'/></g>", &[BLOCK]);
    check("<g inkscape:label='Walls'><path d='M30 95h10v5h-10z'/></g>", &[BLOCK]);
    check(
        "<g id='wall' fill='none'><path d='M30 95h10v5h-10z'/><rect x='30' y='95' width='10' height='5' fill='red'/></g>",
        &[BLOCK],
    );
    check(
        "<g id='wall' display='none'><rect width='10' height='5'/></g><rect class='wall' x='30' y='95' width='10' height='5'/>",
        &[BLOCK],
    );
}

#[test]
fn lines_are_as_thick_as_they_are_drawn() {
    // 4 units are 0.4 m; the ends reach half of that further.
    let line = "<line class='wall' x1='30' y1='98' x2='36' y2='98' stroke='#000' stroke-width='4'/>";
    check(line, &[&[[180, 200], [280, 200], [280, 240], [180, 240]]]);
    let (plan, _) = drawn(
        "<g id='wall' transform='scale(2)'><path fill='none' stroke='black' stroke-width='2' d='M15 49L18 49'/></g>",
    );
    assert_eq!(corners(&plan.solids), [[[180, 200], [280, 200], [280, 240], [180, 240]]]);
    let thick = ImportConfig { wall_thickness: Some(0.2), unit: None, ..config(0.1) };
    let text = "<svg xmlns='http://www.w3.org/2000/svg' height='100'><line id='wall' y1='98' y2='98' x2='6' stroke='red'/></svg>";
    let (plan, _) = read(text, &thick).expect("a drawing");
    assert_eq!(corners(&plan.solids), [[[-10, 10], [70, 10], [70, 30], [-10, 30]]]);
}

#[test]
fn colors_name_what_has_them() {
    let by = |color: &str, body: &str| {
        let text = format!("<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 100 100'>{body}</svg>");
        let walls = Some(vec![color.to_owned()]);
        let found = read(&text, &ImportConfig { walls, doors: None, ..config(0.1) });
        found.map(|(plan, _)| plan.solids.len())
    };
    let both = "<rect width='10' height='5' fill='rgb(255, 0, 0)' stroke='navy'/>";
    assert_eq!(by("#ff0000", both), Ok(1));
    assert_eq!(by("#000080", both), Ok(4), "four sides");
    assert_eq!(
        by(
            "#ff0000",
            "<style>.st0 { fill: none; stroke: #F00 } g .st0 { stroke-width: 3 }</style><g><path class='st0' d='M0 0H9'/></g>"
        ),
        Ok(1)
    );
    let refused = by("#00ff00", both).expect_err("no wall").to_string();
    assert!(refused.ends_with("there is `#000080`, `#ff0000`"), "{refused}");
}

#[test]
fn uses_and_transforms_put_things_elsewhere() {
    let used = "<defs><rect id='block' width='10' height='5'/></defs><g id='walls' transform='translate(20 75)'>\
                <use xlink:href='#block' x='10' y='20'/></g>";
    check(used, &[BLOCK]);
    check(
        "<g id='wall' transform='rotate(90)'><rect x='95' y='-40' width='5' height='10'/></g>",
        &[&[[300, 250], [300, 200], [200, 200], [200, 250]]],
    );
    // What calls itself has an end.
    let endless =
        "<svg xmlns='http://www.w3.org/2000/svg'><g id='wall'><use href='#wall'/><use href='#wall'/></g></svg>";
    let refused = read(endless, &config(0.1)).expect_err("endless");
    assert!(matches!(refused, PlanError::Svg { .. } | PlanError::TooManyPoints { .. }), "{refused}");
}

#[test]
fn holes_run_the_other_way_round() {
    let outer = "M30 70h20v20h-20z";
    let rings = |hole: &str, rule: &str| {
        let (plan, _) = drawn(&format!("<path id='wall' fill-rule='{rule}' d='{outer}{hole}'/>"));
        plan.solids.iter().map(|area| area.rings.len()).collect::<Vec<_>>()
    };
    assert_eq!(rings("M35 75v10h10v-10z", "nonzero"), [2]);
    assert_eq!(rings("M35 75h10v10h-10z", "nonzero"), [1, 1], "the same way round: both are solid");
    assert_eq!(rings("M35 75h10v10h-10z", "evenodd"), [2]);
    assert_eq!(rings("M80 75v10h10v-10z", "nonzero"), [1, 1], "in nothing");
}

#[test]
fn doors_lie_along_their_middle() {
    let doors = |body: &str| -> Vec<[i32; 4]> {
        let (plan, _) = drawn(&format!("<rect id='wall' width='1' height='1'/>{body}"));
        let rounded =
            |door: &Segment| [door.from.x, door.from.y, door.to.x, door.to.y].map(|m| (100.0 * m).round() as i32);
        plan.doors.iter().map(rounded).collect()
    };
    // 0.9 m wide in a wall of 0.2 m.
    assert_eq!(doors("<rect class='door' x='30' y='60' width='9' height='2'/>"), [[200, 590, 290, 590]]);
    assert_eq!(doors("<rect class='door' x='30' y='60' width='2' height='9'/>"), [[210, 600, 210, 510]]);
    assert_eq!(doors("<path class='door' d='M30 60h9A9 9 0 0 1 30 69'/>"), [[200, 600, 290, 600]], "the swing is none");
    let (_, reading) =
        drawn("<rect id='wall' width='1' height='1'/><rect class='window' fill='blue' width='2' height='1'/>");
    assert_eq!(reading.found, ["1 wall shape by `wall`", "left out `#0000ff`, `window`"]);
    assert_eq!(reading.doubts, ["nothing is a door, there is only `#0000ff`, `window`"]);
}

#[test]
fn curves_are_followed() {
    let (plan, _) =
        drawn("<circle id='wall' cx='40' cy='60' r='10'/><path class='wall' d='M60 60a10 10 0 0 0 20 0z'/>");
    let circle = &plan.solids[0].rings[0];
    let center = Point::new(3.0, 6.0);
    assert!(circle.iter().all(|point| (point.distance(center) - 1.0).abs() < 1e-9));
    let bow = &plan.solids[1].rings[0];
    let center = Point::new(6.0, 6.0);
    assert!(bow.iter().all(|point| (point.distance(center) - 1.0).abs() < 1e-3 && point.y < 6.0 + 1e-6), "{bow:?}");
    assert!(bow.iter().any(|point| point.y < 5.01));
}

#[test]
fn what_cannot_be_read_is_named_with_its_place() {
    let refused = |text: &str, expected: &str| {
        let error = read(text, &config(0.1)).expect_err(text);
        assert!(error.to_string().contains(expected), "{text}: {error}");
        error.position()
    };
    let svg = "<svg xmlns='http://www.w3.org/2000/svg'>";
    let at = |line, column| Some(Position { line, column });
    let position = refused(&format!("{svg}\n<g></h></svg>"), "the XML is not understood: expected 'g' tag, not 'h'");
    assert_eq!(position.map(|at| at.line), Some(2));
    assert_eq!(
        refused(&format!("{svg}\n <path id='wall' d='M0 0 L1'/></svg>"), "`d` of a `path` is `M0 0 L1`"),
        at(2, 2)
    );
    assert_eq!(refused(&format!("{svg}<rect width='50%'/></svg>"), "`width` of a `rect` is `50%`"), at(1, 41));
    assert_eq!(refused(&format!("{svg}<g transform='turn(3)'/></svg>"), "`transform` of a `g`"), at(1, 41));
    refused("<html xmlns='http://www.w3.org/2000/svg'/>", "the outermost element is `html`");
    refused(&format!("{svg}</svg>"), "there is nothing");
    let deep = format!("{svg}{}{}</svg>", "<g>".repeat(300), "</g>".repeat(300));
    refused(&deep, "more than 256");
    let bare = ImportConfig { image_resolution: None, ..config(0.1) };
    assert_eq!(read(&format!("{svg}</svg>"), &bare), Err(PlanError::SvgScale));
}

/// Names, rules and uses cost something: what is made of many of them ends.
#[test]
fn hostile_drawings_end() {
    let svg = |body: &str| format!("<svg xmlns='http://www.w3.org/2000/svg'>{body}</svg>");
    let classes = "a ".repeat(100_000);
    let named = svg(&format!("<g class='{classes}'>{}</g>", "<path d='M0 0H1'/>".repeat(1_000)));
    let rules = (0..20_000).map(|i| format!(".c{i}{{fill:red}}")).collect::<String>();
    let styled = svg(&format!("<style>{rules}</style>{}", "<path d='M0 0H1'/>".repeat(1_000)));
    for text in [named, styled] {
        let error = read(&text, &config(0.1)).expect_err("too much");
        assert!(matches!(error, PlanError::TooManyPoints { .. }), "{error}");
    }
    let uses = format!("{}<rect id='wall' width='9' height='9'/>", "<use href='#wall'/>".repeat(20_000));
    assert_eq!(read(&svg(&uses), &config(0.1)).expect("a drawing").0.solids.len(), 20_001);
}

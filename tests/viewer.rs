//! Looks closely at a map as a reader does: with a mouse, with keys, layer by layer, and at people who walk.

use std::f64::consts::PI;

use serde_json::{Value, json};
use trodden::domain::geometry::{Cell, Frame, Grid, Point};
use trodden::domain::map::OccupancyMap;
use trodden::domain::raster::VisitCounts;
use trodden::domain::tracks::Sample;
use trodden::kinds::{Heat, Placed};
use trodden::report::viewer::{Episode, Scene, page};

use super::browser::Page;

const ROWS: usize = 40;
const COLS: usize = 60;
/// What no name may do.
const NAME: &str = "<b>ward</b></script><script>window.wrongs.push('a name ran')</script>";
/// The cell that is asked for.
const ASKED: Cell = Cell::new(10, 20);

/// A hall in a wall of a cell, turned by 30°: heat rises from left to right, density from top to bottom, people go to the
/// right in the upper half; one of them walks from (1, 2) m with 1 m/s to the right for 4 s.
fn scene() -> (Scene, Frame) {
    let frame = Frame { origin: Point::new(-3.0, 2.0), yaw: PI / 6.0, ..Frame::at_zero(0.1, ROWS, COLS) };
    let inside = |cell: Cell| (1..ROWS - 1).contains(&cell.row) && (1..COLS - 1).contains(&cell.col);
    let free = Grid::from_fn(ROWS, COLS, inside);
    let map = OccupancyMap::new(free.clone(), frame).expect("a map");
    let at = |value: fn(Cell) -> f32| Grid::from_fn(ROWS, COLS, |cell| if inside(cell) { value(cell) } else { 0.0 });
    let flow = std::array::from_fn(|direction| {
        Grid::from_fn(ROWS, COLS, |cell| if direction == 0 && inside(cell) && cell.row < ROWS / 2 { 1.0 } else { 0.0 })
    });
    // 0.5 where it is asked for, 1 at most; 2 where it is asked for, 8 at most.
    let heat = at(|cell| (cell.col as f32 / 40.0).min(1.0));
    let density = at(|cell| (cell.row as f32 / 5.0).min(8.0));
    let heat = Heat { density: Some(density), flow: Some(flow), ..Heat::new(free, heat) };
    let counts = Grid::from_fn(ROWS, COLS, |cell| if cell == ASKED { 1234 } else { 0 });
    let visits = VisitCounts { counts, paths: 2000, flow: None };
    let walk: Vec<_> = (0..=40).map(|i| (walker(i), false)).collect();
    let scene = Scene::new(NAME, &map)
        .heat("", &Placed::new(frame, heat))
        .visits("", &Placed::new(frame, visits))
        .paths([(&[Point::new(0.5, 0.5), Point::new(5.5, 0.5)], "5 m"), (&[], "none")])
        .episode(Episode::new("an hour in May", 10.0, 0.2, &walk));
    (scene, frame)
}

fn walker(frame: i64) -> Sample {
    let position = Point::new(1.0 + 0.1 * frame as f64, 2.0);
    Sample { episode: 0, id: 0, frame, position, velocity: Point::new(1.0, 0.0), path: 0 }
}

/// What a reader does. `at` takes a cell to the window as it is after opening: the map fits with 12 pixels on each side.
const DRIVE: &str = "(async () => {
    const said = {};
    await until(() => document.querySelector('.trodden-view[data-ready]'));
    const canvas = document.querySelector('canvas'), box = canvas.getBoundingClientRect();
    const zoom = Math.min((box.width - 24) / 60, (box.height - 24) / 40, 72);
    const at = (row, col) => [(box.width - 60 * zoom) / 2 + (col + 0.5) * zoom, (box.height - 40 * zoom) / 2 + (row + 0.5) * zoom];
    const event = (Type, name, [x, y], more) => canvas.dispatchEvent(new Type(name, {
        clientX: box.left + x, clientY: box.top + y, bubbles: true, cancelable: true, pointerId: 1, ...more }));
    const hover = async place => { event(PointerEvent, 'pointermove', place); await painted(); };
    const key = async (key, more) => { canvas.dispatchEvent(new KeyboardEvent('keydown', { key, bubbles: true, ...more })); await sleep(400); await painted(); };
    const cell = () => Object.fromEntries([...document.querySelectorAll('.tv-readout div')].map(row => [...row.children].map(part => part.textContent)));
    const color = ([x, y]) => [...canvas.getContext('2d').getImageData(Math.round(x), Math.round(y), 1, 1).data].slice(0, 3).join();
    const picture = () => canvas.toDataURL();
    const choose = async text => {
        [...document.querySelectorAll('.tv-choice')].find(label => label.textContent.startsWith(text)).querySelector('input').click();
        await painted();
    };
    const unit = () => document.querySelector('.tv-legend').textContent;

    said.title = document.querySelector('h1').textContent;
    said.scripts = document.scripts.length;
    await hover(at(10, 20));
    said.cell = cell();
    said.tip = document.querySelector('.tv-tip').textContent;
    await hover(at(0, 0));
    said.wall = cell();
    await hover([2, 2]);
    said.beyond = cell();

    const heat = color(at(30, 20)), wall = color(at(0, 30));
    said.unlike = heat !== wall && heat !== color(at(30, 39)) && heat === color(at(35, 20));
    await choose('density');
    said.switched = color(at(30, 20)) !== heat && color(at(30, 20)) === color(at(30, 39));
    said.units = unit();
    const linear = color(at(5, 20));
    await choose('log');
    said.log = color(at(5, 20)) !== linear;
    await choose('visits');
    said.counts = color(at(10, 20)) !== color(at(10, 21)) && unit().includes('not visited');
    await choose('heat');
    said.back = color(at(30, 20)) === heat;

    const calm = picture();
    await choose('arrows');
    const arrows = picture();
    await choose('arrows');
    said.arrows = arrows !== calm && picture() === calm;
    await choose('grid');
    said.grid = picture() !== calm;
    await choose('grid');
    await choose('shortest path');
    said.line = picture() !== calm;
    await choose('shortest path');

    // A wheel of 500 pixels: exp(0.0016 · 500) times as large, about the pointer.
    event(WheelEvent, 'wheel', at(10, 20), { deltaY: -500 });
    await hover(at(10, 20));
    said.fixed = cell()['row, column'];
    const aside = at(10, 20);
    await hover([aside[0] + 10 * zoom * Math.exp(0.8), aside[1]]);
    said.aside = cell()['row, column'];
    await key('0');
    await hover(at(10, 20));
    said.fitted = cell()['row, column'];
    await key('+');
    await hover([box.width / 2 + 15.1 * zoom, box.height / 2 + 0.1]);
    said.larger = cell()['row, column'];
    await key('0');
    // Taken by the mouse and moved by five cells.
    event(PointerEvent, 'pointerdown', at(10, 20), { button: 0, buttons: 1 });
    for (let i = 1; i <= 10; i++) event(PointerEvent, 'pointermove', at(10, 20 + i / 2), { buttons: 1 });
    event(PointerEvent, 'pointerup', at(10, 25), { button: 0 });
    await hover(at(10, 25));
    said.dragged = cell()['row, column'];
    await key('0');
    event(PointerEvent, 'pointerdown', at(10, 20), { button: 0, buttons: 1 });
    event(PointerEvent, 'pointerup', at(10, 20), { button: 0 });
    event(PointerEvent, 'pointerleave', at(10, 20));
    await key('ArrowRight', { shiftKey: true });
    said.walked = cell()['row, column'];
    said.spoken = document.querySelector('.tv-spoken').textContent;
    await key('Escape');
    said.none = cell()['row, column'];

    const play = document.querySelector('.tv-play'), time = document.querySelector('.tv-time'), slider = document.querySelector('.tv-player input');
    said.begin = time.value;
    play.click();
    await until(() => parseFloat(time.value) > 0.5);
    const early = picture();
    await until(() => parseFloat(time.value) > 1.5);
    said.playing = picture() !== early && play.title;
    play.click();
    await sleep(100);
    const stopped = time.value;
    await sleep(500);
    said.paused = time.value === stopped && play.title;
    // After 2.5 s, between two frames that are kept, the disc is about (3.5, 2) m: column 35, the line between rows 19 and 20.
    slider.value = 2.5;
    slider.dispatchEvent(new Event('input'));
    await painted();
    said.time = time.value;
    const [x, y] = at(19.5, 34.5);
    said.person = [color([x - zoom, y]), color([x, y + zoom]), color([x + 3.5 * zoom, y])];
    await choose('people');
    said.gone = color([x - zoom, y]);
    await choose('tracks');
    said.track = color(at(19.5, 45));
    return said;
})()";

#[test]
fn a_reader_looks_closely() {
    let (scene, frame) = scene();
    let folder = tempfile::tempdir().expect("creates");
    let page = page(&scene, "`heat.png` shows the same.");
    assert_eq!(page.matches("</script>").count(), 3, "no name ends an element");
    let path = folder.path().join("view.html");
    std::fs::write(&path, &page).expect("writes");
    let Some(mut open) = Page::open(&path, "") else { return };
    let said = open.run(DRIVE);
    open.check();
    // Description and numbers are gone once they are unpacked.
    assert_eq!((said["title"].as_str(), said["scripts"].as_u64()), (Some(NAME), Some(1)));
    let Point { x, y } = frame.to_map(frame.center(ASKED));
    let place = format!("{x:.2}, {y:.2} m").replace('-', "−");
    let cell = json!({
        "x, y": place, "row, column": "10, 20", "heat": "0.5", "density": "2", "visits": "1234", "flow": "→ 100 %",
    });
    assert_eq!((&said["cell"], said["tip"].as_str()), (&cell, Some("0.5")));
    assert_eq!((&said["wall"]["row, column"], &said["wall"]["heat"]), (&json!("0, 0"), &json!("blocked")));
    assert_eq!(said["beyond"]["heat"], "–");
    for seen in ["unlike", "switched", "log", "counts", "back", "arrows", "grid", "line"] {
        assert_eq!(said[seen], true, "{seen}: {said:#}");
    }
    assert!(said["units"].as_str().is_some_and(|units| units.contains("people, relative to")));
    assert_eq!(
        (&said["fixed"], &said["aside"], &said["fitted"]),
        (&json!("10, 20"), &json!("10, 30"), &json!("10, 20"))
    );
    // Half as large again: what was 15.1 cells right of the middle is now 10.07 cells right of it.
    assert_eq!(said["larger"], "20, 40");
    assert_eq!((&said["dragged"], &said["walked"], &said["none"]), (&json!("10, 20"), &json!("10, 21"), &json!("–")));
    assert!(
        said["spoken"].as_str().is_some_and(|spoken| spoken.contains("row, column 10, 21; heat 0.525")),
        "{said:#}"
    );
    plays(&said);
    darkens(&mut open);
    open.check();
}

/// The floor follows the page's light at once, values keep their colors, and nothing of the panel is drawn over the map.
fn darkens(open: &mut Page) {
    let colors = "(async () => {
        await painted();
        const canvas = document.querySelector('canvas'), middle = [canvas.width / 2, canvas.height / 3].map(Math.round);
        const color = () => [...canvas.getContext('2d').getImageData(...middle, 1, 1).data].join();
        const choose = async text => {
            [...document.querySelectorAll('.tv-choice')].find(label => label.textContent.startsWith(text)).querySelector('input').click();
            await painted();
        };
        await choose('heat');
        const value = color();
        await choose('map only');
        return [value, color(), getComputedStyle(document.querySelector('.tv-panel')).backgroundColor];
    })()";
    let light = open.run(colors);
    open.light("dark");
    let dark = open.run(colors);
    assert_eq!(light[0], dark[0]);
    assert_eq!((&light[1], &light[2]), (&json!("250,250,248,255"), &json!("rgb(255, 255, 255)")));
    assert!(light[1] != dark[1] && light[2] != dark[2], "{light} {dark}");
}

fn plays(said: &Value) {
    assert_eq!((&said["begin"], &said["time"]), (&json!("0.0 s of 4.0 s"), &json!("2.5 s of 4.0 s")));
    assert_eq!((&said["playing"], &said["paused"]), (&json!("pause"), &json!("play")));
    let person = "52,101,164";
    assert_eq!((&said["person"][0], &said["person"][1]), (&json!(person), &json!(person)), "{said:#}");
    assert!(said["person"][2] != person && said["gone"] != person, "{said:#}");
    assert_ne!(said["track"], said["gone"]);
}

/// Where a browser cannot unpack, the page says where else to look; and a damaged page says what is wrong with it.
#[test]
fn a_page_that_cannot_be_shown_says_so() {
    let folder = tempfile::tempdir().expect("creates");
    let (scene, _) = scene();
    let page = page(&scene, "`heat.png` shows the same.");
    let trouble = |page: &str, first: &str| {
        let path = folder.path().join("view.html");
        std::fs::write(&path, page).expect("writes");
        let mut open = Page::open(&path, first)?;
        open.run("until(() => document.querySelector('.tv-trouble'))");
        open.check();
        Some(open.run("document.querySelector('.tv-trouble').textContent"))
    };
    let Some(told) = trouble(&page, "delete window.DecompressionStream") else { return };
    assert_eq!(told, "This view cannot be shown (this browser is too old to unpack it). `heat.png` shows the same.");
    let at = page.find("type=\"text/plain\">").expect("numbers") + "type=\"text/plain\">".len();
    let damaged = format!("{}{}", &page[..at], &page[at + 400..]);
    let told = trouble(&damaged, "").expect("the browser was there before");
    assert!(told.as_str().is_some_and(|told| told.contains("`heat.png` shows the same.")), "{told}");
}

#[test]
fn the_same_scene_gives_the_same_page() {
    let pages = [0, 1].map(|_| page(&scene().0, ""));
    assert!(pages[0] == pages[1]);
}

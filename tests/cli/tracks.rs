//! Recorded people: added day by day, and laid over what the model says.

use serde_json::Value;

use super::maps::{room, ros};
use super::{Place, check};

/// A room of 4 m × 4 m.
fn ward() -> Place {
    let place = Place::empty();
    place.write("ward/map.pgm", room(40));
    place.write("ward/map.yaml", ros("map.pgm", "", ""));
    place
}

/// Somebody who crosses the room from left to right so many times, at a height in meters.
fn crossings(times: usize, height: f64) -> String {
    let mut text = "who,t,x,y\n".to_owned();
    for time in 0..times {
        for step in 0..=6 {
            let (t, x) = (20.0 * time as f64 + 0.5 * f64::from(step), 0.55 + 0.5 * f64::from(step));
            text += &format!("anna,{t},{x},{height}\n");
        }
    }
    text
}

fn ran(place: &Place) -> Vec<String> {
    let events = place.events(0, &["run", "days.yaml", "--json"]);
    let ran = events.iter().filter(|event| event["event"] == "node" && event["outcome"] == "ran");
    ran.map(|event| event["node"].as_str().expect("a name").to_owned()).collect()
}

/// Returns the number `n` of a query's only row.
fn number(place: &Place, query: &str) -> f64 {
    let told: Value = serde_json::from_str(&place.out(&["sql", "--json", query])).expect("is JSON");
    told["n"].as_f64().expect("a number")
}

#[test]
fn a_new_day_computes_only_what_it_adds() {
    let place = ward();
    place.write("monday.csv", crossings(3, 1.05));
    place.write("tuesday.csv", crossings(2, 3.05));
    let pipeline = |files: &str| {
        format!(
            "maps: {{ train: {{ files: ward/map.yaml }} }}\nstages:\n  \
             walks: {{ use: import-tracks, map: $maps, file: {files}, columns: {{ id: who, time: t, x: x, y: y }}, unit: m }}\n  \
             visits: {{ use: rasterize, map: $maps, walks: walks, flow: true }}\n  \
             walls: {{ use: wall-distance, map: $maps }}\n  \
             heat: {{ use: update, map: $maps, heat: walls, visits: visits }}\n"
        )
    };
    place.write("days.yaml", pipeline("[monday.csv]"));
    ran(&place);
    let heat = |row: &str| {
        number(&place, &format!("SELECT AVG(heat) AS n FROM 'heat/ward' WHERE row = {row} AND col > 15 AND col < 25"))
    };
    // The picture has a wall around it: the middle of row 31 lies at 1.05 m, that of row 11 at 3.05 m.
    let before = [heat("31"), heat("11")];
    place.write("days.yaml", pipeline("[monday.csv, tuesday.csv]"));
    let mut again = ran(&place);
    again.sort();
    let expected = ["heat/ward", "visits/ward", "visits/ward/chunk-01", "walks/ward", "walks/ward/chunk-01"];
    assert_eq!(again, expected);
    let visits = |row: &str| number(&place, &format!("SELECT MAX(visits) AS n FROM 'visits/ward' WHERE row = {row}"));
    assert_eq!([visits("31"), visits("11")], [3.0, 2.0]);
    let after = [heat("31"), heat("11")];
    assert!(before[0] > before[1] && after[1] > before[1] && after[0] > 0.8 && after[1] > 0.8, "{before:?} {after:?}");

    place.write("wednesday.csv", crossings(1, 2.05));
    place.write("days.yaml", pipeline("[monday.csv, tuesday.csv, wednesday.csv]"));
    let mut again = ran(&place);
    again.sort();
    let third = expected.map(|name| name.replace("chunk-01", "chunk-02"));
    assert_eq!(again, third);
    assert!(ran(&place).is_empty());
}

#[test]
fn annotate_learns_of_who_was_seen() {
    let place = ward();
    place.write("monday.csv", crossings(8, 1.05));
    place.write("tuesday.csv", crossings(4, 1.05));
    let columns = ["--columns", "id=who,time=t,x=x,y=y"];
    let base = ["annotate", "ward/map.yaml", "--offsets", "1"];
    place.out(&[&base[..], &["--out", "plain"]].concat());
    let tracks = ["--tracks", "monday.csv", "tuesday.csv", "--tracks-unit", "m", "--out", "seen"];
    let said = place.run(&[&base[..], &columns, &tracks].concat());
    assert_eq!(said.code, Some(0), "{}", said.err);
    let facts =
        "monday.csv: 1 people, 56 positions in 143 s, 8 paths, 7 breaks; 0 positions lie in walls or off the map";
    assert!(said.err.contains(facts) && said.err.contains("the mean cell was visited"), "{}", said.err);
    let mean = |file: &str, what: &str| {
        number(
            &place,
            &format!("SELECT AVG({what}) AS n FROM '{file}/heat.parquet' WHERE row = 31 AND col > 6 AND col < 34"),
        )
    };
    let (plain, seen) = (mean("plain", "heat"), mean("seen", "heat"));
    assert!(seen > 0.85 && seen > plain + 0.1, "{plain} {seen}");
    // What was counted and who was seen lie over the map to look at.
    let view = std::fs::read_to_string(place.path("seen/view.html")).expect("it is there");
    assert!(
        ["visits, recorded", "monday.csv, 1 person", "tuesday.csv, 1 person"].iter().all(|name| view.contains(name))
    );
    // They go to the right.
    assert!(mean("seen", "flow_0") > 0.6 && mean("seen", "flow_0") > mean("plain", "flow_0"));

    let refused = |more: &[&str]| {
        let words = [&["annotate", "ward/map.yaml"], more, &["--out", "out"]].concat();
        format!("$ {}\n{}", words.join(" "), place.refused(2, &words))
    };
    place.write("empty.csv", "");
    place.write("half.sqlite", &b"SQLite format 3\0"[..]);
    place.write("out.csv", crossings(2, 9.0));
    place.write("crowd.csv", "time,pedID,posX,posY\n0.00,0,1.5,1.5\n");
    let unit = ["--columns", "id=who,time=t,x=x,y=y", "--tracks-unit", "m"];
    let with = |words: &[&'static str]| refused(&[&["--tracks"], words, &unit].concat());
    let said = [
        refused(&["--columns", "id=1,time=2,x=3,y=4"]),
        refused(&["--tracks", "monday.csv"]),
        refused(&["--tracks", "crowd.csv"]),
        refused(&[&["--tracks", "monday.csv"], &columns[..]].concat()),
        refused(&["--tracks", "monday.csv", "--columns", "id=who,t=2,x=3,y=4"]),
        refused(&["--tracks", "monday.csv", "--tracks-format", "mcap"]),
        refused(&["--tracks", "monday.csv", "--tracks-format", "csv"]),
        with(&["half.sqlite"]),
        refused(&["--tracks", "half.sqlite"]),
        with(&["nobody.csv"]),
        with(&["empty.csv"]),
        with(&["out.csv"]),
        with(&["monday.csv", "--prior", "0"]),
        with(&["monday.csv", "--by", "both"]),
        with(&["monday.csv", "--tracks-pose", "1,2"]),
    ];
    check("annotate-tracks-refused", &said.join("\n"));
    assert!(!place.path("out").exists());
}

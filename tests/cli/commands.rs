//! Each command once, on a finished store.

use super::{NODES, NUMBERS, Place, check, check_without};

#[test]
fn help_has_examples() {
    let place = Place::empty();
    check("help", &place.out(&["--help"]));
    check("help-run", &place.out(&["run", "--help"]));
    let commands = "run watch plan why status ls runs show sql diff lineage path report keep gc verify check schema init annotate simulate \
         completions";
    for command in commands.split(' ') {
        let help = place.out(&[command, "--help"]);
        assert!(help.starts_with(|c: char| c.is_ascii_uppercase()), "{help}");
        assert!(help.contains("Usage: trodden") && help.contains("--store <DIR>"), "{help}");
        let silent = ["status", "gc", "verify"].contains(&command);
        assert!(silent || help.contains("trodden ") && help.contains("Example"), "{help}");
    }
}

#[test]
fn plan_tells_hits_runs_and_what_depends() {
    let place = Place::finished();
    check("plan", &place.out(&["plan", "tiny.yaml", "--set", "labels.classes=4"]));
    check("plan-all", &place.out(&["plan", "tiny.yaml", "--set", "model.epochs=2", "--only", "model", "--all"]));
    let json = place.out(&["plan", "tiny.yaml", "--json"]);
    assert_eq!(json.lines().last(), Some(&*format!(r#"{{"depends":0,"hit":{NODES},"run":0}}"#)));
}

#[test]
fn plan_makes_no_store() {
    let place = Place::empty();
    check("plan-without-store", &place.out(&["plan", "tiny.yaml"]));
    check("why-without-store", &place.out(&["why", "labels", "tiny.yaml"]));
    place.out(&["run", "tiny.yaml", "--dry-run"]);
    assert!(!place.path("artifacts").exists());
}

#[test]
fn why_tells_what_changed() {
    let place = Place::finished();
    let sets = ["--set", "labels.classes=4"];
    check("why-before", &place.out(&[&["why", "labels", "tiny.yaml"][..], &sets].concat()));
    place.out(&[&["run", "tiny.yaml", "--quiet", "--only", "tiles"][..], &sets].concat());
    let mut told = String::new();
    for node in ["labels", "tiles", "maps/home_00", "heat"] {
        told.push_str(&place.out(&["why", node]));
    }
    check("why-after", &told);
    check("why-part", &place.out(&["why", "model/epoch-02", "tiny.yaml", "--set", "model.epochs=2"]));
    let json = place.out(&["why", "labels/home_00", "--json"]);
    assert_eq!(json.trim_end(), r#"{"node":"labels/home_00","why":["classes 3 → 4"]}"#);
}

#[test]
fn status_and_ls_list_runs_and_nodes() {
    let place = Place::finished();
    check("status", &place.out(&["status"]));
    check("ls", &place.out(&["ls"]));
    check("ls-stage", &place.out(&["ls", "walks", "--all"]));
    check("ls-runs", &place.out(&["ls", "--runs"]));
    assert_eq!(place.out(&["ls", "--all", "--json"]).lines().count() as u64, NODES);
}

#[test]
fn sql_answers_of_nodes_and_files() {
    let place = Place::finished();
    let classes = "SELECT class, COUNT(*) AS cells FROM 'labels/home_00' GROUP BY class ORDER BY class";
    check_without("sql", &place.out(&["sql", classes]), NUMBERS);
    check_without("sql-json", &place.out(&["sql", classes, "--json"]), NUMBERS);
    let files = "SELECT COUNT(*) AS rows, MAX(visits) AS most FROM 'artifacts/latest/tiny/visits/*.parquet'";
    check_without("sql-files", &place.out(&["sql", files]), NUMBERS);
    let cells = |table: &str| place.out(&["sql", &format!("SELECT COUNT(*) AS cells FROM '{table}'"), "--json"]);
    let parts = ["visits/home_00", "visits/home_01", "visits/home_1000"].map(cells);
    assert_ne!(parts[0], parts[1]);
    assert_eq!(cells("maps/home_00"), parts[0]);
}

#[test]
fn diff_names_what_changed_between_two_runs() {
    let place = Place::finished();
    let first = place.out(&["ls", "--runs", "--json"]);
    let first: serde_json::Value = serde_json::from_str(&first).expect("one run");
    let sets = ["run", "tiny.yaml", "-q", "--only", "tiles", "--set", "labels.classes=4"];
    place.out(&sets);
    let first = first["id"].as_str().expect("has an id");
    check("diff", &place.out(&["diff", first]));
    check("diff-same", &place.out(&["diff", first, first]));
}

#[test]
fn report_is_one_file() {
    let place = Place::finished();
    check("report", &place.out(&["report"]));
    assert_eq!(place.out(&["report", "latest", "--out", "page.html"]), "page.html\n");
    let page = std::fs::read_to_string(place.path("page.html")).expect("is there");
    assert!(page.starts_with("<!DOCTYPE html>") && page.contains("heat/home_1000"), "{}", &page[..200]);
}

#[test]
fn gc_shows_what_it_would_free_and_then_does() {
    let place = Place::finished();
    let sets = ["run", "tiny.yaml", "-q", "--only", "labels", "--set", "labels.classes=4"];
    check("keep", &place.out(&["keep", "latest"]));
    place.out(&sets);
    check("gc-keeps", &place.out(&["gc", "--dry-run"]));
    check("ls-kept", &place.out(&["ls", "--runs"]));
    let older = place.out(&["ls", "--runs", "--json"]);
    let older: serde_json::Value = serde_json::from_str(older.lines().last().expect("two runs")).expect("is JSON");
    check("keep-off", &place.out(&["keep", older["id"].as_str().expect("has an id"), "--off"]));
    // A run of a part does not take the place of a whole one; a whole one does.
    assert!(place.out(&["gc", "--dry-run", "--older-than", "0s"]).contains("keeps 28 files"));
    place.out(&["run", "tiny.yaml", "-q", "--set", "labels.classes=4"]);
    let objects = || std::fs::read_dir(place.path("artifacts/objects")).expect("lists").flatten();
    let count = || objects().map(|folder| std::fs::read_dir(folder.path()).expect("lists").count()).sum::<usize>();
    let before = count();
    check("gc-young", &place.out(&["gc", "--dry-run"]));
    check("gc-dry", &place.out(&["gc", "--dry-run", "--older-than", "0s"]));
    assert_eq!(count(), before);
    check("gc", &place.out(&["gc", "--older-than", "0s"]));
    assert!(count() < before);
    check("gc-again", &place.out(&["gc", "--older-than", "0s"]));
    check("verify-after-gc", &place.out(&["verify"]));
}

#[test]
fn old_runs_are_removed_when_asked_for() {
    let place = Place::finished();
    place.out(&["run", "tiny.yaml", "-q"]);
    place.out(&["run", "tiny.yaml", "-q", "--only", "labels"]);
    check("runs", &place.out(&["runs"]));
    check("runs-prune-dry", &place.out(&["runs", "prune", "--keep", "1", "--dry-run"]));
    check("runs-prune", &place.out(&["runs", "prune", "--keep", "1"]));
    assert_eq!(place.out(&["runs"]).lines().count(), 3);
    check("refused-prune", &place.refused(2, &["runs", "prune"]));
    check("refused-age", &place.refused(2, &["gc", "--older-than", "1 month"]));
}

#[test]
fn check_counts_maps_and_nodes() {
    let place = Place::empty();
    check("check", &place.out(&["check", "tiny.yaml"]));
    assert_eq!(place.out(&["check", "tiny.yaml", "--json"]), "{\"maps\":3,\"nodes\":18,\"pipeline\":\"tiny\"}\n");
    assert!(!place.path("artifacts").exists());
}

#[test]
fn schema_describes_every_stage() {
    let place = Place::empty();
    let schema: serde_json::Value = serde_json::from_str(&place.out(&["schema"])).expect("is JSON");
    assert_eq!(schema["$schema"], "http://json-schema.org/draft-07/schema#");
    let names: Vec<&str> = schema["definitions"].as_object().expect("has them").keys().map(String::as_str).collect();
    check("schema", &names.join("\n"));
}

#[test]
fn init_writes_a_pipeline_that_is_fine() {
    let place = Place::empty();
    check("init", &place.out(&["init", "mine.yaml"]));
    // What follows the comment is the quickstart, which may change.
    let written = std::fs::read_to_string(place.path("mine.yaml")).expect("is there");
    let (comment, body) = written.split_once("\nseed:").expect("has a seed");
    check("init-file", comment);
    assert!(include_str!("../../pipelines/quickstart.yaml").ends_with(&format!("\nseed:{body}")), "{body}");
    assert!(place.out(&["check", "mine.yaml"]).starts_with("`mine` is fine: "));
    check("init-again", &place.refused(2, &["init", "mine.yaml"]));
}

#[test]
fn annotate_takes_a_map_of_your_own() {
    let place = Place::finished();
    // A room of 6 m × 4 m with a wall across that leaves a door.
    let mut pixels = vec![254u8; 60 * 40];
    for (at, pixel) in pixels.iter_mut().enumerate() {
        let (row, col) = (at / 60, at % 60);
        if row == 0 || row == 39 || col == 0 || col == 59 || (col == 30 && !(10..20).contains(&row)) {
            *pixel = 0;
        }
    }
    place.write("room.pgm", [b"P5\n60 40\n255\n", &pixels[..]].concat());
    let words = ["annotate", "room.pgm", "--image-resolution", "0.1", "--model", "artifacts/latest/tiny/model"];
    check("annotate", &place.out(&[&words[..], &["--out", "out"]].concat()));
    let told = place.out(&["sql", "SELECT COUNT(*) AS cells, MIN(heat) AS least FROM 'out/heat.parquet'"]);
    check_without("annotate-sql", &told, NUMBERS);
    let png = std::fs::read(place.path("out/heat.png")).expect("is there");
    assert!(png.starts_with(b"\x89PNG") && png.len() > 1000);

    // By itself and in half precision the network says nearly the same.
    check("export-model", &place.out(&["export", "model", "artifacts/latest/tiny/model", "--out", "small"]));
    place.out(&["annotate", "room.pgm", "--image-resolution", "0.1", "--model", "small", "--out", "half"]);
    let apart = "SELECT MAX(ABS(a.heat - b.heat)) AS apart FROM 'out/heat.parquet' AS a \
                 JOIN 'half/heat.parquet' AS b ON a.row = b.row AND a.col = b.col";
    let told: serde_json::Value = serde_json::from_str(&place.out(&["sql", "--json", apart])).expect("is JSON");
    assert!(told["apart"].as_f64().expect("a number") < 0.01, "{told}");
    assert!(place.refused(2, &["export", "model", "small", "--out", "small"]).contains("would overwrite its source"));
    assert!(place.refused(2, &["export", "model", "out", "--out", "x"]).contains("is no folder of a checkpoint"));
}

/// The model that the program brings needs no pipeline: a corridor that leads to a room is visited more than the corners.
#[test]
fn annotate_needs_no_model() {
    let place = Place::empty();
    // A corridor of 12 m × 2 m along the upper edge, two rooms below it, each with a door of 1 m.
    let free = |row: usize, col: usize| {
        let corridor = (1..21).contains(&row) && (1..119).contains(&col);
        let room = (22..69).contains(&row) && ((1..59).contains(&col) || (60..119).contains(&col));
        let door = row == 21 && ((25..35).contains(&col) || (85..95).contains(&col));
        corridor || room || door
    };
    let pixels: Vec<u8> = (0..70 * 120).map(|at| if free(at / 120, at % 120) { 254 } else { 0 }).collect();
    place.write("flat.pgm", [b"P5\n120 70\n255\n", &pixels[..]].concat());
    place.out(&["annotate", "flat.pgm", "--image-resolution", "0.1", "--out", "out"]);
    let mean = |what: &str| {
        let query = format!("SELECT AVG(heat) AS heat FROM 'out/heat.parquet' WHERE free AND {what}");
        let told: serde_json::Value = serde_json::from_str(&place.out(&["sql", "--json", &query])).expect("is JSON");
        told["heat"].as_f64().expect("a number")
    };
    let door = mean("row = 21");
    let middle = mean("row BETWEEN 8 AND 13 AND col BETWEEN 35 AND 84");
    let corners = mean("row BETWEEN 62 AND 68 AND (col < 8 OR col > 111)");
    assert!(door > 0.75 && middle > 0.6 && corners < 0.3, "{door} {middle} {corners}");
}

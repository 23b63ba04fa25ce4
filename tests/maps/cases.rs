//! Small inputs of the shapes that people report trouble with, each with its right value; each has a generated twin among
//! the unit tests of `domain::map` or the tests of the command.

use std::path::Path;

use trodden::domain::map::{ImportConfig, Imported, Region};
use trodden::pipeline::stage::StageError;
use trodden::stages::import_map::ImportMap;
use trodden::stages::map_origin::Origin;

use crate::needs::Need;

fn import(path: &Path, config: &ImportConfig) -> Result<(String, Imported), StageError> {
    let import = ImportMap::new(Origin::of(path, config)?, config.clone())?;
    Ok((import.origin().map_name(), import.import()?))
}

fn plain(resolution: f64) -> ImportConfig {
    ImportConfig { image_resolution: Some(resolution), ..ImportConfig::default() }
}

/// Imports a case that must be a map; returns its name, free cells and what is said of it.
fn read(cases: &Path, path: &str, config: &ImportConfig) -> (String, usize, String) {
    let (name, imported) = import(&cases.join(path), config).unwrap_or_else(|error| panic!("{path}: {error}"));
    let (cells, said) = (imported.map.free_cells(), imported.survey.to_string());
    println!("{path}: {name}, {cells} cells; {said}");
    (name, cells, said)
}

#[test]
fn maps_have_the_right_cells() {
    let Some(cases) = Need::Cases.folder() else { return };
    let cells = |path: &str, config: &ImportConfig| read(&cases, path, config).1;
    let usual = ImportConfig::default();
    for resolution in ["0.1", "0.10000000149011612"] {
        assert_eq!(cells(&format!("f32-office-{resolution}/map.yaml"), &usual), 234_454);
    }
    assert_eq!(cells("plain-205-room/plan.png", &plain(0.1)), 3140);
    assert!(cells("thin-u128-1px-002/map.yaml", &usual).abs_diff(1482) <= 15);
    let all = ImportConfig { region: Region::All, ..ImportConfig::default() };
    assert!(cells("thin-u128-1px-002/map.yaml", &all).abs_diff(2964) <= 60);
    assert_eq!(cells("two-floors-equal/map.yaml", &all), 2 * cells("two-floors-equal/map.yaml", &usual));
    // These are one map in several spellings.
    let same = cells("negate-q0q/map.yaml", &usual);
    for path in ["mode-Trinary/map.yaml", "pgm-comment-nospace/map.yaml", "thr-equal-01/map.yaml"] {
        assert_eq!(cells(path, &usual), same, "{path}");
    }
    // The same with ten by eight cells of unknown space in the room, which JPEG has rippled.
    assert!(cells("jpg-unknown-f025-q75/map.yaml", &usual).abs_diff(same - 80) <= 5);
}

#[test]
fn what_is_left_out_is_said() {
    let Some(cases) = Need::Cases.folder() else { return };
    let (_, _, said) = read(&cases, "plan-on-white-paper/plan.png", &plain(0.05));
    assert!(said.contains("around the building as outdoors"), "{said}");
    let (_, _, said) = read(&cases, "two-floors-equal/map.yaml", &ImportConfig::default());
    assert!(said.contains("(50.0 %), the largest of 2 regions"), "{said}");
}

#[test]
fn scenes_are_named_after_their_folders() {
    let Some(cases) = Need::Cases.folder() else { return };
    for scenes in ["ig-v2-layout", "ig-only-floor1"] {
        let (name, cells, _) = read(&cases, &format!("{scenes}/Scene_0_int"), &ImportConfig::default());
        assert!(name == "Scene_0_int" && cells > 100, "{name}: {cells} cells");
    }
    let first = ImportConfig { floor: Some(1), ..ImportConfig::default() };
    assert_eq!(read(&cases, "ig-only-floor1/Scene_0_int", &first).0, "Scene_0_int");
    let refused = import(&cases.join("ig-v2-layout/Scene_0_int"), &first).expect_err("there is no floor 1");
    assert!(refused.to_string().contains("has no floor 1"), "{refused}");
}

#[test]
fn refusals_name_what_is_wrong_and_what_helps() {
    let Some(cases) = Need::Cases.folder() else { return };
    let check = |path: &str, says: &[&str]| match import(&cases.join(path), &ImportConfig::default()) {
        Err(StageError::Failed { message, help: Some(help), .. }) => {
            println!("{message}\n  help: {help}");
            let all = format!("{message}\n{help}");
            assert!(says.iter().all(|says| all.contains(says)), "{all}");
        }
        other => panic!("{path}: {other:?}"),
    };
    check("origin-2/map.yaml", &["map.yaml", "`origin`", "[0, 0, -nan]", "write 0"]);
    check(
        "path-home/map.yaml",
        &["map.yaml", "`image` names `~/map.pgm`", "`~` is not expanded", "write `image: map.pgm`"],
    );
    check("pgm-lfs/map.yaml", &["map.pgm", "pointer of Git LFS", "git lfs pull"]);
    check("ref-gimp-black-on-transparent0/map.yaml", &["map.png", "transparent", "white ground"]);
}

//! What kind of map lies at a path, and what it is called.

use std::io::Read;
use std::path::{Path, PathBuf};

use crate::domain::map::{
    ImportConfig, MapForm, MapYaml, PlanForm, igibson_floor, igibson_image, is_dxf, is_image, is_svg, is_wkt,
};
use crate::pipeline::stage::StageError;
use crate::store::open_regular;

/// Where a map comes from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Origin {
    /// A YAML file of ROS `map_server`; it names its image.
    Ros(PathBuf),
    /// An image without a description.
    Image(PathBuf),
    /// A floor of an iGibson scene.
    Igibson {
        /// The folder that the scene is named after.
        scene: PathBuf,
        /// The picture of traversable space.
        image: PathBuf,
        /// Number of the floor.
        floor: u32,
        /// Whether one gets this floor without asking for it.
        usual: bool,
    },
    /// A floor plan of areas, walls and doors.
    Plan {
        /// The file.
        file: PathBuf,
        /// What kind of file it is.
        form: PlanForm,
        /// The level that is asked for.
        level: Option<String>,
    },
}

impl Origin {
    /// Tells what a path is: a folder is an iGibson scene, a text that names an image a ROS map, one that begins as a floor
    /// plan that, all else an image.
    ///
    /// Content counts more than the ending of a name.
    ///
    /// # Errors
    /// [`StageError`] if nothing can be read there, or if a folder is no scene or lacks the floor that `config` asks for.
    pub fn of(path: &Path, config: &ImportConfig) -> Result<Self, StageError> {
        let unreadable = |source| StageError::Source { path: path.to_owned(), source };
        if path.is_dir() {
            return scene(path, config.floor);
        }
        let mut start = Vec::new();
        open_regular(path).and_then(|file| file.take(1 << 16).read_to_end(&mut start)).map_err(unreadable)?;
        let plain = config.pixel().is_some() || config.threshold.is_some() || config.negate.is_some();
        let floor = path.file_name().and_then(|name| igibson_floor(&name.to_string_lossy()));
        if let Some(floor) = floor.filter(|_| !plain) {
            if let Some(wanted) = config.floor.filter(|wanted| *wanted != floor) {
                let (message, help) =
                    (format!("`{}` is floor {floor}, not {wanted}", path.display()), "name the scene's folder");
                return Err(StageError::Failed { message, help: Some(help.to_owned()), source: None });
            }
            let folder = path.parent().unwrap_or_else(|| Path::new(""));
            return Ok(Self::Igibson { scene: scene_of(folder), image: path.to_owned(), floor, usual: true });
        }
        if let Some(form) = plan_form(path, &start) {
            return Ok(Self::Plan { file: path.to_owned(), form, level: config.level.clone() });
        }
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        let named = matches!(extension.as_deref(), Some("yaml" | "yml"));
        let described = || String::from_utf8_lossy(&start).lines().any(|line| line.trim_start().starts_with("image:"));
        if !is_image(&start) && (named || described()) {
            return Ok(Self::Ros(path.to_owned()));
        }
        Ok(Self::Image(path.to_owned()))
    }

    /// Returns the name of the map: the scene's, or the file's stem, or its folder's name where the stem is `map`; and the
    /// level of a building that was asked for.
    #[must_use]
    pub fn map_name(&self) -> String {
        let text = |part: Option<&std::ffi::OsStr>| part.map(|part| part.to_string_lossy().into_owned());
        let found = match self {
            Self::Igibson { scene, usual: true, .. } => text(whole(scene).file_name()),
            Self::Igibson { scene, floor, .. } => {
                text(whole(scene).file_name()).map(|name| format!("{name}_floor_{floor}"))
            }
            Self::Plan { file, level, .. } => text(file.file_stem()).map(|stem| {
                let stem = stem.strip_suffix(".building").unwrap_or(&stem);
                let word = |character: char| if character.is_alphanumeric() { character } else { '_' };
                let level = level.iter().map(|level| format!("_{}", level.chars().map(word).collect::<String>()));
                std::iter::once(stem.to_owned()).chain(level).collect()
            }),
            Self::Ros(file) | Self::Image(file) => match text(file.file_stem()) {
                Some(stem) if stem == "map" => text(whole(file).parent().and_then(Path::file_name)).or(Some(stem)),
                stem => stem,
            },
        };
        found.unwrap_or_else(|| "map".to_owned())
    }

    /// Returns which of the forms it has.
    #[must_use]
    pub const fn form(&self) -> MapForm {
        match self {
            Self::Plan { form, .. } => MapForm::Plan(*form),
            Self::Ros(_) => MapForm::Ros,
            Self::Image(_) => MapForm::Image,
            Self::Igibson { .. } => MapForm::Igibson,
        }
    }

    /// Returns the file that a user would look at when something is wrong.
    #[must_use]
    pub fn path(&self) -> &Path {
        match self {
            Self::Ros(path) | Self::Image(path) | Self::Plan { file: path, .. } => path,
            Self::Igibson { image, .. } => image,
        }
    }
}

/// Tells which kind of floor plan a file is, if any.
fn plan_form(path: &Path, start: &[u8]) -> Option<PlanForm> {
    if is_image(start) {
        return None;
    }
    let name = path.file_name().map(|name| name.to_string_lossy().to_lowercase()).unwrap_or_default();
    let start = String::from_utf8_lossy(start);
    let ends = |ending: &str| name.ends_with(ending);
    if ends(".wkt") || is_wkt(start.trim_start_matches('\u{feff}')) {
        return Some(PlanForm::Wkt);
    }
    if ends(".dxf") || is_dxf(start.trim_start_matches('\u{feff}')) {
        return Some(PlanForm::Dxf);
    }
    if ends(".svg") || is_svg(start.trim_start_matches('\u{feff}')) {
        return Some(PlanForm::Svg);
    }
    if ends(".geojson")
        || start.trim_start_matches('\u{feff}').trim_start().starts_with('{') && start.contains("\"type\"")
    {
        return Some(PlanForm::GeoJson);
    }
    let has = |key: &str| start.lines().any(|line| line.starts_with(key));
    let building = ends(".building.yaml") || has("coordinate_system:") || has("levels:");
    (building && !has("image:")).then_some(PlanForm::Building)
}

/// Returns a path whose last part is a name.
fn whole(path: &Path) -> PathBuf {
    match std::path::absolute(path) {
        Ok(absolute) if absolute.file_name().is_some() => absolute,
        _ => path.canonicalize().unwrap_or_else(|_| path.to_owned()),
    }
}

/// Returns the folder that a scene is named after, from the one that its pictures lie in.
fn scene_of(folder: &Path) -> PathBuf {
    let folder = whole(folder);
    match folder.parent() {
        Some(parent) if folder.file_name().is_some_and(|name| name == "layout") => parent.to_owned(),
        _ => folder,
    }
}

/// Finds a floor of the scene in a folder: the one asked for, or floor 0, or the only one.
fn scene(folder: &Path, wanted: Option<u32>) -> Result<Origin, StageError> {
    let mut floors = floors(folder);
    floors.extend(self::floors(&folder.join("layout")));
    floors.sort();
    floors.dedup_by_key(|(floor, _)| *floor);
    let refused = |message: String, help: String| StageError::Failed { message, help: Some(help), source: None };
    let Some((first, _)) = floors.first().cloned() else {
        let (shown, image) = (folder.display(), igibson_image(wanted.unwrap_or(0)));
        let yaml = only_description(folder).map_or_else(String::new, |path| format!(": `{}`", path.display()));
        return Err(refused(
            format!("`{shown}` is no folder of an iGibson scene: neither it nor its folder `layout` has a `{image}`"),
            format!("for a map of ROS give its YAML file{yaml}"),
        ));
    };
    let list = || floors.iter().map(|(floor, _)| floor.to_string()).collect::<Vec<_>>().join(", ");
    let usual = if floors.len() == 1 { first } else { 0 };
    let floor = wanted.unwrap_or(usual);
    match floors.iter().find(|(number, _)| *number == floor) {
        Some((_, image)) => {
            Ok(Origin::Igibson { scene: scene_of(folder), image: image.clone(), floor, usual: floor == usual })
        }
        None => Err(refused(
            format!("the scene `{}` has no floor {floor}", folder.display()),
            format!("choose one of its floors with `floor`: {}", list()),
        )),
    }
}

/// Returns the pictures of floors in a folder, by number.
fn floors(folder: &Path) -> Vec<(u32, PathBuf)> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let floor = |entry: std::fs::DirEntry| Some((igibson_floor(&entry.file_name().to_string_lossy())?, entry.path()));
    entries.filter_map(Result::ok).filter_map(floor).collect()
}

/// Returns the YAML of the only map of ROS in a folder.
fn only_description(folder: &Path) -> Option<PathBuf> {
    let entries = std::fs::read_dir(folder).ok()?.filter_map(Result::ok).map(|entry| entry.path());
    let described = |path: &PathBuf| {
        let named = path.extension().is_some_and(|extension| extension == "yaml" || extension == "yml");
        let text = if named { crate::store::read_bounded(path, 1 << 16).ok() } else { None };
        text.is_some_and(|text| MapYaml::parse(&String::from_utf8_lossy(&text)).is_ok())
    };
    let mut found = entries.filter(described);
    found.next().filter(|_| found.next().is_none())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(files: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("creates");
        for file in files {
            let path = folder.path().join(file);
            std::fs::create_dir_all(path.parent().expect("has a folder")).expect("creates");
            let text =
                if file.ends_with("yaml") || file.ends_with("conf") { "image: m.pgm\n" } else { "P5 1 1 255\n\0" };
            std::fs::write(path, text).expect("writes");
        }
        folder
    }

    fn origin(folder: &tempfile::TempDir, path: &str, floor: Option<u32>) -> Result<Origin, StageError> {
        Origin::of(&folder.path().join(path), &ImportConfig { floor, ..ImportConfig::default() })
    }

    #[test]
    fn content_tells_more_than_a_name() {
        let folder = place(&["a.yaml", "b.conf", "c.png", "map.pgm", "d"]);
        std::fs::write(folder.path().join("picture.yaml"), b"P5 1 1 255\n\0").expect("writes");
        let form = |path| origin(&folder, path, None).expect("reads").form();
        assert_eq!([form("a.yaml"), form("b.conf")], [MapForm::Ros; 2]);
        assert_eq!([form("c.png"), form("d"), form("picture.yaml")], [MapForm::Image; 3]);
        assert!(matches!(origin(&folder, "nowhere.yaml", None), Err(StageError::Source { .. })));
        assert!(matches!(Origin::of(Path::new("/dev/zero"), &ImportConfig::default()), Err(StageError::Source { .. })));
    }

    #[test]
    fn a_map_is_named_after_its_file_or_folder() {
        let folder = place(&["ward/map.pgm", "ward/plan.pgm", "map/map.yaml"]);
        let name = |path| origin(&folder, path, None).expect("reads").map_name();
        assert_eq!([name("ward/map.pgm"), name("ward/plan.pgm"), name("map/map.yaml")], ["ward", "plan", "map"]);
    }

    #[test]
    fn plans_are_told_by_what_they_say() {
        let folder = place(&[]);
        let check = |file: &str, text: &str, expected: MapForm, name: &str| {
            std::fs::write(folder.path().join(file), text).expect("writes");
            let found = origin(&folder, file, None).expect("reads");
            assert_eq!((found.form(), found.map_name().as_str()), (expected, name), "{file}: {text}");
        };
        let building = MapForm::Plan(PlanForm::Building);
        check("ward.building.yaml", "", building, "ward");
        check("ward.yaml", "name: x\nlevels:\n", building, "ward");
        check("ward", "coordinate_system: reference_image\n", building, "ward");
        check("hall.wkt", "", MapForm::Plan(PlanForm::Wkt), "hall");
        check("hall.txt", "geometrycollection (polygon", MapForm::Plan(PlanForm::Wkt), "hall");
        check("hall.dxf", "", MapForm::Plan(PlanForm::Dxf), "hall");
        check("hall.txt", "  0\nSECTION\n", MapForm::Plan(PlanForm::Dxf), "hall");
        check("hall.geojson", "", MapForm::Plan(PlanForm::GeoJson), "hall");
        check("hall.json", "\n{\"type\": \"Polygon\"", MapForm::Plan(PlanForm::GeoJson), "hall");
        check("ros.yaml", "image: a.pgm\nlevels: 3\n", MapForm::Ros, "ros");
        let config = ImportConfig { level: Some("L 1/2".to_owned()), ..ImportConfig::default() };
        let found = Origin::of(&folder.path().join("ward.building.yaml"), &config).expect("reads");
        assert_eq!(found.map_name(), "ward_L_1_2");
    }

    #[test]
    fn scenes_have_floors_and_layouts() {
        let folder = place(&[
            "old/floor_trav_0.png",
            "old/floor_trav_1.png",
            "old/floor_trav_no_obj_2.png",
            "new/layout/floor_trav_0.png",
            "upper/floor_trav_3.png",
            "other/floor_trav_1.png",
            "other/floor_trav_2.png",
            "empty/picture.png",
        ]);
        let check = |path: &str, wanted, floor: u32, name: &str| {
            let found = origin(&folder, path, wanted).unwrap_or_else(|error| panic!("{path}: {error}"));
            assert!(matches!(&found, Origin::Igibson { floor: found, .. } if *found == floor), "{found:?}");
            assert_eq!(found.map_name(), name);
        };
        check("old", None, 0, "old");
        check("old", Some(0), 0, "old");
        check("old", Some(1), 1, "old_floor_1");
        check("new", None, 0, "new");
        check("new/layout", None, 0, "new");
        check("new/layout/floor_trav_0.png", None, 0, "new");
        check("new/../new/", None, 0, "new");
        check("upper", None, 3, "upper");
        check("upper", Some(3), 3, "upper");
        check("other", Some(2), 2, "other_floor_2");
        let refused = |path: &str, wanted, says: &str| match origin(&folder, path, wanted) {
            Err(StageError::Failed { message, help: Some(help), .. }) => {
                assert!(format!("{message}; {help}").contains(says), "{message}; {help}");
            }
            other => panic!("{other:?}"),
        };
        refused("old", Some(2), "has no floor 2; choose one of its floors with `floor`: 0, 1");
        refused("other", None, "has no floor 0; choose one of its floors with `floor`: 1, 2");
        refused("empty", None, "neither it nor its folder `layout` has a `floor_trav_0.png`");
    }
}

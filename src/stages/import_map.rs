//! `import-map`: the maps of others.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::map_origin::Origin;
use super::{kind, plan_advice, write};
use crate::domain::map::{
    ImportConfig, Imported, MapForm, MapImportError, MapYaml, OccupancyMap, PlanForm, Unit, import_igibson,
    import_image, import_plan, import_ros, plan_cells,
};
use crate::pipeline::stage::{Context, Inputs, Needs, Output, Part, Source, Stage, StageError, StageSpec};
use crate::store::{Store, read_bounded};

/// The most bytes of an image: 16 bits in each of four channels, and as much again for what else is in such a file.
const MOST_IMAGE: u64 = 16 * crate::domain::map::MOST_PIXELS;
/// The most bytes of a YAML.
const MOST_YAML: u64 = 1 << 20;
/// The most bytes of a floor plan.
const MOST_PLAN: u64 = 1 << 26;

/// What is the same for every imported map.
pub fn spec() -> StageSpec {
    StageSpec::new(
        "import-map",
        3,
        vec![],
        kind::<OccupancyMap>(),
        "Reads a map of ROS `map_server`, a plain image, an iGibson scene or a floor plan, and makes cells of it.",
    )
}

/// One map to import.
#[derive(Debug, Clone)]
pub struct ImportMap {
    origin: Origin,
    config: ImportConfig,
}

impl ImportMap {
    /// Joins a place with the way to read it.
    ///
    /// # Errors
    /// [`StageError`] if a file is missing or no regular one, or if the YAML is not a map's.
    pub fn new(origin: Origin, config: ImportConfig) -> Result<Self, StageError> {
        let import = Self { origin, config };
        import.config.check().map_err(|error| import.failed(error))?;
        if let Origin::Plan { file, form, .. } = &import.origin {
            let cells = plan_cells(*form, &bytes(file, MOST_PLAN)?, &import.config);
            return cells.map_err(|error| import.failed(error)).map(|_| import);
        }
        if matches!(import.origin, Origin::Image(_)) && import.config.pixel().is_none() {
            return Err(import.failed(MapImportError::ImageResolution));
        }
        let yaml = match &import.origin {
            Origin::Ros(file) => Some((file, import.yaml(file)?)),
            _ => None,
        };
        let image = import.image(yaml.as_ref().map(|(_, yaml)| yaml));
        if let Err(source) = crate::store::open_regular(&image) {
            return Err(match yaml {
                Some((file, yaml)) => image_missing(file, &yaml.image, &image, source),
                None => StageError::Source { path: image, source },
            });
        }
        Ok(import)
    }

    /// Returns where the map comes from.
    #[must_use]
    pub const fn origin(&self) -> &Origin {
        &self.origin
    }

    /// Reads the map.
    ///
    /// # Errors
    /// [`StageError`] if a file cannot be read or is not what it should be.
    pub fn import(&self) -> Result<Imported, StageError> {
        if let Origin::Plan { file, form, .. } = &self.origin {
            let imported = import_plan(*form, &bytes(file, MOST_PLAN)?, &self.config);
            return imported.map_err(|error| self.failed(error));
        }
        let yaml = match &self.origin {
            Origin::Ros(file) => Some(self.yaml(file)?),
            _ => None,
        };
        let image = self.image(yaml.as_ref());
        let bytes = bytes(&image, MOST_IMAGE)?;
        let map = match (&self.origin, &yaml) {
            (Origin::Ros(_), Some(yaml)) => import_ros(yaml, &bytes, &self.config),
            (Origin::Igibson { .. }, _) => import_igibson(&bytes, &self.config),
            _ => import_image(&bytes, &self.config),
        };
        map.map_err(|error| if is_image(&error) { failed(&image, error) } else { self.failed(error) })
    }

    fn yaml(&self, file: &Path) -> Result<MapYaml, StageError> {
        let text = bytes(file, MOST_YAML)?;
        let text = String::from_utf8_lossy(&text);
        MapYaml::parse(text.trim_start_matches('\u{feff}')).map_err(|error| self.failed(error))
    }

    fn image(&self, yaml: Option<&MapYaml>) -> PathBuf {
        match (&self.origin, yaml) {
            (Origin::Ros(file), Some(yaml)) => file.parent().unwrap_or_else(|| Path::new("")).join(&yaml.image),
            (Origin::Igibson { image, .. }, _) => image.clone(),
            (Origin::Ros(path) | Origin::Image(path) | Origin::Plan { file: path, .. }, _) => path.clone(),
        }
    }

    /// Returns the bytes that a floor plan takes: its points, and regions of at most as many cells as its grid has.
    fn plan_memory(&self, path: &Path) -> u64 {
        let MapForm::Plan(form) = self.origin.form() else { return 0 };
        let Ok(bytes) = bytes(path, MOST_PLAN) else { return 0 };
        let cells = plan_cells(form, &bytes, &self.config).unwrap_or(0);
        cells.saturating_mul(20) + 50 * bytes.len() as u64
    }

    fn plan_parameters(&self, form: PlanForm) -> Value {
        let thickness = self.config.wall_thickness.unwrap_or(ImportConfig::WALL_THICKNESS);
        match form {
            PlanForm::Building => {
                json!({ "source": form.name(), "level": self.config.level, "wall_thickness": thickness })
            }
            PlanForm::Dxf => {
                let ImportConfig { unit, walls, doors, .. } = &self.config;
                json!({ "source": form.name(), "unit": unit, "walls": walls, "doors": doors, "wall_thickness": thickness })
            }
            PlanForm::Svg => {
                let ImportConfig { unit, scale, image_resolution, walls, doors, wall_thickness, .. } = &self.config;
                json!({
                    "source": form.name(),
                    "unit": unit,
                    "scale": scale,
                    "image_resolution": image_resolution,
                    "walls": walls,
                    "doors": doors,
                    "wall_thickness": wall_thickness,
                })
            }
            PlanForm::Wkt | PlanForm::GeoJson => {
                json!({ "source": form.name(), "unit": self.config.unit.unwrap_or(Unit::Meter) })
            }
        }
    }

    fn failed(&self, error: MapImportError) -> StageError {
        let narrow = matches!(error, MapImportError::Map(_) | MapImportError::TooSmall { .. });
        match &self.origin {
            Origin::Plan { file, .. } if narrow => advised(file, error, Some(plan_advice::NARROW.to_owned())),
            origin => failed(origin.path(), error),
        }
    }
}

/// Names the file in what the domain has to say, and what helps.
fn failed(path: &Path, error: MapImportError) -> StageError {
    let help = help(&error);
    advised(path, error, help)
}

fn advised(path: &Path, error: MapImportError, help: Option<String>) -> StageError {
    StageError::Failed { message: format!("{}: {error}", path.display()), help, source: Some(Box::new(error)) }
}

/// Says what helps.
#[must_use]
pub fn help(error: &MapImportError) -> Option<String> {
    let advice = match error {
        MapImportError::Plan(error) => plan_advice::help(error)?,
        MapImportError::ImageResolution => {
            "write `files: { paths: [...], image_resolution: 0.05 }`, or `--image-resolution 0.05`; or, by two points in pixels and \
             their distance, `scale: \"120,80:620,80=12.5m\"`, or `--scale 120,80:620,80=12.5m`"
        }
        MapImportError::TwoScales => "leave one of them out",
        MapImportError::ScaleOutside { .. } => "count pixels from the upper left corner, to the right and down",
        MapImportError::Map(_) => "check thresholds and `negate`: free space must be brighter than walls",
        MapImportError::TooManyPixels { .. } => "scale the image down first",
        MapImportError::ImageCutShort
        | MapImportError::Image { .. }
        | MapImportError::Pnm(_)
        | MapImportError::Decoder(_)
        | MapImportError::Empty => "the file is damaged: fetch or export it again",
        MapImportError::LfsPointer { .. } => "fetch the file itself: `git lfs pull` in its repository",
        MapImportError::ImageFormat => "convert it to PNG first",
        MapImportError::Thresholds { .. } => "raise `occupied_thresh` or lower `free_thresh`",
        MapImportError::Transparent { .. } => "put the picture on a white ground first, without an alpha channel",
        MapImportError::TooSmall { .. } => {
            "check the resolution, thresholds and `negate`, or name another region: `region: all`, or \
             `region: [x, y]` in meters (`--region`)"
        }
        MapImportError::NoRegion { .. } => "coordinates are meters in the frame of the map, where its `origin` is set",
        MapImportError::Field { field: "origin", found, .. } if found.to_lowercase().contains("nan") => {
            "write 0 for what is no number: a yaw of 0 keeps the map as it is drawn"
        }
        MapImportError::Field { field: "origin", .. } => {
            "write x and y of the lower left corner in meters and the yaw in radians: `origin: [0.0, 0.0, 0.0]`"
        }
        MapImportError::Unfit { form, .. } => match form {
            MapForm::Ros => {
                "leave it out: the YAML says it; `occupied_thresh`, `free_thresh` and `negate` replace what it says"
            }
            MapForm::Image => "leave it out: plain images take `image_resolution`, `scale`, `threshold` and `negate`",
            MapForm::Igibson => "leave it out: scenes take `floor`; what is white in their pictures is free",
            MapForm::Plan(form) => plan_advice::unfit(*form),
        },
        _ => return None,
    };
    Some(advice.to_owned())
}

/// Says which YAML names an image that is not there, and what is wrong with the name.
fn image_missing(yaml: &Path, named: &str, image: &Path, source: std::io::Error) -> StageError {
    let folder = yaml.parent().unwrap_or_else(|| Path::new(""));
    let last = named.rsplit(['/', '\\']).next().unwrap_or_default();
    let near = std::iter::once(PathBuf::from(last)).chain(
        ["pgm", "png", "jpg", "jpeg", "bmp", "tif", "tiff"].map(|ending| Path::new(last).with_extension(ending)),
    );
    let near = near.filter(|name| name.file_name().is_some()).find(|name| folder.join(name).is_file());
    let shell = |start: &str| named.starts_with(start);
    let why = if shell("~") {
        "`~` is not expanded in a map's YAML"
    } else if shell("package://") || shell("file://") || shell("model://") {
        "a URL is not looked up"
    } else if named.contains("$(") || shell("$") {
        "substitutions of launch files are not expanded in a map's YAML"
    } else if named.contains('\\') {
        "write `/` instead of `\\`"
    } else {
        "the path starts at the folder of the YAML"
    };
    let remedy = match near {
        Some(near) => format!("write `image: {}`, which lies beside the YAML", near.display()),
        None => "write the path of the image, relative to the folder of the YAML or absolute".to_owned(),
    };
    StageError::Failed {
        message: format!(
            "{}: `image` names `{named}`, but `{}` cannot be read: {source}",
            yaml.display(),
            image.display()
        ),
        help: Some(format!("{why}: {remedy}")),
        source: Some(Box::new(source)),
    }
}

/// Tells whether the image is to blame, not the YAML that names it.
const fn is_image(error: &MapImportError) -> bool {
    use MapImportError::{
        Decoder, Empty, Image, ImageCutShort, ImageFormat, LfsPointer, Pnm, TooManyPixels, Transparent,
    };
    matches!(
        error,
        Image { .. }
            | ImageCutShort
            | ImageFormat
            | TooManyPixels { .. }
            | Decoder(_)
            | Empty
            | LfsPointer { .. }
            | Pnm(_)
            | Transparent { .. }
    )
}

/// Returns the number of pixels that the header of an image tells of, at least one for each byte of the file.
fn pixels(path: &Path) -> u64 {
    let Ok(file) = crate::store::open_regular(path) else { return 0 };
    let bytes = file.metadata().map_or(0, |metadata| metadata.len());
    let reader = image::ImageReader::new(std::io::BufReader::new(file)).with_guessed_format().ok();
    let size = reader.and_then(|reader| reader.into_dimensions().ok());
    size.map_or(0, |(width, height)| u64::from(width) * u64::from(height)).max(bytes)
}

fn bytes(path: &Path, limit: u64) -> Result<Vec<u8>, StageError> {
    read_bounded(path, limit).map_err(|source| StageError::Source { path: path.to_owned(), source })
}

impl Stage for ImportMap {
    /// Only what has a meaning for this form of map, so that the rest changes no key.
    fn parameters(&self) -> Value {
        let ImportConfig { resolution, region, .. } = &self.config;
        let mut value = json!({ "resolution": resolution, "region": region });
        let more = match self.origin.form() {
            MapForm::Ros => json!({
                "source": "ros",
                "occupied_thresh": self.config.occupied_thresh,
                "free_thresh": self.config.free_thresh,
                "negate": self.config.negate,
            }),
            MapForm::Image => json!({
                "source": "image",
                "image_resolution": self.config.image_resolution,
                "threshold": self.config.threshold.unwrap_or(ImportConfig::THRESHOLD),
                "negate": self.config.negate.unwrap_or(false),
            }),
            MapForm::Igibson => json!({ "source": "igibson" }),
            MapForm::Plan(form) => self.plan_parameters(form),
        };
        let object = value.as_object_mut().expect("made as an object");
        object.extend(more.as_object().expect("made as an object").clone());
        // Where it is not given, recipes are those from before there was one.
        if let (MapForm::Image, Some(scale)) = (self.origin.form(), self.config.scale) {
            object.insert("scale".to_owned(), json!(scale));
        }
        value
    }

    fn sources(&self) -> Result<Vec<Source>, StageError> {
        let source = |role: &str, path: PathBuf| Source { role: role.to_owned(), path };
        Ok(match &self.origin {
            Origin::Ros(file) => {
                let yaml = self.yaml(file)?;
                vec![source("yaml", file.clone()), source("image", self.image(Some(&yaml)))]
            }
            Origin::Plan { file, .. } => vec![source("plan", file.clone())],
            _ => vec![source("image", self.image(None))],
        })
    }

    fn needs(&self, _: Part, inputs: &Inputs, _: &Store) -> Needs {
        if let Some((path, _)) = inputs.sources.get("plan") {
            return super::memory(self.plan_memory(path));
        }
        // Up to eight bytes as it is decoded, the file itself, what the pixels say, and regions of at most as many cells.
        let pixels = inputs.sources.get("image").map_or(0, |(path, _)| pixels(path));
        super::memory(pixels.saturating_mul(20))
    }

    fn run(&self, _: Part, _: &Inputs, context: &Context) -> Result<Output, StageError> {
        let Imported { map, survey, reading } = self.import()?;
        reading.doubts.into_iter().for_each(|doubt| (context.warn)(doubt));
        if survey.is_odd() || survey.share() < 1.0 {
            let advice = if survey.is_odd() { "; `region: all` or `region: [x, y]` keeps others" } else { "" };
            (context.warn)(format!("{survey}{advice}"));
        }
        write(context, &map)
    }
}

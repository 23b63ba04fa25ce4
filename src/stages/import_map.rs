//! `import-map`: the maps of others.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::{kind, write};
use crate::domain::map::{
    IGIBSON_IMAGE, ImportConfig, MapImportError, MapYaml, OccupancyMap, import_igibson, import_image, import_ros,
};
use crate::pipeline::stage::{Context, Inputs, Needs, Output, Part, Source, Stage, StageError, StageSpec};
use crate::store::Store;

/// What is the same for every imported map.
pub const SPEC: StageSpec = StageSpec {
    name: "import-map",
    version: 1,
    ports: &[],
    output: kind::<OccupancyMap>(),
    seeded: false,
    doc: "Reads a map of ROS `map_server`, a plain image or an iGibson scene, and resamples it.",
};

/// Where a map comes from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Origin {
    /// A YAML file of ROS `map_server`; it names its image.
    Ros(PathBuf),
    /// An image without a description.
    Image(PathBuf),
    /// The folder of an iGibson scene.
    Igibson(PathBuf),
}

impl Origin {
    /// Tells by its name and content what a path is: a folder is an iGibson scene, a YAML file a ROS map, all else an image.
    #[must_use]
    pub fn of(path: &Path) -> Self {
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        if path.is_dir() {
            return Self::Igibson(path.to_owned());
        }
        match extension.as_deref() {
            Some("yaml" | "yml") => Self::Ros(path.to_owned()),
            _ => Self::Image(path.to_owned()),
        }
    }

    /// Returns the name of the map: the file's stem, or its folder's name where the stem is `map`.
    #[must_use]
    pub fn map_name(&self) -> String {
        let name = |part: Option<&std::ffi::OsStr>| part.map(|part| part.to_string_lossy().into_owned());
        let found = match self {
            Self::Igibson(folder) => name(folder.file_name()),
            Self::Ros(file) | Self::Image(file) => match name(file.file_stem()) {
                Some(stem) if stem == "map" => {
                    let folder = std::path::absolute(file).ok();
                    name(folder.as_deref().and_then(Path::parent).and_then(Path::file_name)).or(Some(stem))
                }
                stem => stem,
            },
        };
        found.unwrap_or_else(|| "map".to_owned())
    }

    const fn name(&self) -> &'static str {
        match self {
            Self::Ros(_) => "ros",
            Self::Image(_) => "image",
            Self::Igibson(_) => "igibson",
        }
    }

    /// The file that a user would look at when something is wrong.
    fn path(&self) -> &Path {
        match self {
            Self::Ros(path) | Self::Image(path) | Self::Igibson(path) => path,
        }
    }
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
    /// [`StageError`] if a file is missing or the YAML is not a map's.
    pub fn new(origin: Origin, config: ImportConfig) -> Result<Self, StageError> {
        let import = Self { origin, config };
        import.config.check().map_err(|error| import.failed(error))?;
        if matches!(import.origin, Origin::Image(_)) && import.config.image_resolution.is_none() {
            return Err(import.failed(MapImportError::ImageResolution));
        }
        for source in import.sources()? {
            if let Err(error) = std::fs::metadata(&source.path) {
                return Err(StageError::Source { path: source.path, source: error });
            }
        }
        Ok(import)
    }

    /// Reads the map.
    ///
    /// # Errors
    /// [`StageError`] if a file cannot be read or is not what it should be.
    pub fn import(&self) -> Result<OccupancyMap, StageError> {
        let map = match &self.origin {
            Origin::Ros(file) => {
                let yaml = self.yaml(file)?;
                let image = image_of(file, &yaml);
                let map = import_ros(&yaml, &bytes(&image)?, &self.config);
                return map.map_err(|error| if is_image(&error) { failed(&image, error) } else { failed(file, error) });
            }
            Origin::Image(file) => import_image(&bytes(file)?, &self.config),
            Origin::Igibson(folder) => import_igibson(&bytes(&folder.join(IGIBSON_IMAGE))?, &self.config),
        };
        map.map_err(|error| self.failed(error))
    }

    fn yaml(&self, file: &Path) -> Result<MapYaml, StageError> {
        let text = bytes(file)?;
        let text = String::from_utf8_lossy(&text);
        MapYaml::parse(&text).map_err(|error| self.failed(error))
    }

    fn failed(&self, error: MapImportError) -> StageError {
        failed(self.origin.path(), error)
    }
}

/// Names the file in what the domain has to say, and what helps.
fn failed(path: &Path, error: MapImportError) -> StageError {
    let message = format!("{}: {error}", path.display());
    let help = match &error {
        MapImportError::ImageResolution => {
            Some("write `files: { paths: [...], image_resolution: 0.05 }`, or `--image-resolution 0.05`")
        }
        MapImportError::Map(_) => Some("check thresholds and `negate`: free space must be brighter than walls"),
        MapImportError::TooManyPixels { .. } => Some("scale the image down first"),
        MapImportError::ImageCutShort | MapImportError::Image { .. } => {
            Some("the file is damaged: fetch or export it again")
        }
        MapImportError::ImageFormat => Some("convert it to PNG first"),
        MapImportError::Thresholds { .. } => Some("raise `occupied_thresh` or lower `free_thresh`"),
        _ => None,
    };
    StageError::Failed { message, help: help.map(str::to_owned), source: Some(Box::new(error)) }
}

/// Tells whether the image is to blame, not the YAML that names it.
const fn is_image(error: &MapImportError) -> bool {
    use MapImportError::{Image, ImageCutShort, ImageFormat, TooManyPixels};
    matches!(error, Image { .. } | ImageCutShort | ImageFormat | TooManyPixels { .. })
}

fn image_of(yaml_file: &Path, yaml: &MapYaml) -> PathBuf {
    yaml_file.parent().unwrap_or_else(|| Path::new("")).join(&yaml.image)
}

/// Returns the number of pixels that the header of an image tells of, at least one for each byte of the file.
fn pixels(path: &Path) -> u64 {
    let Ok(metadata) = std::fs::metadata(path) else { return 0 };
    if !metadata.is_file() {
        return 0;
    }
    let reader = image::ImageReader::open(path).and_then(image::ImageReader::with_guessed_format).ok();
    let size = reader.and_then(|reader| reader.into_dimensions().ok());
    size.map_or(0, |(width, height)| u64::from(width) * u64::from(height)).max(metadata.len())
}

fn bytes(path: &Path) -> Result<Vec<u8>, StageError> {
    std::fs::read(path).map_err(|source| StageError::Source { path: path.to_owned(), source })
}

impl Stage for ImportMap {
    fn parameters(&self) -> Value {
        let mut value = super::to_json(&self.config);
        let object = value.as_object_mut().expect("settings are an object");
        object.insert("source".to_owned(), self.origin.name().into());
        value
    }

    fn sources(&self) -> Result<Vec<Source>, StageError> {
        let source = |role: &str, path: PathBuf| Source { role: role.to_owned(), path };
        Ok(match &self.origin {
            Origin::Ros(file) => {
                let yaml = self.yaml(file)?;
                vec![source("yaml", file.clone()), source("image", image_of(file, &yaml))]
            }
            Origin::Image(file) => vec![source("image", file.clone())],
            Origin::Igibson(folder) => vec![source("image", folder.join(IGIBSON_IMAGE))],
        })
    }

    fn needs(&self, _: Part, inputs: &Inputs, _: &Store) -> Needs {
        // Up to eight bytes as it is decoded, and its shades.
        let pixels = inputs.sources.get("image").map_or(0, |(path, _)| pixels(path));
        super::memory(pixels.saturating_mul(16))
    }

    fn run(&self, _: Part, _: &Inputs, context: &Context) -> Result<Output, StageError> {
        write(context, &self.import()?)
    }
}

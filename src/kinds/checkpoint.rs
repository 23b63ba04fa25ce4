//! `Checkpoint`: `model.safetensors`, `optimizer.safetensors`, `config.json` and `metrics.parquet`.
//!
//! Arrays are f32 under PyTorch's names and shapes, so `safetensors.torch.load_file` gives a state dict. The configuration
//! keeps whole numbers where others derive from them (cells of each class; their distribution and weights stand beside for
//! readers), so that nothing is lost in JSON's digits. The metrics have a row for every epoch so far; where other windows
//! were predicted after each, two columns more, `validation_spearman` and `validation_auc`, or of classes
//! `validation_accuracy` and `validation_mean_recall`.

use std::collections::BTreeMap;
use std::sync::Arc;

use arrow::array::{ArrayRef, Float64Array, UInt32Array, UInt64Array};
use arrow::datatypes::{DataType, Float64Type, UInt32Type, UInt64Type};
use half::f16;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};

use super::parquet::{Column, Layout, Table, wrong_value};
use super::{Kind, KindError, Written, named_file};
use crate::domain::planes::{self, Plane};
use crate::domain::quantize::{ClassCounts, FEWEST_CLASSES, MOST_CLASSES, class_weights};
use crate::domain::tiles::Target;
use crate::domain::unet::{Architecture, Array, Arrays, EpochMetrics, Fit, Outputs, TrainState, Validation};
use crate::store::{Artifact, Store};

const KIND: &str = "Checkpoint";
const METRICS: &str = "TrainingMetrics";
const FORMAT: u32 = 1;

/// A network in training after some epoch.
#[derive(Debug, Clone, PartialEq)]
pub struct Checkpoint {
    /// What the training was like.
    pub config: CheckpointConfig,
    /// The network, the optimizer, and the number of finished epochs.
    pub state: TrainState,
    /// How each epoch went, the first one first.
    pub metrics: Vec<EpochMetrics>,
}

/// What a checkpoint remembers of its training.
#[derive(Debug, Clone, PartialEq)]
pub struct CheckpointConfig {
    /// The network.
    pub network: Architecture,
    /// Edge of a training window in cells.
    pub window: u32,
    /// Samples of a batch.
    pub batch: u32,
    /// Learning rate of Adam.
    pub learning_rate: f64,
    /// What it has learned.
    pub learned: Learned,
    /// What it is shown of each cell besides whether it is free.
    pub besides: Vec<Plane>,
}

/// What a network has learned to say.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Learned {
    /// Classes, of which there were so many cells in the training windows.
    Classes(ClassCounts),
    /// Ranks.
    Ranks {
        /// Whether it has learned densities besides.
        density: bool,
        /// Whether it has learned directions of flow besides.
        flow: bool,
    },
}

impl Learned {
    /// Returns what there was to learn of a target.
    #[must_use]
    pub fn of(target: &Target) -> Self {
        match target {
            Target::Classes { classes, labels } => Self::Classes(ClassCounts::of(*classes, labels)),
            Target::Ranks { density, flow, .. } => Self::Ranks { density: density.is_some(), flow: flow.is_some() },
        }
    }

    /// Returns the cells of each class over the training windows, if classes were learned.
    #[must_use]
    pub const fn counts(&self) -> Option<&ClassCounts> {
        match self {
            Self::Classes(counts) => Some(counts),
            Self::Ranks { .. } => None,
        }
    }
}

impl CheckpointConfig {
    /// Returns what the numbers are that the network computes for a cell.
    #[must_use]
    pub fn outputs(&self) -> Outputs {
        match &self.learned {
            Learned::Classes(counts) => {
                Outputs::Classes(u8::try_from(counts.classes.len()).expect("at most 16 classes"))
            }
            Learned::Ranks { density, flow } => Outputs::Ranks { density: *density, flow: *flow },
        }
    }

    /// Returns the cells of each class over the training windows, if classes were learned.
    #[must_use]
    pub const fn counts(&self) -> Option<&ClassCounts> {
        self.learned.counts()
    }
}

/// `config.json`.
#[derive(Debug, Serialize, Deserialize)]
struct ConfigFile {
    kind: String,
    format: u32,
    epoch: u32,
    /// Older checkpoints have none: they are of the paper's network.
    #[serde(default)]
    network: Architecture,
    window: u32,
    batch: u32,
    learning_rate: f64,
    /// What it is shown besides whether cells are free.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    besides: Vec<Plane>,
    /// Where ranks were learned, in the place of all that follows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    ranks: Option<RanksFile>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    classes: Option<usize>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    cells: Option<CellCounts>,
    /// Derived from `cells`; for readers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    distribution: Option<Vec<f64>>,
    /// Derived from `cells`; for readers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    class_weights: Option<Vec<f64>>,
}

#[derive(Debug, Serialize, Deserialize)]
struct RanksFile {
    density: bool,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    flow: bool,
}

#[derive(Debug, Serialize, Deserialize)]
struct CellCounts {
    unlabeled: u64,
    obstacle: u64,
    classes: Vec<u64>,
}

impl Checkpoint {
    /// Names of the files of the bundle.
    pub const FILES: [&'static str; 4] =
        ["config.json", "metrics.parquet", "model.safetensors", "optimizer.safetensors"];

    /// Encodes the files of the bundle by name.
    ///
    /// # Errors
    /// [`KindError`] if an array or a metric does not fit.
    pub fn to_files(&self) -> Result<BTreeMap<&'static str, Vec<u8>>, KindError> {
        Ok(BTreeMap::from([
            ("config.json", config_to_bytes(&self.config, self.state.epoch)),
            ("metrics.parquet", self.metrics_bytes()?),
            ("model.safetensors", arrays_to_bytes("model.safetensors", &self.state.model, Precision::Single)?),
            (
                "optimizer.safetensors",
                arrays_to_bytes("optimizer.safetensors", &self.state.optimizer, Precision::Single)?,
            ),
        ]))
    }

    /// Decodes the files of a bundle; `file` is asked for each by name.
    ///
    /// # Errors
    /// [`KindError`] if a file is absent, damaged or of another kind or format.
    pub fn from_files(mut file: impl FnMut(&'static str) -> Result<Vec<u8>, KindError>) -> Result<Self, KindError> {
        let (config, epoch) = read_config(&file("config.json")?)?;
        let state = TrainState {
            epoch,
            model: arrays_from_bytes("model.safetensors", &file("model.safetensors")?)?,
            optimizer: arrays_from_bytes("optimizer.safetensors", &file("optimizer.safetensors")?)?,
        };
        let metrics = read_metrics(file("metrics.parquet")?, config.outputs())?;
        Ok(Self { config, state, metrics })
    }

    fn metrics_bytes(&self) -> Result<Vec<u8>, KindError> {
        let outputs = self.config.outputs();
        let validated = self.metrics.iter().any(|metrics| metrics.validation.is_some());
        let columns = metrics_columns(outputs, validated);
        let mut values: Vec<Vec<f64>> = vec![Vec::new(); columns.len() - 2];
        for (row, metrics) in self.metrics.iter().enumerate() {
            let numbers = numbers_of(metrics);
            if numbers.len() != values.len() {
                return Err(wrong_value(
                    METRICS,
                    "loss",
                    row,
                    numbers.len(),
                    "as many numbers as the network's outputs ask, of every epoch the same",
                ));
            }
            values.iter_mut().zip(numbers).for_each(|(column, number)| column.push(number));
        }
        let mut arrays: Vec<ArrayRef> = vec![
            Arc::new(UInt32Array::from_iter_values(self.metrics.iter().map(|m| m.epoch))),
            Arc::new(UInt64Array::from_iter_values(self.metrics.iter().map(|m| m.samples))),
        ];
        arrays.extend(values.into_iter().map(|column| -> ArrayRef { Arc::new(Float64Array::from(column)) }));
        let layout = Layout::new(METRICS, FORMAT, columns);
        match outputs {
            Outputs::Classes(classes) => layout.with("classes", classes).bytes(arrays),
            Outputs::Ranks { .. } => layout.bytes(arrays),
        }
    }
}

/// Returns the numbers of an epoch in the order of their columns.
fn numbers_of(metrics: &EpochMetrics) -> Vec<f64> {
    let mut numbers = vec![metrics.loss];
    match &metrics.fit {
        Fit::Classes { accuracy, mean_recall, recall } => {
            numbers.extend([accuracy, mean_recall].into_iter().chain(recall));
        }
        Fit::Ranks { error } => numbers.push(*error),
    }
    numbers.extend(metrics.validation.iter().flat_map(Validation::numbers));
    numbers
}

/// Encodes `config.json` of a network that was trained for `epoch` epochs.
pub(super) fn config_to_bytes(config: &CheckpointConfig, epoch: u32) -> Vec<u8> {
    let CheckpointConfig { network, window, batch, learning_rate, learned, besides } = config.clone();
    let counts = config.counts();
    let file = ConfigFile {
        kind: KIND.to_owned(),
        format: FORMAT,
        epoch,
        network,
        window,
        batch,
        learning_rate,
        besides,
        classes: counts.map(|counts| counts.classes.len()),
        distribution: counts.map(ClassCounts::distribution),
        class_weights: counts.map(class_weights),
        ranks: match learned {
            Learned::Ranks { density, flow } => Some(RanksFile { density, flow }),
            Learned::Classes(_) => None,
        },
        cells: counts.cloned().map(|ClassCounts { unlabeled, obstacle, classes }| CellCounts {
            unlabeled,
            obstacle,
            classes,
        }),
    };
    let mut text = serde_json::to_string_pretty(&file).expect("numbers are JSON");
    text.push('\n');
    text.into_bytes()
}

impl Kind for Checkpoint {
    const NAME: &'static str = KIND;
    const FORMAT: u32 = FORMAT;
    const EXTENSION: &'static str = "";

    fn write(&self, store: &Store) -> Result<Written, KindError> {
        let files = self.to_files()?;
        let refs: Result<_, KindError> = files.iter().map(|(name, bytes)| Ok(store.put(name, bytes)?)).collect();
        Ok(Written::Bundle(refs?))
    }

    fn read(store: &Store, artifact: &Artifact) -> Result<Self, KindError> {
        Self::from_files(|name| Ok(store.read(&named_file(KIND, artifact, name)?.digest)?))
    }
}

fn damaged(file: &'static str, source: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> KindError {
    KindError::Damaged { kind: KIND, file, source: source.into() }
}

pub(super) fn read_config(bytes: &[u8]) -> Result<(CheckpointConfig, u32), KindError> {
    let value: serde_json::Value = serde_json::from_slice(bytes).map_err(|e| damaged("config.json", e))?;
    // Kind and format first: another format may have other fields.
    match value["kind"].as_str() {
        None => return Err(KindError::NoKind { expected: KIND }),
        Some(KIND) => {}
        Some(found) => return Err(KindError::WrongKind { expected: KIND, found: found.to_owned() }),
    }
    match value["format"].as_u64().and_then(|format| u32::try_from(format).ok()) {
        None => return Err(KindError::MissingMetadata { kind: KIND, key: "format".to_owned() }),
        Some(FORMAT) => {}
        Some(found) => return Err(KindError::Format { kind: KIND, found, known: FORMAT }),
    }
    let file: ConfigFile = serde_json::from_value(value).map_err(|e| damaged("config.json", e))?;
    let wrong = |key: &str, value: String, expected| {
        Err(KindError::Metadata { kind: KIND, key: key.to_owned(), value, expected })
    };
    let learned = match (file.cells, file.ranks) {
        (None, Some(RanksFile { density, flow })) => Learned::Ranks { density, flow },
        (Some(CellCounts { unlabeled, obstacle, classes }), None) => {
            if !(usize::from(FEWEST_CLASSES)..=usize::from(MOST_CLASSES)).contains(&classes.len()) {
                return wrong("cells.classes", format!("{classes:?}"), "counts of 2 to 16 classes");
            }
            if file.classes != Some(classes.len()) {
                let found = file.classes.map_or_else(|| "absent".to_owned(), |found| found.to_string());
                return wrong("classes", found, "the number of counts in `cells.classes`");
            }
            Learned::Classes(ClassCounts { unlabeled, obstacle, classes })
        }
        (cells, _) => {
            let found = if cells.is_some() { "given besides `ranks`" } else { "absent, as are `ranks`" };
            return wrong("cells", found.to_owned(), "one of `cells` and `ranks`");
        }
    };
    if !(8..=512).contains(&file.window) || !file.window.is_multiple_of(8) {
        return wrong("window", file.window.to_string(), "a multiple of 8 from 8 to 512");
    }
    if !(file.learning_rate.is_finite() && file.learning_rate > 0.0) {
        return wrong("learning_rate", file.learning_rate.to_string(), "a positive number");
    }
    if planes::sorted(file.besides.clone()).as_ref() != Ok(&file.besides) {
        return wrong("besides", format!("{:?}", file.besides), "planes in order, each once");
    }
    let ConfigFile { network, window, batch, learning_rate, besides, epoch, .. } = file;
    Ok((CheckpointConfig { network, window, batch, learning_rate, learned, besides }, epoch))
}

/// Returns the columns of metrics, and as the last two those of a validation if there is one.
fn metrics_columns(outputs: Outputs, validated: bool) -> Vec<Column> {
    let mut columns = vec![
        Column::new("epoch", DataType::UInt32),
        Column::new("samples", DataType::UInt64),
        Column::new("loss", DataType::Float64),
    ];
    let names: Vec<String> = match outputs {
        Outputs::Classes(classes) => ["accuracy", "mean_recall"]
            .map(str::to_owned)
            .into_iter()
            .chain((0..=classes).map(|class| format!("recall_{class}")))
            .collect(),
        Outputs::Ranks { .. } => vec!["error".to_owned()],
    };
    columns.extend(names.into_iter().map(|name| Column::new(name, DataType::Float64)));
    if validated {
        columns.extend(validation_columns(outputs).map(|name| Column::new(name, DataType::Float64)));
    }
    columns
}

const fn validation_columns(outputs: Outputs) -> [&'static str; 2] {
    match outputs {
        Outputs::Classes(_) => ["validation_accuracy", "validation_mean_recall"],
        Outputs::Ranks { .. } => ["validation_spearman", "validation_auc"],
    }
}

fn read_metrics(bytes: Vec<u8>, outputs: Outputs) -> Result<Vec<EpochMetrics>, KindError> {
    let table = Table::open(METRICS, FORMAT, bytes)?;
    let mut metrics = Vec::new();
    let validated = table.has(validation_columns(outputs)[0]);
    let columns = metrics_columns(outputs, validated);
    for batch in table.batches(&columns)? {
        let batch = batch?;
        for i in 0..batch.rows {
            let number = |column: usize| batch.numbers::<Float64Type>(column)[i];
            metrics.push(EpochMetrics {
                epoch: batch.numbers::<UInt32Type>(0)[i],
                samples: batch.numbers::<UInt64Type>(1)[i],
                loss: number(2),
                fit: match outputs {
                    Outputs::Classes(classes) => Fit::Classes {
                        accuracy: number(3),
                        mean_recall: number(4),
                        recall: (0..=usize::from(classes)).map(|class| number(5 + class)).collect(),
                    },
                    Outputs::Ranks { .. } => Fit::Ranks { error: number(3) },
                },
                validation: validated.then(|| match (outputs, [columns.len() - 2, columns.len() - 1].map(number)) {
                    (Outputs::Classes(_), [accuracy, mean_recall]) => Validation::Classes { accuracy, mean_recall },
                    (Outputs::Ranks { .. }, [spearman, auc]) => Validation::Ranks { spearman, auc },
                }),
            });
            if !number(2).is_finite() {
                return Err(wrong_value(METRICS, "loss", batch.first + i, number(2), "a finite number"));
            }
        }
    }
    Ok(metrics)
}

/// How many bits a number has in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Precision {
    /// 32.
    Single,
    /// 16: numbers are rounded to the nearest that has 11 bits.
    Half,
}

/// Encodes arrays as safetensors.
pub(super) fn arrays_to_bytes(file: &'static str, arrays: &Arrays, precision: Precision) -> Result<Vec<u8>, KindError> {
    let encode = |values: &[f32]| -> Vec<u8> {
        match precision {
            Precision::Single => values.iter().flat_map(|value| value.to_le_bytes()).collect(),
            Precision::Half => values.iter().flat_map(|value| f16::from_f32(*value).to_le_bytes()).collect(),
        }
    };
    if precision == Precision::Half {
        for (name, array) in arrays {
            if let Some(value) = array.values.iter().find(|value| !f16::from_f32(**value).is_finite()) {
                return Err(wrong_value(
                    KIND,
                    &format!("{file}/{name}"),
                    0,
                    value,
                    "numbers that half precision reaches",
                ));
            }
        }
    }
    let dtype = if precision == Precision::Half { Dtype::F16 } else { Dtype::F32 };
    let bytes: Vec<(&str, &[usize], Vec<u8>)> =
        arrays.iter().map(|(name, array)| (name.as_str(), array.shape.as_slice(), encode(&array.values))).collect();
    let mut views = Vec::with_capacity(bytes.len());
    for (name, shape, bytes) in &bytes {
        let view = TensorView::new(dtype, shape.to_vec(), bytes);
        views.push((*name, view.map_err(|e| KindError::Shape { kind: KIND, what: format!("`{name}`: {e}") })?));
    }
    safetensors::serialize(views, None).map_err(|e| damaged(file, e))
}

/// Reads the arrays of a file of weights, whoever wrote it.
///
/// # Errors
/// [`KindError`] if it is none, or holds other numbers than finite ones in single or half precision.
pub fn weights(bytes: &[u8]) -> Result<Arrays, KindError> {
    arrays_from_bytes("weights", bytes)
}

/// Decodes safetensors in single or half precision.
pub(super) fn arrays_from_bytes(file: &'static str, bytes: &[u8]) -> Result<Arrays, KindError> {
    let tensors = SafeTensors::deserialize(bytes).map_err(|e| damaged(file, e))?;
    let array = |(name, view): (&str, TensorView<'_>)| {
        let wrong = |value: String, expected: &str| wrong_value(KIND, &format!("{file}/{name}"), 0, value, expected);
        let values: Vec<f32> = match view.dtype() {
            Dtype::F32 => view.data().as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect(),
            Dtype::F16 => {
                view.data().as_chunks::<2>().0.iter().map(|bytes| f16::from_le_bytes(*bytes).to_f32()).collect()
            }
            other => return Err(wrong(format!("{other:?}"), "numbers of type F32 or F16")),
        };
        match values.iter().find(|value| !value.is_finite()) {
            Some(value) => Err(wrong(value.to_string(), "finite numbers")),
            None => Ok((name.to_owned(), Array { shape: view.shape().to_vec(), values })),
        }
    };
    tensors.iter().map(array).collect()
}

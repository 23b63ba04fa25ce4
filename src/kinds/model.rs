//! A trained network by itself: `config.json` and `model.safetensors` of a checkpoint, without what only training needs.
//!
//! The model that is shipped lies in `src/model`, in half precision, with a card that says how it was made. Half precision
//! keeps 11 bits of every weight; it is widened as it is read, and everything is computed in single precision.

use std::collections::BTreeMap;

use super::KindError;
use super::checkpoint::{
    Checkpoint, CheckpointConfig, Precision, arrays_from_bytes, arrays_to_bytes, config_to_bytes, read_config,
};
use crate::domain::unet::Arrays;

/// A trained network that predicts.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// What its training was like.
    pub config: CheckpointConfig,
    /// Number of epochs that it was trained for.
    pub epoch: u32,
    /// Its parameters, under PyTorch's names and shapes.
    pub network: Arrays,
}

impl Model {
    /// Names of its files.
    pub const FILES: [&'static str; 2] = ["config.json", "model.safetensors"];

    /// Decodes the files of a model, or of a checkpoint; `file` is asked for each by name.
    ///
    /// # Errors
    /// [`KindError`] if a file is absent, damaged or of another kind or format.
    pub fn from_files(mut file: impl FnMut(&'static str) -> Result<Vec<u8>, KindError>) -> Result<Self, KindError> {
        let [config, network] = Self::FILES;
        let (config, epoch) = read_config(&file(config)?)?;
        Ok(Self { config, epoch, network: arrays_from_bytes(network, &file(network)?)? })
    }

    /// Encodes the files of the model by name, with its weights in half precision.
    ///
    /// # Errors
    /// [`KindError`] if an array is not of its shape or holds a number that half precision does not reach.
    pub fn to_half_files(&self) -> Result<BTreeMap<&'static str, Vec<u8>>, KindError> {
        let [config, network] = Self::FILES;
        let arrays = arrays_to_bytes(network, &self.network, Precision::Half)?;
        Ok(BTreeMap::from([(config, config_to_bytes(&self.config, self.epoch)), (network, arrays)]))
    }

    /// Returns the model that is shipped with the program.
    ///
    /// # Panics
    /// Never: a test reads it.
    #[must_use]
    pub fn shipped() -> Self {
        let files: [&[u8]; 2] = [include_bytes!("../model/config.json"), include_bytes!("../model/model.safetensors")];
        let mut files = Self::FILES.into_iter().zip(files).collect::<BTreeMap<_, _>>();
        let file = |name| Ok(files.remove(name).expect("one of two").to_vec());
        Self::from_files(file).expect("the shipped model can be read")
    }
}

impl From<Checkpoint> for Model {
    fn from(Checkpoint { config, state, .. }: Checkpoint) -> Self {
        Self { config, epoch: state.epoch, network: state.model }
    }
}

//! Remembers what was asked for and what came out.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize, Serializer};
use serde_json::Value;

use super::damage::{Damage, Damaged};
use super::error::failed;
use super::file::{fanned, list_fanned};
use super::seal::{self, Received, Unread};
use super::{Artifact, Digest, Key, Store, StoreError};

/// The digests at one port.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum InputDigest {
    /// One artifact.
    One(Digest),
    /// The members of a group by name.
    Many(BTreeMap<String, Digest>),
}

/// Everything that the bytes of an artifact are a function of.
///
/// Whatever its record may hold besides, its key tells whether these are all.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Recipe {
    /// Name of the stage.
    pub stage: String,
    /// `chunk`, `gather` or `step`; `None` for the whole.
    pub part: Option<String>,
    /// Version of the stage.
    pub version: u32,
    /// Kind of the output, and the number of its format.
    pub kind: String,
    /// Number of the format of that kind.
    pub format: u32,
    /// All parameters with defaults filled in.
    pub parameters: Value,
    /// The pipeline's seed if the stage uses it.
    pub seed: Option<u64>,
    /// What else changes the bytes, such as device and instruction set.
    pub environment: BTreeMap<String, String>,
    /// What was read at each port.
    pub inputs: BTreeMap<String, InputDigest>,
}

/// One entry that differs between two recipes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Difference {
    /// `classes`, `inputs.map`, `version`, …: parameters without prefix, nested ones with dots.
    pub what: String,
    /// The older value; `None` if there was none.
    pub before: Option<String>,
    /// The newer value; `None` if there is none.
    pub after: Option<String>,
}

impl Difference {
    /// Says in a few words what an older recipe, made elsewhere, has and what one of here has.
    #[must_use]
    pub fn there_and_here(&self) -> String {
        let value = |value: &Option<String>| value.clone().unwrap_or_else(|| "nothing".to_owned());
        let what = self.what.strip_prefix("environment.").unwrap_or(&self.what);
        format!("{what} {} there, {} here", value(&self.before), value(&self.after))
    }
}

/// A recipe and what came out.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Record {
    /// What was asked for.
    pub recipe: Recipe,
    /// What came out.
    pub artifact: Artifact,
    /// How it was made; no key and no byte of an artifact depends on it. Records of older versions do not say.
    #[serde(default)]
    pub making: Option<Making>,
}

/// How an artifact was made: for lineage, forecasts and tables.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Making {
    /// Program and its version.
    pub program: String,
    /// When the work began, RFC 3339 in UTC.
    pub started: String,
    /// How long it took in seconds.
    pub wall_s: f64,
    /// How much work it was, in the stage's own unit.
    pub amount: Option<f64>,
    /// The most memory that its commands held, in bytes, where it ran any.
    pub memory: Option<u64>,
    /// The files outside of the store that it read, by role, as they were named.
    pub sources: BTreeMap<String, String>,
}

/// A record as it is written.
#[derive(Serialize)]
struct Stored<'a> {
    format: u32,
    recipe: &'a Recipe,
    artifact: &'a Artifact,
    #[serde(skip_serializing_if = "Option::is_none")]
    making: Option<&'a Making>,
}

/// How a new record compares with the one that was there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Remembered {
    /// None was there.
    New,
    /// The same came out.
    Same,
    /// The same recipe once gave other bytes: the stage is not deterministic. The new record has taken the place.
    Other {
        /// What came out before.
        before: Artifact,
    },
}

impl Recipe {
    /// Returns the BLAKE3 of the canonical JSON: fields and object keys sorted, no white space.
    #[must_use]
    pub fn key(&self) -> Key {
        Key::new(Digest::of(self.canonical().as_bytes()))
    }

    fn canonical(&self) -> String {
        let Self { stage, part, version, kind, format, parameters, seed, environment, inputs } = self;
        let parameters = Sorted(parameters);
        let (part, seed) = (part.as_deref(), *seed);
        let (version, format) = (*version, *format);
        let canonical = Canonical { environment, format, inputs, kind, parameters, part, seed, stage, version };
        serde_json::to_string(&canonical).expect("a recipe is JSON: its keys are strings")
    }

    /// Returns the parameters as texts by name, nested ones with dots; lists are one text.
    #[must_use]
    pub fn parameter_texts(&self) -> Vec<(String, String)> {
        let mut texts = Vec::new();
        flatten("", &self.parameters, &mut |name, text| texts.push((name, text)));
        texts
    }

    /// Returns what a newer recipe has otherwise, in the order of the recipe's fields.
    #[must_use]
    pub fn differences(&self, newer: &Self) -> Vec<Difference> {
        let (before, after) = (self.entries(), newer.entries());
        let mut differences = Vec::new();
        for (position, (what, value)) in before.iter().enumerate() {
            let other = after.iter().find(|(name, _)| name == what).map(|(_, value)| value);
            if other != Some(value) {
                let difference =
                    Difference { what: what.1.clone(), before: Some(value.clone()), after: other.cloned() };
                differences.push(((what.0, what.1.clone(), position), difference));
            }
        }
        for (position, (what, value)) in after.iter().enumerate() {
            if !before.iter().any(|(name, _)| name == what) {
                let difference = Difference { what: what.1.clone(), before: None, after: Some(value.clone()) };
                differences.push(((what.0, what.1.clone(), position), difference));
            }
        }
        differences.sort_by(|(left, _), (right, _)| left.cmp(right));
        differences.into_iter().map(|(_, difference)| difference).collect()
    }

    /// Flattens the recipe to texts by field (as a number, for the order) and name.
    fn entries(&self) -> Vec<((u8, String), String)> {
        let mut entries = vec![
            ((0, "stage".to_owned()), self.stage.clone()),
            ((2, "version".to_owned()), self.version.to_string()),
            ((3, "kind".to_owned()), self.kind.clone()),
            ((4, "format".to_owned()), self.format.to_string()),
        ];
        entries.extend(self.part.iter().map(|part| ((1, "part".to_owned()), part.clone())));
        flatten("", &self.parameters, &mut |name, text| entries.push(((5, name), text)));
        entries.extend(self.seed.map(|seed| ((6, "seed".to_owned()), seed.to_string())));
        entries.extend(self.environment.iter().map(|(name, text)| ((7, format!("environment.{name}")), text.clone())));
        for (port, input) in &self.inputs {
            match input {
                InputDigest::One(digest) => entries.push(((8, format!("inputs.{port}")), digest.to_string())),
                InputDigest::Many(members) => entries.extend(
                    members.iter().map(|(name, digest)| ((8, format!("inputs.{port}.{name}")), digest.to_string())),
                ),
            }
        }
        entries
    }
}

/// Gives every leaf of a JSON value its dotted name; lists are leaves, texts go without quotes.
fn flatten(name: &str, value: &Value, each: &mut impl FnMut(String, String)) {
    match value {
        Value::Object(map) if !map.is_empty() => {
            for (key, value) in map {
                let name = if name.is_empty() { key.clone() } else { format!("{name}.{key}") };
                flatten(&name, value, each);
            }
        }
        Value::Object(_) if name.is_empty() => {}
        Value::String(text) => each(name.to_owned(), text.clone()),
        other => each(name.to_owned(), serde_json::to_string(&Sorted(other)).expect("a value is JSON")),
    }
}

/// A recipe with its fields in the order of their names.
#[derive(Serialize)]
struct Canonical<'a> {
    environment: &'a BTreeMap<String, String>,
    format: u32,
    inputs: &'a BTreeMap<String, InputDigest>,
    kind: &'a str,
    parameters: Sorted<'a>,
    part: Option<&'a str>,
    seed: Option<u64>,
    stage: &'a str,
    version: u32,
}

/// A JSON value that serializes with sorted keys, whatever order the map type of a build keeps.
struct Sorted<'a>(&'a Value);

impl Serialize for Sorted<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            Value::Object(map) => {
                let mut entries: Vec<(&String, Sorted)> = map.iter().map(|(key, value)| (key, Sorted(value))).collect();
                entries.sort_by_key(|(key, _)| *key);
                serializer.collect_map(entries)
            }
            Value::Array(values) => serializer.collect_seq(values.iter().map(Sorted)),
            leaf => leaf.serialize(serializer),
        }
    }
}

impl Record {
    /// Returns the record as it is written: sealed, so that whoever reads it sees whether it is whole.
    #[must_use]
    pub fn to_text(&self) -> Vec<u8> {
        let making = self.making.as_ref();
        let stored = Stored { format: seal::FORMAT, recipe: &self.recipe, artifact: &self.artifact, making };
        seal::seal(serde_json::to_vec_pretty(&stored).expect("a record is JSON: its keys are strings"))
    }

    /// Reads a record that came from elsewhere, and holds it against its seal and its key.
    #[must_use]
    pub fn from_text(key: &Key, text: &[u8]) -> Received<Self> {
        match unsealed(key, seal::unseal(text)) {
            Ok(record) => Received::Good(record),
            Err(Unread::Newer { .. }) => Received::Newer,
            Err(_) => Received::Damaged,
        }
    }
}

/// Holds a record against its key.
fn unsealed(key: &Key, read: Result<(Record, u32), Unread>) -> Result<Record, Unread> {
    match read? {
        (record, _) if record.recipe.key() == *key => Ok(record),
        // A recipe that says more has another key.
        (_, found) if found > seal::FORMAT => Err(Unread::Newer { found }),
        _ => Err(Unread::Damaged(serde::de::Error::custom("its recipe has another key"))),
    }
}

impl Store {
    /// Returns what came out of a recipe, if it was ever run.
    ///
    /// A record that does not parse or is not of its key is set aside and taken as absent; [`Store::take_damages`] names it.
    /// One of a newer version that this one does not understand is absent, too, and stays.
    ///
    /// # Errors
    /// If the record cannot be read.
    pub fn recall(&self, key: &Key) -> Result<Option<Record>, StoreError> {
        if let Some(session) = self.living_session() {
            session.pin_recipe(key, &self.gate).map_err(failed(&self.root, "write", &self.root))?;
        }
        match self.read_record(key) {
            Ok(record) => {
                tracing::debug!(%key, "recalled");
                Ok(Some(record))
            }
            Err(Unread::Absent | Unread::Newer { .. }) => Ok(None),
            Err(Unread::Failed(error)) => Err(failed(&self.root, "read", &self.recipe_path(key))(error)),
            Err(Unread::Damaged(_)) => {
                let damage = self.damaged_recipe(key);
                self.damages.lock().expect("nothing panics while it holds this lock").push(damage);
                Ok(None)
            }
        }
    }

    /// Records what came out of a recipe; its objects must be in the store. Where the same came out before, the record stays
    /// as it is: it says how that was made.
    ///
    /// # Errors
    /// If the store cannot be written.
    pub fn remember(&self, key: &Key, record: &Record) -> Result<Remembered, StoreError> {
        let before = self.recall(key)?.map(|before| before.artifact);
        if before.as_ref() == Some(&record.artifact) {
            return Ok(Remembered::Same);
        }
        tracing::debug!(%key, artifact = %record.artifact.digest, "remembered");
        let path = self.recipe_path(key);
        self.make_way(&path)?;
        self.write_record(&path, &record.to_text())?;
        Ok(before.map_or(Remembered::New, |before| Remembered::Other { before }))
    }

    pub(super) fn recipe_path(&self, key: &Key) -> PathBuf {
        fanned(&self.root.join("recipes"), &key.digest(), ".json")
    }

    /// Reads and checks a record; notes nothing, sets nothing aside.
    pub(super) fn read_record(&self, key: &Key) -> Result<Record, Unread> {
        unsealed(key, seal::read::<Record>(&self.recipe_path(key)))
    }

    /// Sets a recipe aside and says whose it is.
    pub(super) fn damaged_recipe(&self, key: &Key) -> Damage {
        let aside = self.set_aside(&self.recipe_path(key), &format!("{}.json", key.to_hex()));
        Damage { what: Damaged::Recipe(*key), nodes: self.nodes_of_key(key), aside }
    }

    /// Lists the keys of all recipes.
    pub(super) fn keys(&self) -> Result<Vec<Key>, StoreError> {
        let entries = list_fanned(&self.root, "recipes", ".json")?;
        Ok(entries.into_iter().filter_map(|entry| entry.digest.map(Key::new)).collect())
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use proptest::prelude::*;
    use serde_json::json;

    use super::super::testing::{recipe, record, store};
    use super::*;

    fn whole() -> Recipe {
        Recipe {
            stage: "simulate".to_owned(),
            part: Some("chunk".to_owned()),
            version: 2,
            kind: "Trajectories".to_owned(),
            format: 1,
            parameters: json!({ "episodes": 50, "agents": [1, 8], "speed": { "mean": 1.3, "deviation": 0.2 }, "preset": null }),
            seed: Some(2023),
            environment: BTreeMap::from([("simd".to_owned(), "avx2".to_owned())]),
            inputs: BTreeMap::from([
                ("map".to_owned(), InputDigest::One(Digest::of(b"map"))),
                ("parts".to_owned(), InputDigest::Many(BTreeMap::from([("a".to_owned(), Digest::of(b"a"))]))),
            ]),
        }
    }

    /// Every key of every store depends on this one: if it changes, everything that was ever made is made again.
    #[test]
    fn the_golden_key() {
        assert_eq!(whole().canonical(), GOLDEN);
        assert_eq!(whole().key().to_hex(), GOLDEN_KEY);
    }

    const GOLDEN: &str = concat!(
        r#"{"environment":{"simd":"avx2"},"format":1,"#,
        r#""inputs":{"map":"901cc3e1a199fb936ae0e06d3070ee6a376b0949ade3125db2cfdb57f5b37f42","#,
        r#""parts":{"a":"17762fddd969a453925d65717ac3eea21320b66b54342fde15128d6caf21215f"}},"#,
        r#""kind":"Trajectories","parameters":{"agents":[1,8],"episodes":50,"preset":null,"speed":{"deviation":0.2,"mean":1.3}},"#,
        r#""part":"chunk","seed":2023,"stage":"simulate","version":2}"#
    );
    const GOLDEN_KEY: &str = "41b900c638984affb0bf67a95f9f625447681fda64e6c7685366f0a5a157fda4";

    #[test]
    fn differences_name_what_changed() {
        let mut newer = whole();
        newer.version = 3;
        newer.seed = None;
        newer.parameters = json!({ "episodes": 50, "agents": [1, 9], "speed": { "mean": 1.4, "deviation": 0.2 }, "preset": "igibson", "robot": "ghost" });
        newer.inputs.insert("map".to_owned(), InputDigest::One(Digest::of(b"other")));
        newer.inputs.remove("parts");
        let lines: Vec<String> = whole()
            .differences(&newer)
            .into_iter()
            .map(|difference| {
                let text = |value: Option<String>| value.unwrap_or_else(|| "-".to_owned());
                format!("{} {} → {}", difference.what, text(difference.before), text(difference.after))
            })
            .collect();
        let expected = [
            "version 2 → 3".to_owned(),
            "agents [1,8] → [1,9]".to_owned(),
            "preset null → igibson".to_owned(),
            "robot - → ghost".to_owned(),
            "speed.mean 1.3 → 1.4".to_owned(),
            "seed 2023 → -".to_owned(),
            format!("inputs.map {} → {}", Digest::of(b"map"), Digest::of(b"other")),
            format!("inputs.parts.a {} → -", Digest::of(b"a")),
        ];
        assert_eq!(lines, expected);
        assert!(whole().differences(&whole()).is_empty());
    }

    #[test]
    fn what_was_remembered_is_recalled() {
        let (_folder, store) = store();
        let first = record(&store, "a");
        let key = first.recipe.key();
        assert_eq!(store.recall(&key).expect("reads"), None);
        assert_eq!(store.remember(&key, &first).expect("writes"), Remembered::New);
        assert_eq!(store.remember(&key, &first).expect("writes"), Remembered::Same);
        assert_eq!(store.recall(&key).expect("reads").as_ref(), Some(&first));
        let other = Record { artifact: record(&store, "b").artifact, ..first.clone() };
        assert_eq!(store.remember(&key, &other).expect("writes"), Remembered::Other { before: first.artifact });
        assert_eq!(store.recall(&key).expect("reads"), Some(other));
    }

    #[test]
    fn how_an_artifact_was_made_stays_on_record() {
        let (_folder, store) = store();
        let making = |program: &str| Making { program: program.to_owned(), wall_s: 1.5, ..Making::default() };
        let first = Record { making: Some(making("trodden 1")), ..record(&store, "a") };
        let key = first.recipe.key();
        store.remember(&key, &first).expect("writes");
        // Whoever makes the same again does not take the place of the first.
        let again = Record { making: Some(making("trodden 2")), ..first.clone() };
        assert_eq!(store.remember(&key, &again).expect("writes"), Remembered::Same);
        assert_eq!(store.recall(&key).expect("reads"), Some(first));
    }

    #[test]
    fn a_damaged_record_is_set_aside_and_absent() {
        let (_folder, store) = store();
        let one = record(&store, "a");
        let key = one.recipe.key();
        let good = String::from_utf8(one.to_text()).expect("is text");
        let other = String::from_utf8(record(&store, "b").to_text()).expect("is text");
        let extended = good.replacen('{', "{\n  \"more\": 1,", 1);
        // The recipe and its key are right, what came out is not.
        let digest = one.artifact.digest.to_hex();
        let flipped =
            good.replace(&digest, &digest.replace(&digest[..1], if digest.starts_with('0') { "1" } else { "0" }));
        for text in ["", "{", &good[..good.len() / 2], &other, &extended, &flipped] {
            store.remember(&key, &one).expect("writes");
            fs::write(store.recipe_path(&key), text).expect("writes");
            assert_eq!(store.recall(&key).expect("reads"), None, "{text}");
            let damages = store.take_damages();
            let [damage] = damages.as_slice() else { panic!("{damages:?}") };
            assert_eq!(damage.what, Damaged::Recipe(key));
            assert_eq!(fs::read_to_string(damage.aside.as_ref().expect("was moved")).expect("reads"), *text);
            assert!(!store.recipe_path(&key).exists());
            // It was not what came out before, so nothing came out otherwise.
            assert_eq!(store.remember(&key, &one).expect("writes"), Remembered::New);
        }
    }

    #[test]
    fn a_folder_in_the_place_of_a_record_is_set_aside() {
        let (_folder, store) = store();
        let one = record(&store, "a");
        let key = one.recipe.key();
        let path = store.recipe_path(&key);
        fs::create_dir_all(path.join("folder")).expect("creates");
        assert_eq!(store.recall(&key).expect("reads"), None);
        assert!(store.take_damages()[0].aside.as_ref().is_some_and(|aside| aside.join("folder").is_dir()));
        fs::create_dir_all(path.join("folder")).expect("creates");
        store.remember(&key, &one).expect("writes");
        assert_eq!(store.recall(&key).expect("reads"), Some(one));
    }

    #[test]
    fn records_of_other_versions_are_read() {
        let (_folder, store) = store();
        let one = record(&store, "a");
        let key = one.recipe.key();
        let path = store.recipe_path(&key);
        store.remember(&key, &one).expect("writes");
        let (recipe, artifact) = (serde_json::to_value(&one.recipe), serde_json::to_value(&one.artifact));
        let (recipe, artifact) = (recipe.expect("is JSON"), artifact.expect("is JSON"));
        // The first format, and one that says more of the artifact.
        let newer = |recipe: &Value| {
            let text = json!({ "format": 3, "recipe": recipe, "artifact": artifact, "worker": "elsewhere" });
            seal::seal(serde_json::to_vec_pretty(&text).expect("is JSON"))
        };
        let first = serde_json::to_vec_pretty(&json!({ "recipe": recipe, "artifact": artifact })).expect("is JSON");
        for text in [first, newer(&recipe)] {
            fs::write(&path, text).expect("writes");
            assert_eq!(store.recall(&key).expect("reads").as_ref(), Some(&one));
        }
        // What is not understood is newer, and nothing that this version may set aside.
        let mut more = recipe;
        more["seed"] = json!({ "one": 1 });
        fs::write(&path, newer(&more)).expect("writes");
        assert_eq!(store.recall(&key).expect("reads"), None);
        assert!(store.take_damages().is_empty() && path.exists());
        let report = store.verify(&|_, _| ()).expect("verifies");
        assert!(report.is_clean() && report.newer == [path], "{report:?}");
    }

    fn value() -> impl Strategy<Value = Value> {
        let leaf = prop_oneof![
            Just(Value::Null),
            any::<bool>().prop_map(Value::from),
            any::<i64>().prop_map(Value::from),
            any::<u64>().prop_map(Value::from),
            any::<f64>().prop_map(Value::from),
            any::<f32>().prop_map(Value::from),
            any::<String>().prop_map(Value::from),
        ];
        leaf.prop_recursive(3, 24, 6, |inner| {
            prop_oneof![
                proptest::collection::vec(inner.clone(), 0..6).prop_map(Value::from),
                proptest::collection::vec((any::<String>(), inner), 0..6)
                    .prop_map(|pairs| Value::Object(pairs.into_iter().collect())),
            ]
        })
    }

    proptest! {
        /// A record that is read again has the key it was written under, to the last digit of every number.
        #[test]
        fn keys_survive_the_file(parameters in value(), seed in any::<Option<u64>>()) {
            let recipe = Recipe { parameters, seed, ..recipe("a") };
            let text = serde_json::to_vec_pretty(&recipe).expect("is JSON");
            let read: Recipe = serde_json::from_slice(&text).expect("is a recipe");
            prop_assert_eq!(read.key(), recipe.key());
            prop_assert!(recipe.differences(&read).is_empty());
            prop_assert_eq!(serde_json::from_str::<Value>(&recipe.canonical()).expect("is JSON"), serde_json::to_value(&recipe).expect("is JSON"));
        }
    }
}

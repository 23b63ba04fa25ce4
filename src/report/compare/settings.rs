//! JSON and metadata: entries by name.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::Value;

/// An entry that differs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Setting {
    /// Its name; with dots where it lies in others.
    pub name: String,
    /// The value before; `None` if there was none.
    pub before: Option<String>,
    /// The value after; `None` if there is none.
    pub after: Option<String>,
}

/// Compares two JSON values, leaf by leaf; lists are leaves.
#[must_use]
pub fn of_json(before: &Value, after: &Value) -> Vec<Setting> {
    let leaves = |value: &Value| {
        let mut leaves = BTreeMap::new();
        flatten("", value, &mut leaves);
        leaves
    };
    compare(&leaves(before), &leaves(after))
}

/// Compares texts by name.
#[must_use]
pub fn compare(before: &BTreeMap<String, String>, after: &BTreeMap<String, String>) -> Vec<Setting> {
    let mut names: Vec<&String> = before.keys().chain(after.keys()).collect();
    names.sort_unstable();
    names.dedup();
    let differing = names.into_iter().filter(|name| before.get(*name) != after.get(*name));
    let setting = |name: &String| Setting {
        name: name.clone(),
        before: before.get(name).cloned(),
        after: after.get(name).cloned(),
    };
    differing.map(setting).collect()
}

fn flatten(name: &str, value: &Value, leaves: &mut BTreeMap<String, String>) {
    match value {
        Value::Object(entries) if !entries.is_empty() || name.is_empty() => {
            for (key, value) in entries {
                let name = if name.is_empty() { key.clone() } else { format!("{name}.{key}") };
                flatten(&name, value, leaves);
            }
        }
        Value::String(text) => drop(leaves.insert(name.to_owned(), text.clone())),
        other => drop(leaves.insert(name.to_owned(), other.to_string())),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn entries_that_differ_are_named() {
        let before = json!({ "epoch": 1, "network": { "widths": [32, 64], "convolutions": 1 }, "old": true });
        let after = json!({ "epoch": 2, "network": { "widths": [32, 64], "convolutions": 2 }, "new": null });
        let found: Vec<(String, Option<String>, Option<String>)> =
            of_json(&before, &after).into_iter().map(|s| (s.name, s.before, s.after)).collect();
        let entry = |name: &str, before: Option<&str>, after: Option<&str>| {
            (name.to_owned(), before.map(str::to_owned), after.map(str::to_owned))
        };
        let expected = [
            entry("epoch", Some("1"), Some("2")),
            entry("network.convolutions", Some("1"), Some("2")),
            entry("new", None, Some("null")),
            entry("old", Some("true"), None),
        ];
        assert_eq!(found, expected);
        assert_eq!(of_json(&before, &before), []);
    }
}

//! Says what of the store a run found damaged.

use crate::store::{Damage, Damaged};

pub(super) fn damage_text(damage: &Damage) -> String {
    let what = match &damage.what {
        Damaged::Recipe(key) => format!("recipe `{key}`"),
        Damaged::Object(digest) => format!("object `{digest}`"),
        _ => "a record".to_owned(),
    };
    let whose = match damage.nodes.len() {
        0 => String::new(),
        _ => format!(", which belongs to `{}`,", damage.nodes.join("`, `")),
    };
    format!("{what}{whose} was damaged; it is made again")
}

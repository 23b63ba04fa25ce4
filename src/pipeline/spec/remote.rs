//! Reads which store elsewhere a pipeline file names.

use super::RemoteStore;
use super::suggest;
use super::tree::{Data, Tree};
use crate::pipeline::error::Problem;

const KEYS: [&str; 2] = ["remote", "read_only"];

/// Reads `store:`; what is wrong is added to the problems.
pub(super) fn read(value: &Tree, problems: &mut Vec<Problem>) -> Option<RemoteStore> {
    let Some(members) = value.members() else {
        let message = format!("`store` is a mapping, not {}", value.type_name());
        problems.push(Problem::new(value.span, message).with_help("write `store: { remote: s3://bucket/prefix }`"));
        return None;
    };
    for member in members.iter().filter(|member| !KEYS.contains(&member.key.as_str())) {
        let message = format!("`store` has no key `{}`", member.key);
        problems
            .push(Problem::new(member.key_span, message).with_help_from(suggest::help(&member.key, KEYS.into_iter())));
    }
    let read_only = match value.get("read_only").map(|member| &member.value) {
        None => false,
        Some(Tree { data: Data::Bool(read_only), .. }) => *read_only,
        Some(other) => {
            problems.push(Problem::new(other.span, "`read_only` is `true` or `false`"));
            false
        }
    };
    match value.get("remote").map(|member| &member.value) {
        Some(Tree { data: Data::Text(address), .. }) if !address.is_empty() => {
            Some(RemoteStore { address: address.clone(), read_only })
        }
        Some(other) => {
            let help = "`s3://bucket/prefix`, `gs://…`, `az://…` or a folder";
            problems.push(Problem::new(other.span, "`remote` is the address of a shared store").with_help(help));
            None
        }
        None => {
            let help = "add `remote: s3://bucket/prefix`; the folder of the store here is named by `--store`";
            problems.push(Problem::new(value.span, "`store` does not say where the shared one is").with_help(help));
            None
        }
    }
}

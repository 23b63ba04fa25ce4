//! Reads what uses of stages and sources have in common.

use super::names;
use super::tree::{Data, Member, Tree};
use crate::pipeline::error::Problem;

pub(super) fn keep<T>(result: Result<T, Problem>, problems: &mut Vec<Problem>) -> Option<T> {
    result.map_err(|problem| problems.push(problem)).ok()
}

pub(super) fn read_seed(value: &Tree) -> Result<u64, Problem> {
    let seed = match &value.data {
        Data::Number(number) => number.as_u64(),
        _ => None,
    };
    seed.ok_or_else(|| Problem::new(value.span, "`seed` is a whole number from 0 to 18446744073709551615"))
}

pub(super) fn check_name(member: &Member, what: &str, problems: &mut Vec<Problem>) {
    if !names::is_word(&member.key) {
        let message = format!("`{}` cannot be the name of a {what}", member.key);
        let help = "start with a letter; letters, digits, `-` and `_` may follow";
        problems.push(Problem::new(member.key_span, message).with_help(help));
    }
}

pub(super) fn mapping<'a>(value: &'a Tree, what: &str, problems: &mut Vec<Problem>) -> &'a [Member] {
    value.members().unwrap_or_else(|| {
        problems.push(Problem::new(value.span, format!("{what} is a mapping, not {}", value.type_name())));
        &[]
    })
}

/// Reads the seed that a use of a stage or a source names for itself.
pub(super) fn own_seed(settings: &[Member], owner: &str, seeded: bool, problems: &mut Vec<Problem>) -> Option<u64> {
    let setting = settings.iter().find(|setting| !no_seed(setting))?;
    if !seeded {
        let message = format!("`{owner}` draws no random numbers, so it takes no `seed`");
        problems.push(Problem::new(setting.key_span, message).with_help("leave it out"));
        return None;
    }
    keep(read_seed(&setting.value), problems)
}

pub(super) fn no_seed(setting: &&Member) -> bool {
    setting.key != "seed"
}

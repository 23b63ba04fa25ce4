//! Guesses what was meant by a misspelt name.

use std::collections::BTreeSet;

use crate::store::NodeName;

/// The longest name that is compared with others, in bytes.
const LONGEST: usize = 256;

/// Returns the candidate that is a slip of the finger away from a name, if there is one.
pub(crate) fn closest<'a>(name: &str, candidates: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    // The work grows with both lengths, and what is longer is no slip of the finger.
    if name.len() > LONGEST {
        return None;
    }
    let folded = name.to_lowercase();
    candidates
        .filter(|candidate| !candidate.is_empty() && candidate.len() <= LONGEST && *candidate != name)
        .map(|candidate| {
            let other = candidate.to_lowercase();
            let far = strsim::damerau_levenshtein(&folded, &other);
            (far, strsim::jaro_winkler(&folded, &other), candidate)
        })
        .filter(|(far, alike, candidate)| *far <= candidate.chars().count().div_ceil(3).min(3) || *alike > 0.9)
        .min_by(|one, other| one.0.cmp(&other.0).then(other.1.total_cmp(&one.1)).then(one.2.cmp(other.2)))
        .map(|(_, _, candidate)| candidate)
}

/// Returns a help line: the closest candidate, or all of them if none is close.
pub(crate) fn help<'a>(name: &str, candidates: impl Iterator<Item = &'a str> + Clone) -> Option<String> {
    match closest(name, candidates.clone()) {
        Some(candidate) => Some(format!("did you mean `{candidate}`?")),
        None => known(candidates),
    }
}

/// Returns a help line for the name of a node, a part or a stage: the closest one, or all stages if none is close.
pub(crate) fn node<'a>(name: &str, nodes: impl Iterator<Item = &'a NodeName> + Clone) -> Option<String> {
    let stages: BTreeSet<&str> = nodes.clone().map(NodeName::stage).collect();
    match closest(name, stages.iter().copied().chain(nodes.map(NodeName::as_str))) {
        Some(close) => Some(format!("did you mean `{close}`?")),
        None => known(stages.iter().copied()),
    }
}

/// Returns a help line that lists what there is.
fn known<'a>(candidates: impl Iterator<Item = &'a str>) -> Option<String> {
    const SHOWN: usize = 16;
    let names: Vec<String> = candidates.map(|candidate| format!("`{candidate}`")).collect();
    match names.len() {
        0 => None,
        1..=SHOWN => Some(format!("known are {}", names.join(", "))),
        more => Some(format!("known are {} and {} more", names[..SHOWN].join(", "), more - SHOWN)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(name: &str, expected: Option<&str>) {
        let candidates = ["rasterize", "simulate", "episodes", "stride", "size", "map", "maps"];
        assert_eq!(closest(name, candidates.into_iter()), expected, "{name}");
    }

    #[test]
    fn slips_are_recognized() {
        check("rasterise", Some("rasterize"));
        check("episode", Some("episodes"));
        check("Simulate", Some("simulate"));
        check("strdie", Some("stride"));
        check("mpa", Some("map"));
        check("quantize", None);
        check("x", None);
    }
}

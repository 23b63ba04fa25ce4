//! Patterns of names.

/// Tells whether a name fits any of the patterns.
pub(super) fn is_any(patterns: &[String], name: &str) -> bool {
    patterns.iter().any(|pattern| matches(pattern, name))
}

/// Tells whether a name fits a pattern, in which `*` stands for any letters and `?` for one; capitals are no others.
fn matches(pattern: &str, name: &str) -> bool {
    let [pattern, name] = [pattern, name].map(|text| text.to_lowercase().chars().collect::<Vec<char>>());
    // How much of the name each part of the pattern can stand for.
    let mut fits = vec![false; name.len() + 1];
    fits[0] = true;
    for sign in pattern {
        if sign == '*' {
            let first = fits.iter().position(|fits| *fits).unwrap_or(fits.len());
            fits[first..].fill(true);
        } else {
            for at in (1..fits.len()).rev() {
                fits[at] = fits[at - 1] && (sign == '?' || sign == name[at - 1]);
            }
            fits[0] = false;
        }
    }
    fits[name.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_stand_for_names() {
        let yes = [("*", ""), ("*wall*", "A-WALL-1"), ("wall", "Wall"), ("?-*", "a-b"), ("a*b*c", "aXbYbZc"), ("", "")];
        let no = [("wall", "walls"), ("?", ""), ("*-", "a-b"), ("a*b", "ac"), ("", "a")];
        yes.iter().for_each(|(pattern, name)| assert!(matches(pattern, name), "{pattern} {name}"));
        no.iter().for_each(|(pattern, name)| assert!(!matches(pattern, name), "{pattern} {name}"));
    }
}

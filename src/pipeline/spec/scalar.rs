//! Plain scalars by the core schema of YAML 1.2: `yes` is a string, `010` is ten.

use serde_json::Number;

use super::value::Data;
use crate::pipeline::error::{Problem, Span};

/// Returns what a plain scalar means.
pub(super) fn resolve(text: &str, span: Span) -> Result<Data, Problem> {
    match text {
        "" | "~" | "null" | "Null" | "NULL" => return Ok(Data::Null),
        "true" | "True" | "TRUE" => return Ok(Data::Bool(true)),
        "false" | "False" | "FALSE" => return Ok(Data::Bool(false)),
        _ => {}
    }
    let unsigned = text.strip_prefix(['-', '+']).unwrap_or(text);
    if matches!(text, ".nan" | ".NaN" | ".NAN") || matches!(unsigned, ".inf" | ".Inf" | ".INF") {
        return Err(Problem::new(span, format!("`{text}` is not a number that a parameter can have"))
            .with_help("write a finite number"));
    }
    if let Some(number) = integer(text, unsigned) {
        return Ok(Data::Number(number));
    }
    if is_float(unsigned) {
        let value: f64 = text.parse().expect("what looks like a float parses as one");
        return match Number::from_f64(value) {
            Some(number) => Ok(Data::Number(number)),
            None => Err(Problem::new(span, format!("`{text}` is too large for a number"))),
        };
    }
    Ok(Data::Text(text.to_owned()))
}

/// Returns decimal, octal (`0o17`) and hexadecimal (`0xff`) integers that fit into 64 bits.
fn integer(text: &str, unsigned: &str) -> Option<Number> {
    if let Some(digits) = text.strip_prefix("0o") {
        return u64::from_str_radix(digits, 8).ok().map(Number::from);
    }
    if let Some(digits) = text.strip_prefix("0x") {
        return u64::from_str_radix(digits, 16).ok().map(Number::from);
    }
    if unsigned.is_empty() || !unsigned.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    if text.starts_with('-') {
        return text.parse::<i64>().ok().map(Number::from);
    }
    unsigned.parse::<u64>().ok().map(Number::from)
}

/// Tells whether a text without its sign is `1`, `1.`, `.5`, `1.5`, each with or without an exponent.
fn is_float(unsigned: &str) -> bool {
    let (mantissa, exponent) = match unsigned.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, Some(exponent)),
        None => (unsigned, None),
    };
    let digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let exponent_holds = exponent.is_none_or(|text| {
        let text = text.strip_prefix(['-', '+']).unwrap_or(text);
        !text.is_empty() && digits(text)
    });
    exponent_holds && digits(whole) && digits(fraction) && !(whole.is_empty() && fraction.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(text: &str, expected: Option<Data>) {
        assert_eq!(resolve(text, Span::default()).ok(), expected, "{text}");
    }

    #[test]
    fn scalars_follow_the_core_schema() {
        let text = |text: &str| Some(Data::Text(text.to_owned()));
        let number = |value: f64| Some(Data::Number(Number::from_f64(value).expect("finite")));
        check("~", Some(Data::Null));
        check("yes", text("yes"));
        check("True", Some(Data::Bool(true)));
        check("010", Some(Data::Number(10.into())));
        check("-3", Some(Data::Number((-3).into())));
        check("0x1F", Some(Data::Number(31.into())));
        check("18446744073709551615", Some(Data::Number(u64::MAX.into())));
        check("1e-3", number(1e-3));
        check(".5", number(0.5));
        check("1.", number(1.0));
        check("-0.25", number(-0.25));
        check("1.2.3", text("1.2.3"));
        check(".", text("."));
        check("1e", text("1e"));
        check("$maps.train", text("$maps.train"));
        check(".nan", None);
        check("-.inf", None);
        check("1e999", None);
    }
}

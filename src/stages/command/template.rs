//! Arguments of a command with places to fill in: `{inputs.day}`, `{output}`, `{params.threshold}`.

use serde_json::{Map, Value};

use crate::pipeline::spec::suggest;
use crate::pipeline::stage::Port;

/// What may be filled in, for messages.
const PLACES: &str = "`{inputs}`, `{inputs.NAME}`, `{output}`, `{params}`, `{params.NAME}` and `{seed}`";

/// An argument.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Template(Vec<Piece>);

#[derive(Debug, Clone, PartialEq, Eq)]
enum Piece {
    Text(String),
    /// The folder of all inputs.
    Inputs,
    /// The file or folder of an input.
    Input(String),
    /// The file or folder to write.
    Output,
    /// The file that has the parameters as JSON.
    Params,
    Seed,
}

/// What the places stand for.
pub(super) struct Filling<'a> {
    pub inputs: &'a str,
    pub input: &'a dyn Fn(&str) -> String,
    pub output: &'a str,
    pub params: &'a str,
    pub seed: u64,
}

impl Template {
    /// Reads an argument; `{{` and `}}` stand for braces themselves. Parameters are filled in at once.
    ///
    /// # Errors
    /// What is wrong with it, and what helps.
    pub(super) fn read(
        text: &str,
        ports: &[Port],
        params: &Map<String, Value>,
    ) -> Result<Self, (String, Option<String>)> {
        let mut reader = Reader { pieces: Vec::new(), text: String::new() };
        let mut rest = text;
        while let Some(at) = rest.find(['{', '}']) {
            reader.text.push_str(&rest[..at]);
            let brace = &rest[at..=at];
            rest = &rest[at + 1..];
            if let Some(after) = rest.strip_prefix(brace) {
                reader.text.push_str(brace);
                rest = after;
                continue;
            }
            let escape = Some("write `{{` and `}}` for braces themselves".to_owned());
            if brace == "}" {
                return Err((format!("`{text}` closes a brace that it does not open"), escape));
            }
            let Some(length) = rest.find('}') else {
                return Err((format!("`{text}` opens a brace that it does not close"), escape));
            };
            reader.place(&rest[..length], ports, params)?;
            rest = &rest[length + 1..];
        }
        reader.text.push_str(rest);
        Ok(Self(reader.finish()))
    }

    /// Returns the argument with everything filled in.
    pub(super) fn fill(&self, filling: &Filling) -> String {
        let fill = |piece: &Piece| match piece {
            Piece::Text(text) => text.clone(),
            Piece::Inputs => filling.inputs.to_owned(),
            Piece::Input(name) => (filling.input)(name),
            Piece::Output => filling.output.to_owned(),
            Piece::Params => filling.params.to_owned(),
            Piece::Seed => filling.seed.to_string(),
        };
        self.0.iter().map(fill).collect()
    }

    /// Tells whether the seed is filled in somewhere.
    pub(super) fn has_seed(&self) -> bool {
        self.0.contains(&Piece::Seed)
    }

    /// Returns the argument if nothing is to be filled in.
    pub(super) fn plain(&self) -> Option<&str> {
        match self.0.as_slice() {
            [] => Some(""),
            [Piece::Text(text)] => Some(text),
            _ => None,
        }
    }
}

struct Reader {
    pieces: Vec<Piece>,
    text: String,
}

impl Reader {
    fn push(&mut self, piece: Piece) {
        if !self.text.is_empty() {
            self.pieces.push(Piece::Text(std::mem::take(&mut self.text)));
        }
        self.pieces.push(piece);
    }

    fn finish(mut self) -> Vec<Piece> {
        if !self.text.is_empty() {
            self.pieces.push(Piece::Text(self.text));
        }
        self.pieces
    }

    fn place(
        &mut self,
        place: &str,
        ports: &[Port],
        params: &Map<String, Value>,
    ) -> Result<(), (String, Option<String>)> {
        match (place, place.split_once('.')) {
            ("inputs", _) => self.push(Piece::Inputs),
            ("output", _) => self.push(Piece::Output),
            ("params", _) => self.push(Piece::Params),
            ("seed", _) => self.push(Piece::Seed),
            (_, Some(("inputs", name))) if ports.iter().any(|port| port.name == name) => {
                self.push(Piece::Input(name.to_owned()));
            }
            (_, Some(("inputs", name))) => {
                let help = suggest::help(name, ports.iter().map(|port| &*port.name));
                return Err((format!("`{{{place}}}`: there is no input `{name}`"), help));
            }
            (_, Some(("params", name))) => match params.get(name) {
                Some(Value::String(text)) => self.text.push_str(text),
                Some(value) => self.text.push_str(&value.to_string()),
                None => {
                    let help = suggest::help(name, params.keys().map(String::as_str));
                    return Err((format!("`{{{place}}}`: there is no parameter `{name}` under `params`"), help));
                }
            },
            _ => return Err((format!("`{{{place}}}` is not known"), Some(format!("known are {PLACES}")))),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::pipeline::stage::Arity;

    fn read(text: &str) -> Result<Template, (String, Option<String>)> {
        let ports = [Port::new("day", Port::ANY, Arity::One, "")];
        let params = json!({ "threshold": 2.5, "name": "a b", "list": [1, 2] });
        Template::read(text, &ports, params.as_object().expect("is an object"))
    }

    #[test]
    fn places_are_filled_in() {
        let check = |text: &str, expected: &str| {
            let input = |name: &str| format!("inputs/{name}.csv");
            let filling = Filling { inputs: "inputs", input: &input, output: "out", params: "params.json", seed: 7 };
            assert_eq!(read(text).expect(text).fill(&filling), expected);
        };
        check("fit.py", "fit.py");
        check("", "");
        check("--day={inputs.day}", "--day=inputs/day.csv");
        check("{inputs}/{output}", "inputs/out");
        check("{params.threshold},{params.name},{params.list}", "2.5,a b,[1,2]");
        check("{params}:{seed}", "params.json:7");
        check("{{print $1}} {{{{", "{print $1} {{");
    }

    #[test]
    fn other_braces_are_refused() {
        let check = |text: &str, expected: &str| assert_eq!(read(text).expect_err(text).0, expected);
        check("{day}", "`{day}` is not known");
        check("{inputs.dya}", "`{inputs.dya}`: there is no input `dya`");
        check("{params.limit}", "`{params.limit}`: there is no parameter `limit` under `params`");
        check("a}", "`a}` closes a brace that it does not open");
        check("{output", "`{output` opens a brace that it does not close");
        assert_eq!(read("{inputs.dya}").expect_err("is wrong").1.as_deref(), Some("did you mean `day`?"));
    }

    #[test]
    fn what_is_plain_is_known() {
        assert_eq!(read("fit.py").expect("reads").plain(), Some("fit.py"));
        assert_eq!(read("{params.name}").expect("reads").plain(), Some("a b"));
        assert_eq!(read("{output}").expect("reads").plain(), None);
        assert!(read("--seed={seed}").expect("reads").has_seed() && !read("seed").expect("reads").has_seed());
    }
}

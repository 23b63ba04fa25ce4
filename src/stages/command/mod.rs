//! `command`: a program of one's own as a stage.
//!
//! ```yaml
//! fit:
//!   use: command
//!   run: [python, fit.py, "{inputs.day}", "{output}", --threshold, "{params.threshold}"]
//!   inputs: { day: $files.days, all: { all: clean } }
//!   params: { threshold: 2.5 }
//!   deps: [lib/*.py]
//!   output: parquet
//! ```
//!
//! The key of a node has the arguments, the parameters, the values of the variables named under `env`, and the content of
//! all that is read: inputs, `deps`, and the arguments that name files of the folder. The program runs in a folder of its own
//! (see [`workplace`]) with an environment of a few variables, so that what it does not declare is not beside it. It can
//! still read the rest of the disk by whole paths, and what it finds there is not in the key; `sandbox: true` takes that
//! away. Which version of a program `PATH` leads to is not in the key either: `version:` is for that.

mod output;
mod process;
mod sandbox;
mod template;
mod workplace;

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Component, Path, PathBuf};
use std::process::Command as Process;
use std::sync::Arc;
use std::time::Duration;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::refused;
use crate::pipeline::stage::{
    Context, Entry, Input, Inputs, KindSpec, Needs, Output, ParameterError, Part, Port, Source, Stage, StageError,
    StageSpec, Surroundings,
};
use crate::store::Store;
use output::{OutputField, Wanted};
use process::{Ended, Why};
use sandbox::{Sandbox, SandboxField};
use template::{Filling, Template};
use workplace::{DEPENDENCY, INPUTS, PARAMS, Workplace};

/// The variables that every command has from the one who runs it; they are not in the key.
const BASE: [&str; 8] = ["PATH", "HOME", "USER", "LOGNAME", "LANG", "LC_ALL", "LD_LIBRARY_PATH", "VIRTUAL_ENV"];
/// How much of a log is looked at for what to say of a failure.
const TAIL: u64 = 4096;
/// The most files that may be declared.
const MOST_FILES: usize = 10_000;

/// Parameters of `command`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Fields {
    /// The program and its arguments, in which `{inputs}`, `{inputs.NAME}`, `{output}`, `{params}`, `{params.NAME}` and
    /// `{seed}` are filled in. Arguments that name files of the folder are read by it as if they stood under `deps`.
    run: Vec<String>,
    /// What comes out: `parquet`, `files`, or a mapping that says more.
    output: OutputField,
    /// Values that it is given: in its arguments, and in the file `params.json`.
    #[serde(default, skip_serializing_if = "Map::is_empty")]
    params: Map<String, Value>,
    /// The files that it reads, by path or glob below `folder`: scripts, modules, settings.
    #[serde(default)]
    deps: Vec<String>,
    /// Names of environment variables that it is given; their values count as parameters do.
    #[serde(default)]
    env: Vec<String>,
    /// Where `deps` and the files of `run` lie; a relative path starts at the folder of the pipeline file [that folder].
    #[serde(default)]
    folder: PathBuf,
    /// Whatever tells versions of programs apart: another one makes its nodes again.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    version: Option<Value>,
    /// Whether it is shut in, so that it sees nothing but the system, its program and what it declares; needs `bwrap`.
    #[serde(default)]
    sandbox: SandboxField,
    /// The memory in GiB that it needs, so that no more runs beside it than there is room for [0.5].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    memory: Option<f64>,
    /// Whether nothing else may run beside it, because it uses all cores itself.
    #[serde(default)]
    exclusive: bool,
    /// After how many seconds it is stopped [never].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    timeout: Option<f64>,
}

/// A program of one's own.
#[derive(Debug, Clone)]
pub struct Command {
    fields: Fields,
    arguments: Vec<Template>,
    wanted: Wanted,
    ports: Vec<Port>,
    /// The folder of `deps`.
    folder: PathBuf,
    /// The variables of `env` that are set.
    variables: BTreeMap<String, String>,
    sandbox: Option<Sandbox>,
}

impl Command {
    /// The line of the register.
    pub(super) fn entry() -> Entry {
        let output = KindSpec::new("Table", 1, "parquet");
        let spec = StageSpec::new("command", 1, Vec::new(), output, "Runs a program of your own.");
        Entry::new(StageSpec { open: true, ..spec }, Self::parse, super::schema::<Fields>)
    }

    fn parse(value: &Value, surroundings: &Surroundings) -> Result<Arc<dyn Stage>, ParameterError> {
        if value.get("run").is_some_and(Value::is_string) {
            let help = Some("write a list: `run: [python, fit.py]`; for a shell `run: [sh, -c, …]`".to_owned());
            return Err(ParameterError { help, ..refused("run", "`run` is a list of the program and its arguments") });
        }
        let fields: Fields = super::parse(value)?;
        let folder = surroundings.folder.join(&fields.folder);
        let wanted = Wanted::read(&fields.output, surroundings.register)?;
        if fields.run.first().is_none_or(String::is_empty) {
            return Err(refused("run", "`run` names no program"));
        }
        let read = |(at, text): (usize, &String)| {
            Template::read(text, surroundings.inputs, &fields.params).map_err(|(message, help)| ParameterError {
                path: vec!["run".to_owned(), at.to_string()],
                message,
                help,
            })
        };
        let arguments = fields.run.iter().enumerate().map(read).collect::<Result<Vec<_>, _>>()?;
        let positive = |field: &str, value: Option<f64>| match value {
            Some(value) if !(value > 0.0 && value.is_finite()) => {
                Err(refused(field, format!("`{field}` is {value}: it must be above 0")))
            }
            _ => Ok(()),
        };
        positive("memory", fields.memory)?;
        positive("timeout", fields.timeout)?;
        for name in &fields.env {
            if name.is_empty() || name.contains(['=', '\0']) {
                return Err(refused("env", format!("`{name}` is not the name of an environment variable")));
            }
        }
        let set = |name: &String| Some((name.clone(), surroundings.variables.get(name)?.clone()));
        let command = Self {
            arguments,
            wanted,
            ports: surroundings.inputs.to_vec(),
            variables: fields.env.iter().filter_map(set).collect(),
            sandbox: fields.sandbox.read(&folder),
            folder,
            fields,
        };
        command.dependencies()?;
        Ok(Arc::new(command))
    }

    /// Returns the files that it declares, by their paths below the folder.
    fn dependencies(&self) -> Result<BTreeMap<String, PathBuf>, ParameterError> {
        let mut found = BTreeMap::new();
        for (at, pattern) in self.fields.deps.iter().enumerate() {
            let refused = |message: String, help: &str| ParameterError {
                path: vec!["deps".to_owned(), at.to_string()],
                message,
                help: Some(help.to_owned()),
            };
            if !is_below(pattern) {
                let message = format!("`{pattern}` does not lie below the folder of `deps`");
                return Err(refused(message, "let `folder` name a folder above it"));
            }
            let paths = super::files::matching(pattern, &self.folder, &|path| path.is_file());
            for path in
                paths.map_err(|message| refused(message, "paths start at the pipeline's folder, or at `folder`"))?
            {
                let name = path.strip_prefix(&self.folder).unwrap_or(&path).to_string_lossy().into_owned();
                found.insert(name, path);
            }
        }
        for argument in self.arguments.iter().filter_map(Template::plain) {
            let path = self.folder.join(argument);
            if is_below(argument) && path.is_file() {
                found.insert(argument.to_owned(), path);
            }
        }
        if found.len() > MOST_FILES {
            let message = format!("`deps` are {} files, at most {MOST_FILES} are copied to each command", found.len());
            return Err(refused("deps", message));
        }
        let taken = [INPUTS, PARAMS, self.wanted.name()];
        let clash = found.keys().find(|name| taken.contains(&name.split('/').next().unwrap_or_default()));
        match clash {
            Some(name) => {
                Err(refused("deps", format!("`{name}` would be in the way of `{}`: rename it", taken.join("`, `"))))
            }
            None => Ok(found),
        }
    }

    fn program(&self, inputs: &Inputs, place: &Workplace, context: &Context) -> Result<Process, StageError> {
        let input = |name: &str| format!("{INPUTS}/{}", self.input_name(name, inputs));
        let output = self.wanted.name();
        let filling = Filling { inputs: INPUTS, input: &input, output, params: PARAMS, seed: context.seed };
        let mut line: Vec<_> = self.arguments.iter().map(|argument| argument.fill(&filling).into()).collect();
        if let Some(sandbox) = &self.sandbox {
            let program = self.fields.run[0].as_str();
            let mut enclosed = sandbox.enclose(program, place)?;
            enclosed.append(&mut line);
            line = enclosed;
        }
        let mut process = Process::new(&line[0]);
        process.args(&line[1..]).current_dir(&place.work).env_clear();
        for name in BASE {
            process.envs(std::env::var_os(name).map(|value| (name, value)));
        }
        let temporary = if self.sandbox.is_some() { Path::new("/tmp") } else { &place.temporary };
        process.env("TMPDIR", temporary);
        process.envs([("TRODDEN_INPUTS", INPUTS), ("TRODDEN_OUTPUT", output), ("TRODDEN_PARAMS", PARAMS)]);
        if self.is_seeded() {
            process.env("TRODDEN_SEED", context.seed.to_string());
        }
        process.envs(&self.variables);
        Ok(process)
    }

    /// Returns the name of an input's file or folder below `inputs/`; `port/member` is a member of a group.
    fn input_name(&self, whole: &str, inputs: &Inputs) -> String {
        let (port, member) = whole.split_once('/').map_or((whole, None), |(port, member)| (port, Some(member)));
        let artifact = match (inputs.ports.get(port), member) {
            (Some(Input::One(artifact)), _) => artifact,
            (Some(Input::Group(members)), Some(member)) => &members[member],
            _ => return port.to_owned(),
        };
        let name = member.unwrap_or(port);
        let extension = inputs.extensions.get(whole).map_or("", |extension| extension);
        if artifact.is_bundle() || extension.is_empty() { name.to_owned() } else { format!("{name}.{extension}") }
    }

    fn is_seeded(&self) -> bool {
        self.arguments.iter().any(Template::has_seed)
    }

    /// Says how the program ended if that was not well.
    fn judge(&self, ended: &Ended, place: &Workplace, context: &Context) -> Result<(), StageError> {
        let program = &self.fields.run[0];
        let failed = |message: String, help: Option<String>| Err(StageError::Failed { message, help, source: None });
        match ended.why {
            Why::Cancelled => return Err(StageError::Cancelled),
            Why::TimedOut => {
                let message = format!("`{program}` was stopped after {} s", self.fields.timeout.unwrap_or_default());
                return failed(message, Some("raise `timeout`, or leave it out".to_owned()));
            }
            Why::Itself if ended.status.success() => return Ok(()),
            Why::Itself => {}
        }
        let said = last_line(&place.log).map(|line| format!(": {line}")).unwrap_or_default();
        let help = format!("`trodden log {}` shows all that it printed", context.node);
        failed(format!("`{program}` ended with {}{said}", ended.status), Some(help))
    }
}

/// Tells whether a path leads from a folder to something below it, whatever that is.
fn is_below(path: &str) -> bool {
    !path.is_empty()
        && Path::new(path).components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir))
}

/// Returns the last line of a log that says something.
fn last_line(log: &Path) -> Option<String> {
    let bytes = std::fs::read(log).ok()?;
    let tail = &bytes[bytes.len().saturating_sub(TAIL as usize)..];
    let text = String::from_utf8_lossy(tail);
    text.lines().rev().map(str::trim).find(|line| !line.is_empty()).map(str::to_owned)
}

impl Stage for Command {
    fn parameters(&self) -> Value {
        let mut parameters = super::to_json(&self.fields);
        // None of these changes what it computes, and the content of the files counts, not where they lie.
        for field in ["memory", "exclusive", "timeout", "sandbox", "deps", "env", "folder"] {
            parameters.as_object_mut().expect("fields are an object").remove(field);
        }
        parameters
    }

    fn own_spec(&self) -> Option<StageSpec> {
        let Self { ports, wanted, .. } = self;
        let spec = StageSpec::new("command", 1, ports.clone(), wanted.kind.clone(), "Runs a program of your own.");
        Some(StageSpec { open: true, seeded: self.is_seeded(), ..spec })
    }

    fn sources(&self) -> Result<Vec<Source>, StageError> {
        let files = self.dependencies().map_err(|error| StageError::Failed {
            message: error.message,
            help: error.help,
            source: None,
        })?;
        Ok(files.into_iter().map(|(name, path)| Source { role: format!("{DEPENDENCY}{name}"), path }).collect())
    }

    fn environment(&self) -> BTreeMap<String, String> {
        self.variables.iter().map(|(name, value)| (format!("env:{name}"), value.clone())).collect()
    }

    fn needs(&self, _: Part, _: &Inputs, _: &Store) -> Needs {
        const GIB: f64 = (1u64 << 30) as f64;
        let memory = (self.fields.memory.unwrap_or(0.5) * GIB) as u64;
        Needs { memory, exclusive: self.fields.exclusive }
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let params = serde_json::to_vec_pretty(&self.fields.params).expect("parameters are JSON");
        let names = |port: &str| self.input_name(port, inputs);
        let place = Workplace::prepare(inputs, &names, &params, context)?;
        let output = place.work.join(self.wanted.name());
        if self.wanted.form == output::Form::Files {
            std::fs::create_dir(&output).map_err(|error| workplace::unwritten(&output, error))?;
        }
        let log = File::create(&place.log).map_err(|error| workplace::unwritten(&place.log, error))?;
        let mut program = self.program(inputs, &place, context)?;
        let timeout = self.fields.timeout.map(Duration::from_secs_f64);
        let ended = process::run(&mut program, log, timeout, context.cancelled);
        let done = ended.map_err(|error| self.not_started(error)).and_then(|ended| {
            (context.used)(ended.memory);
            self.judge(&ended, &place, context)?;
            place.check_inputs()?;
            self.wanted.take(&output, context.store)
        });
        context.store.keep_log(&context.key, &place.log)?;
        done
    }
}

impl Command {
    fn not_started(&self, error: std::io::Error) -> StageError {
        let program = &self.fields.run[0];
        let help = match error.kind() {
            std::io::ErrorKind::NotFound => "install it, or declare it under `deps` if it lies in the folder",
            std::io::ErrorKind::PermissionDenied => "make it executable, or name the program that runs it first",
            _ => "the rest of the message says what stands in the way",
        };
        StageError::Failed {
            message: format!("failed to start `{program}`"),
            help: Some(help.to_owned()),
            source: Some(Box::new(error)),
        }
    }
}

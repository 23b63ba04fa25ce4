//! Commands that go on: `watch` and `status --follow`.

use std::io::{BufRead, BufReader, Lines};
use std::process::{Child, ChildStdout, Command, Stdio};

use serde_json::Value;

use super::{PIPELINE, Place};

/// A command that prints events until it is told to end.
struct Live {
    child: Child,
    lines: Lines<BufReader<ChildStdout>>,
}

impl Live {
    fn start(place: &Place, words: &[&str]) -> Self {
        let mut command = place.command(words);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("starts");
        let lines = BufReader::new(child.stdout.take().expect("is piped")).lines();
        Self { child, lines }
    }

    /// Reads events up to the next of a name.
    fn until(&mut self, name: &str) -> Value {
        loop {
            let line = self.lines.next().unwrap_or_else(|| panic!("`{name}` is told of")).expect("reads");
            let event: Value = serde_json::from_str(&line).expect("is JSON");
            if event["event"] == name {
                return event;
            }
        }
    }

    fn interrupt(&self) {
        interrupt(self.child.id());
    }

    fn end(mut self) -> Option<i32> {
        self.lines.by_ref().for_each(drop);
        self.child.wait().expect("ends").code()
    }
}

fn interrupt(process: u32) {
    let sent = Command::new("kill").args(["-INT", &process.to_string()]).status().expect("starts");
    assert!(sent.success());
}

#[test]
fn watching_runs_again_when_a_file_changes_and_outlives_mistakes() {
    let place = Place::empty();
    // Each map is another one: what is made of equal maps is made once.
    let describe = |name: &str| {
        let free = 1600 - name.len() - usize::from(name == "two");
        let map = "P2\n40 40\n255\n".to_owned() + &"255 ".repeat(free) + &"0 ".repeat(1600 - free);
        place.write(&format!("maps/{name}.pgm"), map);
        let text = format!(
            "image: {name}.pgm\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
        );
        place.write(&format!("maps/{name}.yaml"), text);
    };
    describe("one");
    let file = |episodes: &str| {
        format!(
            "maps: {{ all: {{ files: \"maps/*.yaml\" }} }}\nstages:\n  walks: {{ use: simulate, map: $maps, episodes: {episodes}, duration: 2 }}\n"
        )
    };
    place.write("small.yaml", file("1"));
    let mut watch = Live::start(&place, &["watch", "small.yaml", "--json", "--jobs", "1"]);
    let first = watch.until("run");
    assert_eq!((&first["ran"], &first["status"]), (&3.into(), &"finished".into()), "{first}");
    // The pipeline, the description and the picture.
    assert_eq!(watch.until("watching")["files"], 3);

    place.write("small.yaml", file("2"));
    let changed = watch.until("changed");
    assert_eq!(changed["files"], serde_json::json!([{ "file": "small.yaml", "what": "changed" }]));
    assert_eq!(watch.until("run")["ran"], 2);
    watch.until("watching");

    place.write("small.yaml", file("many"));
    let faulty = watch.until("faulty");
    assert!(faulty["message"].as_str().is_some_and(|message| message.contains("episodes")), "{faulty}");
    watch.until("watching");
    place.write("small.yaml", file("2"));
    assert_eq!(watch.until("run")["ran"], 0);
    watch.until("watching");

    // A file that the pattern finds only now.
    describe("two");
    let files = watch.until("changed")["files"].clone();
    assert!(files.to_string().contains("two.yaml") && !files.to_string().contains("one"), "{files}");
    assert_eq!(watch.until("run")["ran"], 3);
    watch.until("watching");
    watch.interrupt();
    assert_eq!(watch.end(), Some(0));
}

#[test]
fn a_run_is_followed_from_another_process_to_its_end() {
    let place = Place::empty();
    assert_eq!(place.run(&["status", "--follow"]).code, Some(2));
    place.write("long.yaml", PIPELINE.replace("episodes: 12", "episodes: 4000"));
    let mut run = Live::start(&place, &["run", "long.yaml", "--json", "--jobs", "1"]);
    let id = run.until("run_started")["id"].clone();
    run.until("node");
    // Somebody must read what it prints, or it gets no further.
    let process = run.child.id();
    let run = std::thread::spawn(move || run.end());
    let mut follow = Live::start(&place, &["status", "--follow", "--json"]);
    let started = follow.until("run_started");
    assert_eq!((&started["id"], &started["pipeline"]), (&id, &"long".into()));
    assert!(started["nodes"].as_u64().is_some_and(|nodes| nodes > 1000), "{started}");
    let node = follow.until("node");
    assert_eq!((&node["node"], &node["outcome"]), (&"maps/home_00".into(), &"ran".into()));
    interrupt(process);
    let end = follow.until("run");
    assert_eq!((&end["id"], &end["status"]), (&id, &"interrupted".into()));
    assert_eq!((follow.end(), run.join().expect("does not panic")), (Some(130), Some(130)));
    // One that is over is told of at once.
    let again = Live::start(&place, &["status", "--follow", "--json", "--run", id.as_str().expect("an id")]);
    assert_eq!(again.end(), Some(130));
}

//! Pages as a browser has them: loaded from a file, in a window of 1200 × 800 pixels that nobody sees, driven by scripts.
//!
//! The browser takes orders over its standard input and output, in the DevTools protocol: JSON, each message ended by a zero.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use serde_json::{Value, json};
use tempfile::TempDir;

use super::needs::Need;

/// Keeps what goes wrong in a page.
const WATCH: &str = "
window.wrongs = [];
addEventListener('error', event => window.wrongs.push(String(event.message)));
addEventListener('unhandledrejection', event => window.wrongs.push(String(event.reason)));
console.error = console.warn = (...said) => window.wrongs.push(said.join(' '));
";

/// What scripts may use.
const TOOLS: &str = "
var sleep = ms => new Promise(done => setTimeout(done, ms));
var painted = () => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)));
var until = async what => {
    for (let i = 0; i < 800; i++) {
        if (what()) return;
        await sleep(25);
    }
    throw new Error('it does not happen: ' + what);
};
";

/// A page in a browser.
pub struct Page {
    browser: Child,
    orders: ChildStdin,
    answers: BufReader<ChildStdout>,
    session: Option<String>,
    sent: u64,
    _profile: TempDir,
}

impl Page {
    /// Opens a page; `first` is a script that runs before those of the page. `None` where no browser is installed.
    pub fn open(path: &Path, first: &str) -> Option<Self> {
        let profile = tempfile::tempdir().expect("creates");
        let flags = "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking \
                     --disable-component-update --disable-sync --remote-debugging-pipe";
        if !Need::Browser.runs("chromium", &["--version"]) {
            return None;
        }
        // It listens to descriptor 3 and answers on 4.
        let mut browser = Command::new("sh")
            .args(["-c", "exec chromium \"$@\" 3<&0 4>&1 </dev/null >/dev/null", "sh"])
            .args(flags.split_whitespace())
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("a shell runs");
        let orders = browser.stdin.take().expect("it is piped");
        let answers = BufReader::new(browser.stdout.take().expect("it is piped"));
        let mut page = Self { browser, orders, answers, session: None, sent: 0, _profile: profile };
        let target = page.order("Target.createTarget", &json!({ "url": "about:blank" }))["targetId"].clone();
        let session = page.order("Target.attachToTarget", &json!({ "targetId": target, "flatten": true }));
        page.session = session["sessionId"].as_str().map(str::to_owned);
        page.order("Page.enable", &json!({}));
        let size = json!({ "width": 1200, "height": 800, "deviceScaleFactor": 1, "mobile": false });
        page.order("Emulation.setDeviceMetricsOverride", &size);
        page.order("Page.addScriptToEvaluateOnNewDocument", &json!({ "source": format!("{WATCH}{first}") }));
        page.light("light");
        page.order("Page.navigate", &json!({ "url": format!("file://{}", path.display()) }));
        while page.next()["method"] != "Page.loadEventFired" {}
        page.run(TOOLS);
        Some(page)
    }

    /// Has the page think that its reader likes it `light` or `dark`.
    pub fn light(&mut self, light: &str) {
        let features = json!([{ "name": "prefers-color-scheme", "value": light }]);
        self.order("Emulation.setEmulatedMedia", &json!({ "features": features }));
    }

    /// Runs a script and returns what it is or resolves to.
    pub fn run(&mut self, script: &str) -> Value {
        let order = json!({ "expression": script, "awaitPromise": true, "returnByValue": true });
        let answer = self.order("Runtime.evaluate", &order);
        assert!(answer["exceptionDetails"].is_null(), "{:#}", answer["exceptionDetails"]);
        answer["result"]["value"].clone()
    }

    /// Fails if something went wrong in the page.
    pub fn check(&mut self) {
        assert_eq!(self.run("window.wrongs"), json!([]));
    }

    fn order(&mut self, method: &str, parameters: &Value) -> Value {
        self.sent += 1;
        let mut order = json!({ "id": self.sent, "method": method, "params": parameters });
        if let Some(session) = &self.session {
            order["sessionId"] = json!(session);
        }
        self.orders.write_all(format!("{order}\0").as_bytes()).expect("the browser listens");
        loop {
            let mut answer = self.next();
            if answer["id"] == self.sent {
                assert!(answer["error"].is_null(), "{method}: {}", answer["error"]);
                return answer["result"].take();
            }
        }
    }

    fn next(&mut self) -> Value {
        let mut bytes = Vec::new();
        self.answers.read_until(0, &mut bytes).expect("the browser answers");
        assert_eq!(bytes.pop(), Some(0), "the browser is gone");
        serde_json::from_slice(&bytes).expect("JSON")
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        // It ends by itself when nobody gives orders any more; this is quicker.
        let _ = self.browser.kill();
        let _ = self.browser.wait();
    }
}

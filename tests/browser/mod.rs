//! A headless Chromium, driven over its debugging pipe (the Chrome DevTools Protocol, JSON messages
//! that end in a zero byte).

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

/// Far longer than anything here takes, on a busy machine too: it ends tests that hang.
const PATIENCE: Duration = Duration::from_secs(120);

const FLAGS: [&str; 10] = [
    "--headless",
    "--remote-debugging-pipe",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--disable-dev-shm-usage",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
];

/// A browser with one page. It ends with the value.
pub struct Browser {
    process: Child,
    commands: Option<ChildStdin>,
    messages: Receiver<Value>,
    session: Option<String>,
    next_id: u64,
    /// Console messages, exceptions and failed loads since the page was opened.
    complaints: Vec<String>,
    /// Addresses of everything the page asked for.
    requests: Vec<String>,
    _profile: tempfile::TempDir,
}

/// How a page is looked at.
#[derive(Clone, Copy)]
pub struct Screen {
    pub width: u32,
    pub height: u32,
    pub pixel_ratio: f64,
    pub dark: bool,
}

impl Screen {
    pub const PHONE: Self = Self { width: 390, height: 844, pixel_ratio: 2.0, dark: false };
    pub const DESKTOP: Self = Self { width: 1280, height: 800, pixel_ratio: 1.0, dark: false };
}

fn find_chromium() -> PathBuf {
    if let Some(path) = std::env::var_os("CHROMIUM") {
        return path.into();
    }
    let names = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];
    let folders: Vec<_> = std::env::split_paths(&std::env::var_os("PATH").unwrap_or_default()).collect();
    let found = names
        .iter()
        .flat_map(|name| folders.iter().map(move |folder| folder.join(name)))
        .find(|path| path.is_file());
    found.unwrap_or_else(|| {
        panic!(
            "no Chromium found, and without one nobody knows whether the replay page draws: run scripts/test, \
             which installs it, or install it yourself (Debian and Ubuntu: apt-get install chromium), or set \
             CHROMIUM to its path"
        )
    })
}

impl Browser {
    pub fn start() -> Self {
        let profile = tempfile::tempdir().expect("a folder for the profile");
        // The debugging pipe is file descriptors 3 and 4, which the shell ties to ours.
        let mut process = Command::new("sh")
            .args(["-c", "exec \"$0\" \"$@\" 3<&0 4>&1 </dev/null >/dev/null 2>&1"])
            .arg(find_chromium())
            .args(FLAGS)
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the shell starts");
        let commands = process.stdin.take();
        let mut replies = BufReader::new(process.stdout.take().expect("stdout is piped"));
        let (sender, messages) = channel();
        std::thread::spawn(move || {
            let mut bytes = Vec::new();
            while replies.read_until(0, &mut bytes).is_ok_and(|read| read > 0) {
                bytes.pop();
                let message = serde_json::from_slice(&bytes).expect("Chromium speaks JSON");
                if sender.send(message).is_err() {
                    return;
                }
                bytes.clear();
            }
        });
        let (complaints, requests) = (Vec::new(), Vec::new());
        Self {
            process,
            commands,
            messages,
            session: None,
            next_id: 0,
            complaints,
            requests,
            _profile: profile,
        }
    }

    /// Opens a local file in a fresh page and waits until it has loaded.
    pub fn open(&mut self, file: &Path, screen: Screen) {
        self.session = None;
        self.complaints.clear();
        self.requests.clear();
        let target = self.call("Target.createTarget", json!({ "url": "about:blank" }));
        let session =
            self.call("Target.attachToTarget", json!({ "targetId": target["targetId"], "flatten": true }));
        self.session = session["sessionId"].as_str().map(str::to_owned);
        for domain in ["Page", "Runtime", "Log", "Network"] {
            self.call(&format!("{domain}.enable"), json!({}));
        }
        let mobile = screen.width < 600;
        self.call(
            "Emulation.setDeviceMetricsOverride",
            json!({ "width": screen.width, "height": screen.height, "deviceScaleFactor": screen.pixel_ratio, "mobile": mobile }),
        );
        let scheme = if screen.dark { "dark" } else { "light" };
        self.call(
            "Emulation.setEmulatedMedia",
            json!({ "features": [{ "name": "prefers-color-scheme", "value": scheme }] }),
        );
        let url = format!("file://{}", file.canonicalize().expect("the page exists").display());
        self.call("Page.navigate", json!({ "url": url }));
        self.wait_for("document.readyState === 'complete' && location.protocol === 'file:'");
    }

    /// Calls a method and returns its result.
    pub fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.next_id += 1;
        let id = self.next_id;
        let mut message = json!({ "id": id, "method": method, "params": parameters });
        if let Some(session) = &self.session {
            message["sessionId"] = json!(session);
        }
        let commands = self.commands.as_mut().expect("the pipe is open until the end");
        let sent = commands.write_all(format!("{message}\0").as_bytes()).and_then(|()| commands.flush());
        if let Err(error) = sent {
            panic!("Chromium is gone ({error}) before {method}");
        }
        let deadline = Instant::now() + PATIENCE;
        loop {
            let reply = match self.messages.recv_timeout(deadline - Instant::now()) {
                Ok(reply) => reply,
                Err(RecvTimeoutError::Timeout) => panic!("no answer to {method} within {PATIENCE:?}"),
                Err(RecvTimeoutError::Disconnected) => panic!("Chromium ended without an answer to {method}"),
            };
            if reply["id"] == id {
                assert!(reply["error"].is_null(), "{method}: {}", reply["error"]);
                return reply["result"].clone();
            }
            self.note(&reply);
        }
    }

    fn note(&mut self, event: &Value) {
        let parameters = &event["params"];
        match event["method"].as_str() {
            Some("Runtime.exceptionThrown") => {
                self.complaints.push(parameters["exceptionDetails"].to_string());
            }
            Some("Runtime.consoleAPICalled" | "Log.entryAdded" | "Page.javascriptDialogOpening") => {
                self.complaints.push(parameters.to_string());
            }
            Some("Network.requestWillBeSent") => {
                self.requests.extend(parameters["request"]["url"].as_str().map(str::to_owned));
            }
            _ => {}
        }
    }

    /// The value of a JavaScript expression in the page.
    pub fn eval(&mut self, expression: &str) -> Value {
        let reply = self.call(
            "Runtime.evaluate",
            json!({ "expression": expression, "returnByValue": true, "awaitPromise": true }),
        );
        assert!(reply["exceptionDetails"].is_null(), "{expression}: {}", reply["exceptionDetails"]);
        reply["result"]["value"].clone()
    }

    /// Waits until an expression is true.
    pub fn wait_for(&mut self, expression: &str) {
        let deadline = Instant::now() + PATIENCE;
        while self.eval(expression) != json!(true) {
            assert!(Instant::now() < deadline, "never came true: {expression}; {:?}", self.complaints);
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Presses and releases a key.
    pub fn press(&mut self, key: &str) {
        let text = if key.len() == 1 { key } else { "" };
        for kind in ["keyDown", "keyUp"] {
            let text = if kind == "keyDown" { text } else { "" };
            self.call(
                "Input.dispatchKeyEvent",
                json!({ "type": kind, "key": key, "code": key, "text": text }),
            );
        }
    }

    /// The middle of the element that a selector names, scrolled into view.
    pub fn middle_of(&mut self, selector: &str) -> (f64, f64) {
        let place = self.eval(&format!(
            "(() => {{ const e = document.querySelector({selector:?}); e.scrollIntoView({{ block: 'center' }}); \
             const b = e.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; }})()"
        ));
        (place[0].as_f64().expect("a place"), place[1].as_f64().expect("a place"))
    }

    /// Clicks on the middle of an element.
    pub fn click(&mut self, selector: &str) {
        let (x, y) = self.middle_of(selector);
        self.drag((x, y), (x, y));
    }

    /// Presses the mouse at one place and releases it at another.
    pub fn drag(&mut self, from: (f64, f64), to: (f64, f64)) {
        let mut mouse = |kind: &str, (x, y): (f64, f64), buttons: u32| {
            self.call(
                "Input.dispatchMouseEvent",
                json!({ "type": kind, "x": x, "y": y, "button": "left", "buttons": buttons, "clickCount": 1 }),
            )
        };
        mouse("mousePressed", from, 1);
        if from != to {
            mouse("mouseMoved", to, 1);
        }
        mouse("mouseReleased", to, 0);
    }

    /// A picture of what is visible, as base64 of a PNG.
    pub fn screenshot(&mut self) -> String {
        let reply = self.call("Page.captureScreenshot", json!({ "format": "png" }));
        reply["data"].as_str().expect("a picture").to_owned()
    }

    /// Fails where the page complained in the console or asked for anything but files.
    pub fn assert_quiet(&mut self) {
        self.eval("0");
        assert!(self.complaints.is_empty(), "the page complains: {:#?}", self.complaints);
        let outside: Vec<_> = self.requests.iter().filter(|url| !url.starts_with("file://")).collect();
        assert!(!self.requests.is_empty() && outside.is_empty(), "the page asks for {outside:?}");
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // Chromium ends when its pipe closes; a kill makes sure.
        self.commands = None;
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

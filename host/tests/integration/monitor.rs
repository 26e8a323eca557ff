//! The live monitor, from its feed to the WebSocket of a viewer.

use std::io::ErrorKind;
use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};

use damprig::monitor::feed::{Feed, Update, Watched};
use damprig::monitor::message::{Activity, Level, Limits, MeasuredPoint, SourceKind, WatchedSource};
use damprig::monitor::numbers::SignalName;
use damprig::monitor::{Handles, Monitor, Permissions, Serving, Token};
use damprig_core::io::{Sensor, SensorSet};
use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest;
use tungstenite::http::StatusCode;
use tungstenite::{Message, WebSocket};

pub const PATIENCE: Duration = Duration::from_secs(60);

pub fn monitor(token: Option<Token>, handles: Handles) -> Monitor {
    let listen = Some(SocketAddr::from(([127, 0, 0, 1], 0)));
    let permissions =
        Permissions { can_control: token.is_some(), where_to_stop: "Stop: here.".into(), ..Permissions::default() };
    let monitor = Monitor::start(Some(Serving { listen, token }), permissions, handles).expect("a free port");
    monitor.feed().send(watched("sweep"));
    monitor
}

fn watched(name: &str) -> Update {
    watched_signals(name, &["x", "z"])
}

fn watched_signals(name: &str, signals: &[&str]) -> Update {
    watched_table(name, signals, &["x_over_z_lock_in"])
}

fn watched_table(name: &str, signals: &[&str], table: &[&str]) -> Update {
    let signal = |name: &&str| SignalName { name: (*name).into(), unit: "m".into() };
    Update::Watch(Box::new(Watched {
        source: WatchedSource {
            kind: SourceKind::Run,
            name: name.into(),
            rig: "virtual".into(),
            board: "virtual".into(),
            folder: None,
        },
        signals: signals.iter().map(signal).collect(),
        table: table.iter().map(|name| SignalName::of(name)).collect(),
        curves: Vec::new(),
        points_planned: 3,
        limits: Limits::default(),
    }))
}

/// Rows from `first` on, 1 ms apart; x is the number of its row.
fn rows(first: u32, count: u32) -> Update {
    let t_s = (first..first + count).map(|row| f64::from(row) * 1e-3).collect();
    let values = (first..first + count).flat_map(|row| [row as f32, 0.0]).collect();
    Update::Rows { t_s, values, longest_step_s: 1.5e-3 }
}

fn point(frequency_hz: f64) -> Update {
    Update::Point(MeasuredPoint {
        set_up: "bare".into(),
        experiment: "sweep".into(),
        index: (frequency_hz * 10.0) as u32,
        frequency_hz,
        x_over_z: Some(3.5),
        x_over_z_lock_in: None,
        mean_cycle_max_m: None,
        x_amplitude_m: None,
        z_amplitude_m: None,
        phase_rad: None,
        steadiness: "steady".into(),
    })
}

pub fn address(monitor: &Monitor) -> String {
    let url = monitor.url().expect("a page");
    url.trim_start_matches("http://").split('/').next().expect("an address").to_string()
}

/// A viewer's connection.
pub struct Viewer(pub WebSocket<TcpStream>);

impl Viewer {
    pub fn join(monitor: &Monitor) -> Self {
        Self::connect(&address(monitor), None).expect("the monitor accepts a viewer")
    }

    pub fn connect(address: &str, origin: Option<&str>) -> Result<Self, StatusCode> {
        Self::connect_with(address, origin.map(|origin| ("Origin", origin.to_string())))
    }

    /// A viewer with the token, as the page is one.
    pub fn with_token(address: &str, token: &str) -> Result<Self, StatusCode> {
        Self::connect_with(address, Some(("Sec-WebSocket-Protocol", format!("damprig, token.{token}"))))
    }

    fn connect_with(address: &str, header: Option<(&'static str, String)>) -> Result<Self, StatusCode> {
        let stream = TcpStream::connect(address).expect("the monitor listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("a timeout");
        let mut request = format!("ws://{address}/live").into_client_request().expect("an address");
        if let Some((name, value)) = header {
            request.headers_mut().insert(name, value.parse().expect("a header"));
        }
        match tungstenite::client(request, stream) {
            Ok((socket, _)) => Ok(Self(socket)),
            Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(answer))) => Err(answer.status()),
            Err(error) => panic!("{error}"),
        }
    }

    /// The next message; none when the monitor has closed the connection.
    pub fn next(&mut self) -> Option<Value> {
        loop {
            match self.0.read() {
                Ok(Message::Text(text)) => return Some(serde_json::from_str(&text).expect("JSON")),
                Ok(Message::Close(_)) | Err(tungstenite::Error::ConnectionClosed) => return None,
                Err(tungstenite::Error::Io(error)) if error.kind() == ErrorKind::ConnectionReset => return None,
                Err(tungstenite::Error::Protocol(_)) => return None,
                // The process has children; one that ends may interrupt a read.
                Err(tungstenite::Error::Io(error)) if error.kind() == ErrorKind::Interrupted => {}
                Ok(_) => {}
                Err(error) => panic!("{error}"),
            }
        }
    }

    /// Messages up to the one of which `is_it` says so.
    pub fn until(&mut self, is_it: impl Fn(&Value) -> bool) -> Vec<Value> {
        let begun = Instant::now();
        let mut all = Vec::new();
        while begun.elapsed() < PATIENCE {
            all.push(self.next().expect("the monitor goes on"));
            if is_it(&all[all.len() - 1]) {
                return all;
            }
        }
        panic!("not among {} messages; the last: {:?}", all.len(), all.last());
    }

    /// Reads until the monitor closes the connection.
    pub fn until_closed(&mut self) {
        let begun = Instant::now();
        while self.next().is_some() {
            assert!(begun.elapsed() < PATIENCE, "the connection is still open");
        }
    }

    /// Sends an action without waiting for its answer.
    pub fn send(&mut self, action: &Value) {
        self.0.send(Message::text(action.to_string())).expect("a connection");
    }

    pub fn ask(&mut self, action: Value) -> Value {
        self.send(&action);
        self.until(|message| message["kind"] == "answer").pop().expect("an answer")
    }
}

fn last_t_s(message: &Value) -> Option<f64> {
    message["rows"]["t_s"].as_array()?.last()?.as_f64()
}

/// Waits until the monitor has taken everything that was told it.
fn settle(feed: &Feed, viewer: &mut Viewer, mark: &str) {
    feed.log(Level::Info, mark);
    viewer.until(|message| message["log"].as_array().is_some_and(|log| log.iter().any(|line| line["text"] == mark)));
}

#[test]
fn a_viewer_sees_rows_points_and_state_as_they_come() {
    let monitor = monitor(None, Handles::default());
    let mut viewer = Viewer::join(&monitor);
    let first = viewer.next().unwrap();
    assert_eq!((&first["kind"], &first["source"]["name"]), (&json!("snapshot"), &json!("sweep")));
    assert_eq!(first["signals"][0], json!({"name": "x", "unit": "m"}));
    let feed = monitor.feed();
    feed.send(rows(1, 50));
    feed.send(point(2.5));
    feed.send(Update::Activity(Activity::Running, "Running: set-up bare".into()));
    let frames = viewer.until(|message| message["state"]["activity"] == "running");
    let point = frames.iter().find_map(|frame| frame["points"].get(0)).unwrap();
    assert_eq!((&point["frequency_hz"], &point["x_over_z"]), (&json!(2.5), &json!(3.5)));
    let shown: Vec<f64> =
        frames.iter().filter_map(|f| f["rows"]["values"]["x"].as_array()).flatten().filter_map(Value::as_f64).collect();
    assert_eq!(shown, (1..=50).map(f64::from).collect::<Vec<f64>>());
    monitor.end();
    while let Some(message) = viewer.next() {
        assert_eq!(message["kind"], "frame");
    }
}

#[test]
fn a_late_viewer_gets_the_recent_history() {
    let monitor = monitor(None, Handles::default());
    let (feed, mut early) = (monitor.feed(), Viewer::join(&monitor));
    (0..100).for_each(|block| feed.send(rows(1 + 1000 * block, 1000)));
    feed.send(point(2.4));
    settle(&feed, &mut early, "told");
    let snapshot = Viewer::join(&monitor).next().unwrap();
    let t_s = snapshot["rows"]["t_s"].as_array().unwrap();
    let (first, last) = (t_s[0].as_f64().unwrap(), t_s[t_s.len() - 1].as_f64().unwrap());
    // Between 20 s and half as much again.
    assert!(last == 100.0 && (70.0..=80.1).contains(&first), "{first} to {last}");
    // Reduced, with its extremes.
    assert!(t_s.len() <= 4400, "{}", t_s.len());
    assert_eq!(snapshot["rows"]["values"]["x"].as_array().unwrap().last(), Some(&json!(100_000.0)));
    assert_eq!(snapshot["points"][0]["frequency_hz"], 2.4);
}

#[test]
fn a_viewer_that_reads_nothing_delays_nobody_and_catches_up_with_a_snapshot() {
    let monitor = monitor(None, Handles::default());
    let (feed, mut viewer, mut sleeper) = (monitor.feed(), Viewer::join(&monitor), Viewer::join(&monitor));
    viewer.next();
    // Wide rows: many times what the sockets of a sleeping viewer hold.
    let names: Vec<String> = (0..40).map(|n| format!("s{n}")).collect();
    feed.send(watched_signals("wide", &names.iter().map(String::as_str).collect::<Vec<_>>()));
    for block in 0..100u32 {
        let t_s = (1..=500).map(|row| f64::from(500 * block + row) * 1e-3).collect();
        let values = (0..20_000).map(|n| 0.1 + n as f32).collect();
        feed.send(Update::Rows { t_s, values, longest_step_s: 1.5e-3 });
        settle(&feed, &mut viewer, &format!("block {block}"));
    }
    let all = sleeper.until(|message| last_t_s(message).is_some_and(|t_s| t_s >= 50.0));
    // Those of its start, and at least one after it was too slow.
    let snapshots = all.iter().filter(|message| message["kind"] == "snapshot").count();
    assert!(snapshots >= 2 && all.len() < 100, "{snapshots} snapshots among {} messages", all.len());
}

#[test]
fn a_slow_monitor_skips_rows_and_counts_them_but_never_results() {
    let monitor = monitor(None, Handles::default());
    let (feed, mut viewer) = (monitor.feed(), Viewer::join(&monitor));
    for n in 0..20_000 {
        feed.send(rows(1 + 100 * n, 100));
    }
    [2.0, 2.5, 3.0].into_iter().for_each(|f| feed.send(point(f)));
    let all = viewer.until(|message| message["state"]["points_taken"] == 3);
    assert_eq!(all[all.len() - 1]["state"]["link"]["dropped_rows"], 0);
}

#[test]
fn gaps_and_values_that_are_no_numbers_are_null() {
    let monitor = monitor(None, Handles::default());
    let (feed, mut viewer) = (monitor.feed(), Viewer::join(&monitor));
    viewer.next();
    feed.send(rows(1, 2));
    feed.send(Update::Rows { t_s: vec![0.5], values: vec![f32::NAN, f32::INFINITY], longest_step_s: 1.5e-3 });
    feed.send(Update::Values { rig_s: 0.5, tick: 500, values: vec![f32::NAN] });
    settle(&feed, &mut viewer, "told");
    let snapshot = Viewer::join(&monitor).next().unwrap();
    assert_eq!(snapshot["rows"]["t_s"], json!([0.001, 0.002, 0.002, 0.5]));
    assert_eq!(snapshot["rows"]["values"]["x"], json!([1.0, 2.0, null, null]));
    assert_eq!(snapshot["state"]["numbers"]["x_over_z_lock_in"], Value::Null);
}

#[test]
fn a_sensor_without_a_signal_has_no_number_and_an_alarm() {
    let monitor = monitor(None, Handles::default());
    let (feed, mut viewer) = (monitor.feed(), Viewer::join(&monitor));
    // The last one is of a device that is newer than the monitor.
    let table = ["frequency", "x", "z", "x_amplitude", "x_peak", "torque"];
    feed.send(watched_table("rig", &["x", "z"], &table));
    feed.send(Update::Activity(Activity::Idle, "The rig is idle.".into()));
    let values = |x: f32| Update::Values { rig_s: 1.5, tick: 1500, values: vec![0.0, x, 0.5, 0.0, 2.0, 3.0] };
    // Rows give the mean over the last second: rows 501 to 1500.
    feed.send(rows(1, 1500));
    feed.send(values(7.0));
    settle(&feed, &mut viewer, "measured");
    let numbers = |viewer: &mut Viewer, what: &str| {
        feed.log(Level::Info, what);
        let all = viewer.until(|message| message["log"].to_string().contains(what));
        all[all.len() - 1]["state"].clone()
    };
    let state = numbers(&mut viewer, "before");
    let mean = state["numbers"]["x_mean_m"].as_f64().unwrap();
    assert!((mean - 1000.0).abs() <= 1.0, "{mean}");
    assert_eq!((&state["numbers"]["x_amplitude_m"], &state["alarms"]), (&Value::Null, &json!([])));
    assert_eq!((&state["numbers"]["x_peak_m"], &state["numbers"]["torque"]), (&json!(2.0), &json!(3.0)));
    let mut lost = SensorSet::default();
    lost.insert(Sensor::X);
    feed.send(Update::LostSensors(lost));
    let state = numbers(&mut viewer, "unplugged");
    assert_eq!((&state["numbers"]["x_mean_m"], &state["numbers"]["x_peak_m"]), (&Value::Null, &Value::Null));
    assert_eq!(state["numbers"]["torque"], 3.0);
    assert_eq!(state["numbers"]["z_mean_m"], 0.0);
    assert!(state["alarms"][0].as_str().unwrap().starts_with("The x sensor reads an end of its span"), "{state}");
    // It stays unknown while values arrive.
    feed.send(values(8.0));
    assert_eq!(numbers(&mut viewer, "later")["numbers"]["x_mean_m"], Value::Null);
    feed.send(Update::LostSensors(SensorSet::default()));
    feed.send(values(8.0));
    let state = numbers(&mut viewer, "back");
    assert!(state["numbers"]["x_mean_m"].is_number() && state["alarms"] == json!([]), "{state}");
}

#[test]
fn the_numbers_have_the_stage_the_margin_and_an_x_over_z_that_can_be_read() {
    let monitor = monitor(None, Handles::default());
    let (feed, mut viewer) = (monitor.feed(), Viewer::join(&monitor));
    let table = ["frequency", "x", "z", "z_amplitude", "x_over_z_lock_in", "stage", "stage_left", "dwells"];
    feed.send(watched_table("rig", &["x", "z"], &table));
    feed.send(Update::Activity(Activity::Running, "Running.".into()));
    // x is the number of its row; a cycle of 0.4 s is told four times, and that at 3 s is a spike.
    feed.send(rows(1, 6000));
    for tenth in 0..60u8 {
        let ratio = if (30..34).contains(&tenth) { 900.0 } else { 4.0 + 0.02 * f32::from(tenth / 4 % 2) };
        let values = vec![2.5, 0.0, 0.0, 1e-3, ratio, 3.0, 2.25, 1.0];
        feed.send(Update::Values { rig_s: 0.1 * f64::from(tenth), tick: 100 * u32::from(tenth), values });
        if tenth == 33 {
            settle(&feed, &mut viewer, "spike");
            let all = Viewer::join(&monitor).next().unwrap();
            let shown = all["state"]["numbers"]["x_over_z_lock_in"].as_f64().unwrap();
            assert!((shown - 4.01).abs() < 0.011, "{shown}");
        }
    }
    settle(&feed, &mut viewer, "told");
    let numbers = &Viewer::join(&monitor).next().unwrap()["state"]["numbers"];
    assert_eq!(
        (&numbers["stage"], &numbers["stage_left_s"], &numbers["dwells"]),
        (&json!("measuring"), &json!(2.25), &json!(1.0))
    );
    assert!((numbers["x_over_z_spread"].as_f64().unwrap() - 0.005).abs() < 1e-4, "{numbers}");
    assert_eq!(numbers["max_abs_x_m"], 6000.0);
    // At another frequency the last whole cycle may be one of the point before: unknown for two cycles.
    for (rig_s, shown) in [(6.0, Value::Null), (6.5, Value::Null), (7.1, json!(3.0))] {
        let values = vec![2.0, 0.0, 0.0, 1e-3, if rig_s < 7.0 { 4.0 } else { 3.0 }, 2.0, 1.0, 0.0];
        feed.send(Update::Values { rig_s, tick: (1000.0 * rig_s) as u32, values });
        settle(&feed, &mut viewer, &format!("told {rig_s}"));
        let snapshot = Viewer::join(&monitor).next().unwrap();
        assert_eq!(snapshot["state"]["numbers"]["x_over_z_lock_in"], shown, "{rig_s}");
    }
    // The spectra of 6 s.
    let all = Viewer::join(&monitor).next().unwrap();
    let spectrum = &all["spectra"][0];
    assert!(spectrum["t_s"] == 6.0 && spectrum["amplitude_m"].as_array().unwrap().len() == 256, "{spectrum}");
}

#[test]
fn the_age_of_the_newest_sample_grows_while_none_arrives() {
    let monitor = monitor(None, Handles::default());
    let (feed, mut viewer) = (monitor.feed(), Viewer::join(&monitor));
    assert_eq!(viewer.next().unwrap()["state"]["age_s"], Value::Null);
    feed.send(rows(1, 10));
    let age = |message: &Value| message["state"]["age_s"].as_f64();
    viewer.until(|message| age(message).is_some_and(|age_s| age_s < 1.0));
    // A frame comes at least once a second.
    viewer.until(|message| age(message).is_some_and(|age_s| age_s > 1.5));
    feed.send(rows(11, 10));
    viewer.until(|message| age(message).is_some_and(|age_s| age_s < 1.0));
}

#[test]
fn what_is_watched_may_change_and_names_pass_as_they_are() {
    let monitor = monitor(None, Handles::default());
    let mut viewer = Viewer::join(&monitor);
    viewer.next();
    let hostile = "<img src=x onerror=alert(1)>\u{1b}[2J\u{202e}\"}";
    monitor.feed().send(watched(hostile));
    let all = viewer.until(|message| message["kind"] == "snapshot");
    assert_eq!(all[all.len() - 1]["source"]["name"], hostile);
}

#[test]
fn a_port_in_use_is_refused_with_what_to_do() {
    let first = monitor(None, Handles::default());
    let listen: SocketAddr = address(&first).parse().unwrap();
    let serving = Serving { listen: Some(listen), token: None };
    let error = Monitor::start(Some(serving), Permissions::default(), Handles::default()).unwrap_err().to_string();
    assert!(error.contains(&format!("--listen {listen}")) && error.contains("another monitor"), "{error}");
}

#[test]
fn ten_viewers_get_every_row_of_eight_thousand_values_a_second() {
    let monitor = monitor(None, Handles::default());
    let mut viewers: Vec<Viewer> = (0..10).map(|_| Viewer::join(&monitor)).collect();
    viewers.iter_mut().for_each(|viewer| drop(viewer.next()));
    let feed = monitor.feed();
    // Blocks as a board sends them, each when all viewers have the one before.
    for block in 0..100u32 {
        feed.send(rows(1 + 30 * block, 30));
        let last = f64::from(30 * (block + 1)) * 1e-3;
        for viewer in &mut viewers {
            let frames = viewer.until(|message| last_t_s(message).is_some_and(|t_s| (t_s - last).abs() < 1e-9));
            let count: usize = frames.iter().filter_map(|frame| frame["rows"]["t_s"].as_array()).map(Vec::len).sum();
            assert_eq!(count, 30);
        }
    }
}

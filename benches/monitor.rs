//! Measures the live monitor: ten viewers of 8 signals at 1 kHz for a minute at wall-clock pace. How late each block of rows reaches
//! each viewer, and what share of a core all of it takes, viewers included. `cargo bench --bench monitor`.

use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};

use damprig::monitor::feed::{Update, Watched};
use damprig::monitor::message::{Limits, SourceKind, WatchedSource};
use damprig::monitor::numbers::SignalName;
use damprig::monitor::{Handles, Monitor, Permissions, Serving};
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};

const VIEWERS: usize = 10;
const MEASURED: Duration = Duration::from_secs(60);

/// Rows of a block, as a board sends them, at 1 kHz.
const ROWS: u32 = 8;

fn main() {
    let listen = Some(SocketAddr::from(([127, 0, 0, 1], 0)));
    let serving = Serving { listen, token: None };
    let monitor = Monitor::start(Some(serving), Permissions::default(), Handles::default()).expect("a free port");
    let feed = monitor.feed();
    let source = WatchedSource {
        kind: SourceKind::Run,
        name: "bench".into(),
        rig: String::new(),
        board: String::new(),
        folder: None,
    };
    let signals: Vec<SignalName> = (0..8).map(|n| SignalName { name: format!("s{n}"), unit: "m".into() }).collect();
    feed.send(Update::Watch(Box::new(Watched {
        source,
        signals,
        table: Vec::new(),
        curves: Vec::new(),
        points_planned: 0,
        limits: Limits::default(),
    })));
    let url = monitor.url().expect("a page");
    let address = url.trim_start_matches("http://").trim_end_matches('/').to_string();
    let begun = Instant::now();
    let viewers: Vec<_> = (0..VIEWERS)
        .map(|_| {
            let socket = connect(&address);
            std::thread::spawn(move || follow(socket, begun))
        })
        .collect();
    let cpu_before = cpu_s();
    let start = begun.elapsed();
    let mut row = (start.as_secs_f64() * 1e3) as u32;
    while begun.elapsed() < start + MEASURED {
        row += ROWS;
        std::thread::sleep((Duration::from_millis(row.into())).saturating_sub(begun.elapsed()));
        let t_s = (row + 1 - ROWS..=row).map(|row| f64::from(row) * 1e-3).collect();
        let values = (0..ROWS * 8).map(|n| 1e-3 * ((row + n) % 400) as f32).collect();
        feed.send(Update::Rows { t_s, values, longest_step_s: 1.5e-3 });
    }
    let wall_s = (begun.elapsed() - start).as_secs_f64();
    let cpu = (cpu_s() - cpu_before) / wall_s;
    monitor.end();
    let mut late_ms: Vec<f64> = Vec::new();
    let mut rows = 0;
    for viewer in viewers {
        let (late, count) = viewer.join().expect("a viewer");
        late_ms.extend(late);
        rows += count;
    }
    late_ms.sort_by(f64::total_cmp);
    let share = |part: f64| late_ms[((late_ms.len() - 1) as f64 * part) as usize];
    println!(
        "{VIEWERS} viewers, {:.1} rows a second each: newest row late by {:.0} ms (median), {:.0} ms (99 %), {:.0} ms (most); {:.0} % of a core",
        f64::from(rows) / VIEWERS as f64 / wall_s,
        share(0.5),
        share(0.99),
        share(1.0),
        100.0 * cpu
    );
}

fn connect(address: &str) -> WebSocket<TcpStream> {
    let stream = TcpStream::connect(address).expect("the monitor listens");
    let request = format!("ws://{address}/live").into_client_request().expect("an address");
    tungstenite::client(request, stream).expect("a viewer is accepted").0
}

/// Reads to the end: how late the newest row of each frame was, ms, and the number of rows.
fn follow(mut socket: WebSocket<TcpStream>, begun: Instant) -> (Vec<f64>, u32) {
    let (mut late_ms, mut rows) = (Vec::new(), 0);
    while let Ok(message) = socket.read() {
        let Message::Text(text) = message else { continue };
        let now_ms = begun.elapsed().as_secs_f64() * 1e3;
        let frame: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        let Some(times) = frame["rows"]["t_s"].as_array().filter(|_| frame["kind"] == "frame") else { continue };
        rows += times.len() as u32;
        late_ms.extend(times.last().and_then(serde_json::Value::as_f64).map(|t_s| now_ms - 1e3 * t_s));
    }
    (late_ms, rows)
}

/// Processor time of this process so far, s.
fn cpu_s() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<f64> =
        stat.rsplit(") ").next().unwrap_or("").split(' ').skip(11).take(2).filter_map(|f| f.parse().ok()).collect();
    // The kernel counts in hundredths of a second.
    fields.iter().sum::<f64>() / 100.0
}

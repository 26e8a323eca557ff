//! Measures the pace of the real-time virtual rig against the wall clock: drift over a minute, and how late blocks of telemetry
//! reach the host. `cargo bench --bench real_time`.
//!
//! A block is a message of telemetry; 8 signals are sent in every tick. A block's delay counts from its last tick's place on
//! the wall clock; the least delay of all counts as none, because the tick of the start is known to a millisecond only.

use std::time::{Duration, Instant};

use damprig::client::link::{Address, Speed};
use damprig::client::session::{DeviceReport, Session, SessionError};
use damprig_core::control::stepped_sine::{DriveMode, Start, SteppedSine};
use damprig_core::io::TICK_HZ;
use damprig_core::measure::steadiness::SteadyLimits;
use damprig_protocol::Request;

/// Host time of a measurement, s.
const MEASURED_S: f64 = 60.0;

/// Host time at either end from which the drift is taken, s.
const END_S: f64 = 5.0;

/// A block: its time on the rig's clock and its delay, s of the host.
struct Block {
    rig_s: f64,
    delay_s: f64,
}

fn measure(speed: f64) -> Result<(), SessionError> {
    let speed_text = speed;
    let speed = Speed::new(speed).expect("an allowed speed");
    let address = Address::RealTime { single: false, board: None, speed };
    let mut session = Session::open(&address, Duration::from_secs(10))?;
    let sine = SteppedSine {
        start: Start::CarryOver,
        amplitude_m: 5e-4,
        drive: DriveMode::Constant,
        ramp_s: 1.0,
        settle_s: 1.0,
        dwell_s: 3600.0,
        steady: SteadyLimits::default(),
        first_index: 0,
        points: [2.0].into_iter().collect(),
    };
    session.execute("take the experiment", Request::Configure(sine))?;
    let signals = (0..8).collect();
    session.execute("send telemetry", Request::SetTelemetry { every_ticks: 1, signals, impacts: true })?;
    session.start()?;
    let begun = Instant::now();
    let (mut blocks, mut next_tick, mut lost) = (Vec::new(), None, 0);
    while begun.elapsed().as_secs_f64() < MEASURED_S {
        if let Some(DeviceReport::Telemetry(rows)) = session.next_report()? {
            let host_s = begun.elapsed().as_secs_f64();
            let count = rows.values.len() as u32 / u32::from(rows.width);
            // Rows from before the start have greater ticks.
            if next_tick.is_none() && rows.first_tick > 0 {
                continue;
            }
            lost += rows.first_tick - next_tick.unwrap_or(0);
            next_tick = Some(rows.first_tick + count);
            let rig_s = f64::from(rows.first_tick + count) / f64::from(TICK_HZ) / speed.get();
            blocks.push(Block { rig_s, delay_s: host_s - rig_s });
        }
    }
    session.stop_drive()?;
    let overruns = session.status()?.1.timing.overruns;
    let least = |from_s: f64, to_s: f64| {
        let part = blocks.iter().filter(|block| (from_s..to_s).contains(&block.rig_s));
        part.map(|block| block.delay_s).fold(f64::INFINITY, f64::min)
    };
    let drift_s = least(MEASURED_S - END_S, MEASURED_S) - least(0.0, END_S);
    let none_s = least(0.0, MEASURED_S);
    let mut late_s: Vec<f64> = blocks.iter().map(|block| block.delay_s - none_s).collect();
    late_s.sort_by(f64::total_cmp);
    let share = |part: f64| 1e3 * late_s[((late_s.len() - 1) as f64 * part) as usize];
    println!(
        "speed {speed_text:>4}: {} blocks; late by {:.2} ms (median), {:.2} ms (99 %), {:.2} ms (most); \
         drift {:+.3} ms per minute; {lost} rows lost, {overruns} ticks late",
        late_s.len(),
        share(0.5),
        share(0.99),
        share(1.0),
        1e3 * drift_s * 60.0 / (MEASURED_S - END_S)
    );
    Ok(())
}

fn main() -> Result<(), SessionError> {
    [1.0, 20.0].into_iter().try_for_each(measure)
}

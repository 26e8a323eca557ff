//! The real-time virtual rig: a simulated device with its own clock, in a thread of its own.
//!
//! It behaves as a board on a cable. Its ticks pass at wall-clock pace, whether a host is connected or not; a closed session
//! can be followed by another one; what it sends while nobody listens is lost. It lives until the process ends.

use std::io;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use damprig_core::io::TICK_HZ;
use damprig_core::settings::Settings;
use damprig_device::board::DeviceInfo;
use damprig_motion::virtual_device::VirtualDevice;

use super::{Address, Link};

/// Rig seconds per second of a real-time virtual rig: from 0.5 to 20.
///
/// Slower, a structure would not come to rest within the time limits of a run. Faster, the session's messages could not
/// follow each other closely enough: at 20, the shortest `host_silent_s` of a campaign (5 s) is a quarter of a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Speed(f64);

/// A speed is never NaN.
impl Eq for Speed {}

impl Speed {
    /// As fast as the wall clock.
    pub const REAL_TIME: Self = Self(1.0);

    /// A speed.
    ///
    /// # Errors
    /// It is out of range: the allowed range in words.
    pub fn new(speed: f64) -> Result<Self, String> {
        if (0.5..=20.0).contains(&speed) {
            Ok(Self(speed))
        } else {
            Err("must be from 0.5 to 20 rig seconds per second".into())
        }
    }

    /// Rig seconds per second.
    #[must_use]
    pub fn get(self) -> f64 {
        self.0
    }
}

/// A rig that is behind by more than this goes on from where it is: the computer slept, or is too slow. The ticks that it has
/// lost are counted as late ones. In seconds of the wall clock, and of the rig: while it catches up it hears nothing of the
/// host, whose shortest `host_silent_s` is 5 s.
const LONGEST_STALL_S: (f64, f64) = (1.0, 2.0);

/// Shortest sleep of the rig's thread.
const TURN: Duration = Duration::from_millis(1);

/// Most bytes that wait for the host; more are lost, as in a serial port.
const MAX_WAITING: usize = 16 << 20;

/// The rigs of this process.
static RIGS: Mutex<Vec<(Address, Arc<RealTimeLine>)>> = Mutex::new(Vec::new());

/// The line between a rig's thread and the host.
#[derive(Debug, Default)]
struct RealTimeLine {
    state: Mutex<LineState>,
    arrived: Condvar,
}

#[derive(Debug, Default)]
struct LineState {
    to_device: Vec<u8>,
    to_host: Vec<u8>,
    is_open: bool,
    is_pulled: bool,
}

impl RealTimeLine {
    fn state(&self) -> MutexGuard<'_, LineState> {
        lock(&self.state)
    }
}

/// No thread leaves the data in disorder when it panics.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The cable between this process and its real-time virtual rig, to be pulled out and plugged in.
#[derive(Clone, Debug)]
pub struct Cable(Arc<RealTimeLine>);

impl Cable {
    /// Pulls the cable out: bytes in both directions are lost, and the link cannot be opened.
    pub fn pull(&self) {
        let mut line = self.0.state();
        line.is_pulled = true;
        line.to_device.clear();
        line.to_host.clear();
    }

    /// Plugs the cable in. An open session goes on, unless it has given up.
    pub fn plug(&self) {
        self.0.state().is_pulled = false;
    }

    /// Whether the cable is pulled out.
    #[must_use]
    pub fn is_pulled(&self) -> bool {
        self.0.state().is_pulled
    }
}

/// The cable to the real-time virtual rig at this address. `None` for other rigs, and before the first session with it.
#[must_use]
pub fn cable(address: &Address) -> Option<Cable> {
    let rigs = lock(&RIGS);
    rigs.iter().find(|(known, _)| known == address).map(|(_, line)| Cable(Arc::clone(line)))
}

/// A link to the rig in its thread.
#[derive(Debug)]
pub(super) struct RealTimeRig(Arc<RealTimeLine>);

impl RealTimeRig {
    /// Connects to the rig at this address; the first time in this process, the rig is started with these settings.
    pub(super) fn connect(
        address: &Address,
        single: bool,
        speed: Speed,
        settings: Option<&Settings>,
    ) -> Result<Self, String> {
        let mut rigs = lock(&RIGS);
        let known = rigs.iter().find(|(known, _)| known == address).map(|(_, line)| Arc::clone(line));
        let line = match known {
            Some(line) => line,
            None => {
                let line = Arc::new(RealTimeLine::default());
                start(Arc::clone(&line), single, speed, settings)?;
                rigs.push((address.clone(), Arc::clone(&line)));
                line
            }
        };
        let mut state = line.state();
        if state.is_pulled {
            return Err("the cable is pulled; plug it in".into());
        }
        if std::mem::replace(&mut state.is_open, true) {
            return Err("another session of this program uses it; a cable has one user".into());
        }
        drop(state);
        Ok(Self(line))
    }
}

impl Drop for RealTimeRig {
    fn drop(&mut self) {
        let mut state = self.0.state();
        state.is_open = false;
        state.to_host.clear();
    }
}

impl Link for RealTimeRig {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut state = self.0.state();
        if !state.is_pulled {
            state.to_device.extend_from_slice(bytes);
        }
        Ok(())
    }

    fn receive(&mut self, into: &mut Vec<u8>, wait: Duration) -> io::Result<()> {
        let state = self.0.state();
        let waited = self.0.arrived.wait_timeout_while(state, wait, |state| state.to_host.is_empty());
        into.append(&mut waited.unwrap_or_else(PoisonError::into_inner).0.to_host);
        Ok(())
    }
}

/// Starts the thread of a new rig.
fn start(line: Arc<RealTimeLine>, single: bool, speed: Speed, settings: Option<&Settings>) -> Result<(), String> {
    let info = DeviceInfo::new(env!("CARGO_PKG_VERSION"), "virtual");
    let mut device = Box::new(VirtualDevice::real_time(single, info));
    settings.into_iter().for_each(|settings| device.start_with(settings));
    let thread = std::thread::Builder::new().name("real-time rig".into());
    thread.spawn(move || live(&mut device, &line, speed)).map_err(|e| format!("its thread cannot be started: {e}"))?;
    Ok(())
}

/// Runs the device at its pace, for ever.
fn live(device: &mut VirtualDevice, line: &RealTimeLine, speed: Speed) -> ! {
    let ticks_per_s = f64::from(TICK_HZ) * speed.get();
    let longest_stall = LONGEST_STALL_S.0.min(LONGEST_STALL_S.1 / speed.get()) * ticks_per_s;
    let ticks_per_turn = (ticks_per_s * TURN.as_secs_f64()).ceil() as u64;
    let begun = Instant::now();
    // Every due time is counted from the beginning, so errors do not accumulate.
    let due = || (begun.elapsed().as_secs_f64() * ticks_per_s) as u64;
    let mut passed = 0;
    let mut sent = Vec::new();
    loop {
        let behind = due() - passed;
        if behind as f64 > longest_stall {
            device.lose_ticks(u32::try_from(behind).unwrap_or(u32::MAX));
            passed += behind;
            continue;
        }
        // A turn at a time, so that requests are served while the rig catches up.
        let ticks = behind.min(ticks_per_turn);
        let received = std::mem::take(&mut line.state().to_device);
        device.receive(&received);
        device.run(ticks as u32, &mut |frame| sent.extend_from_slice(frame));
        deliver(line, &mut sent);
        passed += ticks;
        if ticks == behind {
            let next = Duration::from_secs_f64((passed + 1) as f64 / ticks_per_s);
            std::thread::sleep(next.saturating_sub(begun.elapsed()).max(TURN / 2));
        }
    }
}

/// Passes the frames to a host that listens.
fn deliver(line: &RealTimeLine, sent: &mut Vec<u8>) {
    if !sent.is_empty() {
        let mut state = line.state();
        if state.is_open && !state.is_pulled && state.to_host.len() < MAX_WAITING {
            state.to_host.append(sent);
            line.arrived.notify_one();
        }
        drop(state);
        sent.clear();
    }
}

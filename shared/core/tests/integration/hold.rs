//! A held stepped sine stays at its point, and measures it from the beginning after the release.

use damprig_core::control::base_loop::ClosedLoop;
use damprig_core::control::experiment::Experiment;
use damprig_core::control::outcome::ExperimentStage;
use damprig_core::control::stepped_sine::{DriveMode, Start, SteppedSine, SteppedSinePlan};
use damprig_core::control::transient::FreeVibration;
use damprig_core::control::transient::free_vibration::FreeVibrationPlan;
use damprig_core::io::{Reading, Sensors};
use damprig_core::measure::point::PointResult;
use damprig_core::measure::steadiness::SteadyLimits;
use damprig_core::rig::{Command, Event, Rejected, Rig, RigState};

/// Ten cycles at 5 Hz, twelve at 6 Hz.
const DWELL_TICKS: u32 = 2000;

fn sine(start: Start, drive: DriveMode) -> SteppedSine {
    SteppedSine {
        start,
        amplitude_m: 2e-3,
        drive,
        ramp_s: 0.0,
        settle_s: 0.5,
        dwell_s: 2.0,
        steady: SteadyLimits::default(),
        first_index: 0,
        points: [5.0, 6.0].into_iter().collect(),
    }
}

/// The base of the rig.
#[derive(Clone, Copy)]
enum Base {
    /// It follows the drive.
    Stiff,
    /// A table with a speed proportional to the drive, and with a gain that rises and falls by a fifth every 0.7 s.
    Unsteady,
}

/// A rig whose structure moves three times as far as its base.
struct Bench {
    rig: Rig,
    base: Base,
    drive_m: f32,
    z_m: f32,
    emergency_stop: bool,
    points: Vec<PointResult>,
}

impl Bench {
    fn idle() -> Self {
        Self { rig: Rig::new(), base: Base::Stiff, drive_m: 0.0, z_m: 0.0, emergency_stop: false, points: Vec::new() }
    }

    fn running(sine: SteppedSine) -> Self {
        let mut bench = Self::idle();
        let plan = SteppedSinePlan::new(sine).unwrap();
        bench.rig.handle(Command::Configure(Experiment::SteppedSine(plan))).unwrap();
        bench.rig.handle(Command::Start).unwrap();
        bench
    }

    fn pass(&mut self, ticks: u32) {
        for _ in 0..ticks {
            let mut sensors = Sensors { emergency_stop: self.emergency_stop, ..Sensors::default() };
            let gain = 1.0 + 0.2 * libm::sinf(9e-3 * self.rig.next_tick() as f32);
            self.z_m = match self.base {
                Base::Stiff => self.drive_m,
                Base::Unsteady => self.z_m + gain * 15.7e-3 * self.drive_m,
            };
            sensors.readings.x = Reading::still(3.0 * self.z_m);
            sensors.readings.z = Reading::still(self.z_m);
            self.rig.hear_host();
            self.drive_m = self.rig.tick(&sensors, &[]).drive_m;
            while let Some(event) = self.rig.pop_event() {
                if let Event::Point(result) = event {
                    self.points.push(result);
                }
            }
        }
    }

    fn hold(&mut self, held: bool) -> Result<(), Rejected> {
        self.rig.handle(Command::Hold(held))
    }

    fn stage(&self) -> Option<ExperimentStage> {
        if let RigState::Running(stage) = self.rig.state() { Some(stage) } else { None }
    }

    /// The points of an experiment that is held at `tick` for ten seconds, and the tick of the release.
    fn held_at(mut bench: Self, tick: u32) -> (Vec<PointResult>, u32) {
        bench.pass(tick);
        bench.hold(true).unwrap();
        bench.pass(10_000);
        assert!(bench.rig.status().held);
        assert_eq!(bench.stage(), Some(ExperimentStage::Settle), "nothing is measured while held");
        assert_eq!(bench.rig.signals().frequency, 5.0);
        assert!(bench.points.is_empty());
        let release = bench.rig.next_tick();
        bench.hold(false).unwrap();
        assert!(!bench.rig.status().held);
        bench.pass(20_000);
        assert_eq!(bench.rig.state(), RigState::Idle);
        (bench.points, release)
    }
}

#[test]
fn a_point_is_measured_from_its_beginning_after_the_release() {
    for start in [Start::CarryOver, Start::FromRest { level_m: 5e-4 }] {
        let mut free = Bench::running(sine(start, DriveMode::Constant));
        free.pass(10_000);
        // Held while it settles, and in the middle of its measurement.
        for tick in [100, 2000] {
            let (points, release) = Bench::held_at(Bench::running(sine(start, DriveMode::Constant)), tick);
            let first = points[0].start_tick;
            assert!((release..release + 201).contains(&first), "within a cycle of the release: {first}, {release}");
            for (held, free) in points.iter().zip(&free.points) {
                assert_eq!(held.end_tick - held.start_tick, free.end_tick - free.start_tick);
                assert!(held.end_tick.abs_diff(held.start_tick + DWELL_TICKS) <= 1);
                assert_eq!((held.index, held.frequency_hz), (free.index, free.frequency_hz));
                assert!((held.z_amplitude_m / free.z_amplitude_m - 1.0).abs() < 1e-3);
            }
            assert_eq!(points.len(), 2);
            let gaps = [&points, &free.points].map(|points| points[1].start_tick - points[0].end_tick);
            assert!(gaps[0].abs_diff(gaps[1]) <= 1, "the next point is as without a hold: {gaps:?}");
        }
    }
}

#[test]
fn a_point_without_settling_time_is_held_too() {
    let sine = SteppedSine { settle_s: 0.0, ..sine(Start::FromRest { level_m: 5e-4 }, DriveMode::Constant) };
    // Held while the rig waits for rest.
    let (points, release) = Bench::held_at(Bench::running(sine), 10);
    assert!(points[0].start_tick >= release);
}

#[test]
fn a_closed_loop_has_its_whole_waiting_time_after_the_release() {
    // The base never stays within the tolerance, so the loop waits as long as it may.
    let drive = DriveMode::ClosedLoop(ClosedLoop { tolerance: 1e-3, wait_s: 3.0, ..ClosedLoop::default() });
    let bench = Bench { base: Base::Unsteady, ..Bench::running(sine(Start::CarryOver, drive)) };
    let (points, release) = Bench::held_at(bench, 1000);
    let waited = points[0].start_tick - release;
    assert!((3000..=3201).contains(&waited), "{waited}");
}

#[test]
fn a_stop_and_a_fault_end_a_hold() {
    for is_fault in [false, true] {
        let mut bench = Bench::running(sine(Start::CarryOver, DriveMode::Constant));
        bench.pass(1000);
        bench.hold(true).unwrap();
        bench.pass(1000);
        if is_fault {
            bench.emergency_stop = true;
        } else {
            bench.rig.handle(Command::Stop).unwrap();
        }
        bench.pass(1);
        assert!(!bench.rig.status().held);
        bench.pass(1000);
        assert_eq!(bench.rig.state(), if is_fault { RigState::Faulted } else { RigState::Idle });
        assert_eq!(bench.drive_m, 0.0);
        assert!(bench.hold(false).is_err());
    }
}

#[test]
fn only_a_running_stepped_sine_can_be_held() {
    let mut bench = Bench::idle();
    bench.pass(10);
    let refused = bench.hold(true).unwrap_err().to_string();
    assert_eq!(refused, "not while the rig is idle: only a running stepped sine can be held");
    let free = FreeVibration { level_m: 0.01, hold_s: 1.0, timeout_s: 60.0, measure_s: 10.0, cycles: 10, index: 0 };
    let plan = FreeVibrationPlan::new(free).unwrap();
    bench.rig.handle(Command::Configure(Experiment::FreeVibration(plan))).unwrap();
    bench.rig.handle(Command::Start).unwrap();
    bench.pass(10);
    assert!(bench.hold(true).is_err());
    assert!(!bench.rig.status().held);
}

//! Counts the instructions of a control tick in the emulator, prints them and exits.
//!
//! The load is a stepped sine with a telemetry row in every tick; the plant's own instructions are left out.
//! What a tick of the controller board does besides (reading the queue and the interrupt itself) is not in it.

use core::hint::black_box;

use cortex_m_semihosting::hprintln;
use damprig_core::control::stepped_sine::{Drive, Start, SteppedSine};
use damprig_core::measure::point::SteadyLimits;
use damprig_core::model::{SetUp, Structure};
use damprig_core::plant::{Base, PlantConfig, SensorModel};
use damprig_core::rig::SUBSAMPLES;
use damprig_device::calibration::Calibration;
use damprig_device::simulated::Simulated;
use damprig_protocol::frame::{self, LONGEST, Reader};
use damprig_protocol::{Answer, Ask, FromDevice, Request, ToDevice};

use crate::board::mps2_an386::{InstructionCounter, exit};

/// Ticks counted: two points of two seconds, their ends, the drive's fading out and some idle ones.
const TICKS: u32 = 8_000;

/// Sets the rig up, counts, prints `name = number` lines under the names of `budgets.toml`, ends the emulator.
pub fn run(counter: &InstructionCounter, device: &mut Simulated<f32>) -> ! {
    counter.check();
    let asks = [Ask::SetPlant(plant()), Ask::Configure(experiment()), Ask::SetTelemetry { every_ticks: 1 }, Ask::Start];
    for (seq, ask) in (1..).zip(asks) {
        send(device, &ToDevice::Request(Request { seq, at_tick: None, ask }));
    }
    // The clock stands still after a start; each pass takes two ticks, one counted and one with the plant.
    send(device, &ToDevice::Grant { until_tick: 2 * TICKS });
    let calibration = Calibration::assumed(65_520, 4_095, 0.005);
    let block = [32_760; 2 * SUBSAMPLES];
    let (mut sum, mut worst, mut with_plant) = (0u64, 0, 0u64);
    for _ in 0..TICKS {
        let ((), tick) = counter.count(|| {
            black_box(calibration.sensors(black_box(&block)));
            device.tick_control_only();
            black_box(calibration.drive.to_counts(black_box(0.001), 4_095));
        });
        let (_, simulated) = counter.count(|| device.run(1, |_| {}));
        sum += u64::from(tick);
        worst = worst.max(tick);
        with_plant += u64::from(simulated);
    }
    let ticks = u64::from(TICKS);
    hprintln!("instructions_per_tick_mean = {}", sum / ticks);
    hprintln!("instructions_per_tick_worst = {}", worst);
    hprintln!("instructions_per_simulated_tick_mean = {}", with_plant / ticks);
    exit(true)
}

fn send(device: &mut Simulated<f32>, message: &ToDevice) {
    let mut out = [0; LONGEST];
    let length = frame::encode(message, &mut out).expect("every message fits a frame");
    device.receive(&out[..length]);
    let mut reader = Reader::default();
    device.run(1, |bytes| {
        for &byte in bytes {
            if let Some(Ok(FromDevice::Reply { answer, .. })) = reader.push(byte) {
                assert_eq!(answer, Ok(Answer::Done), "the load is refused");
            }
        }
    });
}

fn plant() -> PlantConfig {
    PlantConfig {
        set_up: SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038)),
        particle_start_m: 0.0,
        base: Base::Prescribed,
        sensors: SensorModel::default(),
        data_sheet: None,
    }
}

fn experiment() -> SteppedSine {
    SteppedSine {
        start: Start::CarryOver,
        amplitude_m: 1e-4,
        drive: Drive::Constant,
        ramp_s: 0.0,
        settle_s: 1.0,
        dwell_s: 4.0,
        steady: SteadyLimits::default(),
        frequencies_hz: [2.0, 3.0].into_iter().collect(),
        first_index: 0,
    }
}

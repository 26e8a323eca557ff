//! Impact measurement of pulses with known time, impulse and contact time.

use damprig_core::integrator::base::BaseSegment;
use damprig_core::integrator::sampled::{Sampled, SampledImpact, SampledObserver};
use damprig_core::integrator::units::Units;
use damprig_core::io::{ForceScale, WallCounts};
use damprig_core::measure::impacts::{ImpactConfig, ImpactMeter, ImpactRecord};
use damprig_core::measure::snippet::{HISTORY, SNIPPET};
use damprig_core::model::{Cavity, Initial, Particle, SetUp, Structure, Wall};
use damprig_simulator::plant::walls::{WallSensors, Walls};
use std::f32::consts::{FRAC_PI_2, PI};

/// Fifteen bits over −16 N to 508 N: the quantisation is far below the tolerances.
const FINE: ForceScale = ForceScale { newtons_per_count: 0.016, zero_counts: 1000.0 };

const QUIET: WallSensors = WallSensors {
    contact_s: 2e-3,
    range_n: 500.0,
    offset_n: 0.0,
    noise_rms_n: 0.0,
    scale: FINE,
    highest_counts: 0x7fff,
};

fn meter(config: &ImpactConfig, samples_per_tick: u8) -> ImpactMeter {
    ImpactMeter::new(config, &FINE, samples_per_tick).unwrap()
}

/// A force on the wall at −d.
fn low(force_n: f32) -> WallCounts {
    WallCounts::new(FINE.to_counts(force_n, 0, 0x7fff), 1000)
}

/// Passes impacts (time in ticks, side, impulse) through sensors and meter with N samples per tick; returns times in
/// ticks from 0.
fn measure<const N: usize>(
    sensors: &WallSensors,
    config: &ImpactConfig,
    hits: &[(f64, i8, f32)],
) -> (Vec<(f64, ImpactRecord)>, ImpactMeter) {
    let mut walls = Walls::new(sensors, 7).unwrap();
    let mut meter = ImpactMeter::new(config, &sensors.scale, N as u8).unwrap();
    let mut found = vec![];
    let last = hits.iter().map(|hit| hit.0 as u32).max().unwrap_or(0);
    for tick in 0..last + 200 {
        for &(at, side, impulse) in hits.iter().filter(|hit| hit.0 as u32 == tick) {
            walls.hit((at - f64::from(tick)) as f32, side, impulse);
        }
        meter.push(tick, &walls.read::<N>(None), |record| {
            found.push((f64::from(record.tick) + f64::from(record.centre_ticks), *record));
        });
    }
    (found, meter)
}

#[test]
fn time_impulse_and_peak_of_a_pulse_are_measured_at_any_position_between_samples() {
    check_pulse::<10>(2e-3, 0.1);
    check_pulse::<10>(1e-3, 0.1);
    check_pulse::<50>(1e-3, 0.1);
    check_pulse::<50>(0.3e-3, 0.02);
}

fn check_pulse<const N: usize>(contact_s: f32, impulse: f32) {
    let sensors = WallSensors { contact_s, ..QUIET };
    let n = contact_s * 1000.0 * N as f32;
    let peak = FRAC_PI_2 * impulse / contact_s;
    // Error from the kinks (see the module). The part below the threshold and outside the guards is zero at these
    // peaks.
    let kinks = PI * PI / (12.0 * n * n);
    for phase in 0..40 {
        let at = 20.0 + f64::from(phase) / 40.0;
        let (found, meter) = measure::<N>(&sensors, &ImpactConfig::default(), &[(at, 1, impulse)]);
        let [(time, record)] = found[..] else { panic!("{found:?}") };
        assert!((record.impulse_n_s / impulse - 1.0).abs() < kinks + 1e-4, "{n} samples: {record:?}");
        // Error of a parabola through a sine at ±π/n: fourth order.
        assert!((record.peak_n / peak - 1.0).abs() < (PI / n).powi(4) / 4.0 + 1e-4, "{n} samples: {record:?}");
        assert!((record.contact_s / contact_s - 1.0).abs() < kinks + (PI / n).powi(4) / 4.0 + 2e-4, "{record:?}");
        // The kinks move the centre by at most half a contact time multiplied by their fraction of the impulse.
        let error = time - (at + f64::from(contact_s) * 500.0);
        assert!(error.abs() < f64::from(contact_s * 500.0 * kinks + 2e-5), "{n} samples: {error} ticks");
        assert!(record.side == 1 && !record.clipped && !record.held);
        assert_eq!((meter.counts().impacts, meter.counts().suppressed), ([0, 1], 0));
    }
}

/// The offset that a meter has followed is forgotten at a start from rest: a resumed run measures the same impacts, bit for bit.
#[test]
fn what_a_meter_measures_after_a_restart_does_not_depend_on_what_it_measured_before() {
    let sensors = WallSensors { noise_rms_n: 0.2, offset_n: 0.4, ..QUIET };
    let measure = |earlier_ticks: u32| {
        let mut meter = meter(&ImpactConfig::default(), 50);
        let mut drifting = Walls::new(&WallSensors { offset_n: -0.4, ..sensors }, 3).unwrap();
        for tick in 0..earlier_ticks {
            if tick % 100 == 50 {
                drifting.hit(0.5, 1, 0.1);
            }
            meter.push(tick, &drifting.read::<50>(None), |_| {});
        }
        meter.restart();
        let (mut walls, mut found) = (Walls::new(&sensors, 7).unwrap(), vec![]);
        for tick in 0..400 {
            if tick % 100 == 50 {
                walls.hit(0.5, 1, 0.1);
            }
            meter.push(tick, &walls.read::<50>(None), |record| found.push(*record));
        }
        found
    };
    let new = measure(0);
    assert_eq!(new.len(), 4);
    // The mean of the idle samples has an error of the noise over their root from the first impact on.
    let peak_n = FRAC_PI_2 * 0.1 / 2e-3;
    assert!(new.iter().all(|record| (record.peak_n - peak_n).abs() < 4.0 * 0.2), "{new:?}");
    for earlier_ticks in [60, 470, 3000] {
        assert_eq!(measure(earlier_ticks), new, "after {earlier_ticks} ticks");
    }
}

struct Hits {
    set_up: SetUp,
    step: u32,
    /// (time, side, M·Δx′, approach)
    hits: Vec<(f64, i8, f64, f64)>,
}

impl SampledObserver<f64> for Hits {
    fn impact(&mut self, impact: &SampledImpact<f64>) {
        let time = f64::from(self.step) + impact.at;
        let impulse = (self.set_up.structure.mass_kg * impact.kick * 1e3).abs();
        self.hits.push((time, impact.side, impulse, impact.approach * 1e3));
    }
}

/// The whole chain: the integrator's impacts become forces, and the meter measures their impulses. The law is
/// m(1+e)v/(1+β).
#[test]
fn measured_impulses_are_those_of_the_impact_law() {
    let (mass, ratio, restitution) = (1.6, 0.1, 0.5);
    let particle = Particle {
        mass_kg: ratio * mass,
        clearance_m: 15e-3,
        friction_coefficient: 0.0,
        wall: Wall::Restitution { coefficient: restitution },
        cavity: Cavity::default(),
    };
    let set_up = SetUp { particle: Some(particle), ..SetUp::bare(Structure::from_modal(mass, 2.5, 0.0038)) };
    let mut sampled = Sampled::<f64>::new(&set_up, Units::metres(1e-3), &Initial::default()).unwrap();
    let mut truth = Hits { set_up, step: 0, hits: vec![] };
    let z = |tick: f64| 1.5e-3 * (2.0 * std::f64::consts::PI * 2.5e-3 * tick).sin();
    let slope = |tick: f64| 0.5 * (z(tick + 1.0) - z(tick - 1.0));
    for step in 0..60_000 {
        truth.step = step;
        let t = f64::from(step);
        sampled.step(&BaseSegment::hermite(z(t), z(t + 1.0), slope(t), slope(t + 1.0)), &mut truth);
    }
    let hits: Vec<_> = truth.hits.iter().map(|hit| (hit.0, hit.1, hit.2 as f32)).collect();
    let sensors = WallSensors::default();
    let (found, meter) = measure::<10>(&sensors, &ImpactConfig::default(), &hits);
    assert!(hits.len() > 150 && found.len() == hits.len(), "{} of {}", found.len(), hits.len());
    assert_eq!(meter.counts().total() as usize, hits.len());
    for (&(at, side, _, approach), (time, record)) in truth.hits.iter().zip(&found) {
        let law = ratio * mass * (1.0 + restitution) * approach / (1.0 + ratio);
        // Kinks at 20 samples per contact, 0.2 %; noise of 0.2 N over about 30 samples of 0.1 ms; the offset caused
        // by the noise (0.2 N/√20 000), and the feet outside the guards.
        let tolerance = 0.0021 * law + 5.0 * 0.2 * 1e-4 * 30.0f64.sqrt() + 1e-4 * law;
        assert!((f64::from(record.impulse_n_s) - law).abs() < tolerance, "{record:?}: law {law}");
        assert_eq!(record.side, side);
        let late = time - at - 1.0;
        // Noise moves the centre by 5 σ √(Σ(i−ī)²)/ΣF, 30 samples: √(30³/12) = 47.
        let jitter = 5.0 * 0.2 * 47.0 * 1e-4 / law * 0.1 + 0.0025;
        assert!(late.abs() < jitter, "{late} ticks at {at}: {record:?}");
    }
}

#[test]
fn ringing_counts_as_one_impact_and_a_second_impact_as_another() {
    let ring = |at, part: f32| (at, 1, 0.1 * part);
    let (found, meter) = measure::<50>(
        &WallSensors { contact_s: 0.2e-3, ..QUIET },
        &ImpactConfig::default(),
        &[ring(20.0, 0.5), ring(20.5, 0.1), ring(20.9, 0.05), ring(40.0, 0.5), ring(40.6, 0.45), ring(60.0, 0.05)],
    );
    let times: Vec<f64> = found.iter().map(|hit| (hit.0 * 10.0).round() / 10.0).collect();
    assert_eq!(times, [20.1, 40.1, 40.7, 60.1]);
    assert_eq!(meter.counts().suppressed, 2);
}

#[test]
fn a_clipped_pulse_is_marked_and_still_has_its_time() {
    let sensors = WallSensors { range_n: 60.0, ..QUIET };
    let config = ImpactConfig { clip_n: 59.0, ..ImpactConfig::default() };
    let (found, meter) = measure::<10>(&sensors, &config, &[(20.33, -1, 0.1), (80.0, 1, 0.05)]);
    assert!(found[0].1.clipped && found[0].1.side == -1 && found[0].1.peak_n <= 60.0 + FINE.newtons_per_count);
    assert!((found[0].0 - 21.33).abs() < 0.01, "{}", found[0].0);
    assert!(!found[1].1.clipped && meter.counts().clipped == 1);
}

#[test]
fn a_particle_that_comes_to_rest_on_the_wall_is_one_impact_marked_as_held() {
    let mut meter = meter(&ImpactConfig::default(), 10);
    let mut found = vec![];
    for tick in 0..1000 {
        let block = [low(if (100..700).contains(&tick) { 5.0 } else { 0.0 }); 10];
        meter.push(tick, &block, |record| found.push(*record));
    }
    assert!(found.len() == 1 && found[0].held && found[0].side == -1, "{found:?}");
    assert_eq!(meter.counts().held, 1);
}

#[test]
fn noise_alone_makes_no_impact_and_an_offset_is_followed() {
    let sensors = WallSensors { offset_n: 1.5, noise_rms_n: 0.2, ..QUIET };
    let (found, _) = measure::<10>(&sensors, &ImpactConfig::default(), &[(5000.0, 1, 0.02)]);
    assert_eq!(found.len(), 1, "{found:?}");
    // The remaining offset is e^(−5) of the initial one: 0.01 N, over about 24 samples.
    assert!((found[0].1.impulse_n_s - 0.02).abs() < 0.02 * 0.003 + 0.01 * 24e-4 + 5.0 * 0.2e-4 * 5.0, "{found:?}");
}

#[test]
fn impacts_are_counted_by_cycle() {
    let mut meter = meter(&ImpactConfig::default(), 10);
    let mut walls = Walls::new(&QUIET, 1).unwrap();
    let mut by_cycle = vec![];
    for tick in 0..2000 {
        if tick % 400 == 50 || (tick % 400 == 250 && tick > 800) {
            walls.hit(0.5, 1, 0.05);
        }
        meter.push(tick, &walls.read::<10>(None), |_| {});
        if tick % 400 == 399 {
            by_cycle.push(meter.end_cycle());
        }
    }
    assert_eq!(by_cycle, [1, 1, 2, 2, 2]);
}

#[test]
fn a_snippet_holds_the_samples_around_the_next_impact() {
    let mut meter = meter(&ImpactConfig::default(), 50);
    let mut walls = Walls::new(&QUIET, 1).unwrap();
    let mut high_side = vec![];
    for tick in 0..100 {
        if tick == 20 {
            meter.arm_snippet();
        }
        if [10, 40, 60].contains(&tick) {
            walls.hit(0.25, 1, if tick == 40 { 0.08 } else { 0.03 });
        }
        let block = walls.read::<50>(None);
        high_side.extend(block.map(|pair| pair.of(1)));
        meter.push(tick, &block, |_| {});
    }
    // Read in parts, the last one short.
    let mut samples: Vec<u16> = vec![];
    while samples.len() < SNIPPET {
        let mut piece = [0; 100];
        let (copied, side) = meter.snippet().copy(samples.len(), &mut piece).unwrap();
        assert_eq!((copied, side), (100.min(SNIPPET - samples.len()), 1));
        samples.extend(&piece[..copied]);
    }
    assert_eq!(meter.snippet().copy(SNIPPET + 1, &mut [0; 2]), Some((0, 1)));
    let crossing = (40 * 50..).find(|&n| f32::from(high_side[n] - 1000) * FINE.newtons_per_count >= 2.5).unwrap();
    assert_eq!(samples, high_side[crossing - HISTORY..crossing - HISTORY + SNIPPET]);
}

#[test]
fn invalid_settings_are_rejected_by_name() {
    let good = ImpactConfig::default();
    for (bad, name) in [
        (ImpactConfig { threshold_n: 0.0, ..good }, "impacts.threshold_n"),
        (ImpactConfig { clip_n: 4.0, ..good }, "impacts.clip_n"),
        (ImpactConfig { ringing: 1.1, ..good }, "impacts.ringing"),
        (ImpactConfig { refractory_s: 0.0, ..good }, "impacts.refractory_s"),
        (ImpactConfig { longest_contact_s: f32::NAN, ..good }, "impacts.longest_contact_s"),
    ] {
        assert_eq!(ImpactMeter::new(&bad, &FINE, 10).unwrap_err().parameter, name);
    }
    let parameter = |scale, samples| ImpactMeter::new(&good, &scale, samples).unwrap_err().parameter;
    assert_eq!(parameter(ForceScale { newtons_per_count: 0.0, ..FINE }, 10), "calibration.walls.newtons_per_count");
    assert_eq!(parameter(ForceScale { zero_counts: f32::NAN, ..FINE }, 10), "calibration.walls.zero_counts");
    assert_eq!(parameter(FINE, 65), "impacts.samples_per_tick");
}

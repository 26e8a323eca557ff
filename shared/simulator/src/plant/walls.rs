//! Simulated wall-force sensors: each impact on a hard wall gives a half-sine pulse of stated contact time with the impulse of
//! the impact; a soft wall gives the force of its spring and dashpot.
//!
//! The model's impacts on hard walls are instantaneous; the pulse begins at the impact. Pulses may overlap.

use super::Noise;
use core::f32::consts::PI;
use damprig_core::io::{
    ForceScale, Invalid, TICK_HZ, WALL_FULL_SCALE_COUNTS, WallCounts, finite, not_negative, positive, require,
};
use damprig_core::scalar::Scalar;
use heapless::Deque;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Maximum number of pulses in progress. In a long chatter the oldest are dropped.
const MAX_PULSES: usize = 16;

/// The force sensors of the walls.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct WallSensors {
    /// Contact time, s.
    pub contact_s: f32,
    /// Range: readings are limited to ± this, N.
    pub range_n: f32,
    /// Reading without a force, N.
    pub offset_n: f32,
    /// RMS of the white noise of one sample, N.
    pub noise_rms_n: f32,
    /// Conversion of the converter's counts to force.
    pub scale: ForceScale,
    /// Highest reading of the converter, counts; at most 32767.
    pub highest_counts: u16,
}

impl Default for WallSensors {
    /// Assumed: contact of 2 ms, sensor of 500 N with 0.2 N of noise, 12 bits.
    fn default() -> Self {
        Self {
            contact_s: 2e-3,
            range_n: 500.0,
            offset_n: 0.0,
            noise_rms_n: 0.2,
            scale: ForceScale::default(),
            highest_counts: WALL_FULL_SCALE_COUNTS,
        }
    }
}

impl WallSensors {
    /// Checks that every value is physical.
    ///
    /// # Errors
    /// Names the first value that is not.
    pub fn validate(&self) -> Result<(), Invalid> {
        positive("walls.contact_s", f64::from(self.contact_s))?;
        positive("walls.range_n", f64::from(self.range_n))?;
        finite("walls.offset_n", f64::from(self.offset_n))?;
        positive("walls.scale.newtons_per_count", f64::from(self.scale.newtons_per_count))?;
        finite("walls.scale.zero_counts", f64::from(self.scale.zero_counts))?;
        let highest = f64::from(self.highest_counts);
        require((1..=0x7fff).contains(&self.highest_counts), "walls.highest_counts", highest, "from 1 to 32767")?;
        not_negative("walls.noise_rms_n", f64::from(self.noise_rms_n))
    }
}

#[derive(Clone, Copy, Debug)]
struct Pulse {
    /// 0 for the wall at −d, 1 for +d.
    wall: usize,
    /// Start of the pulse, ticks from the start of the present tick.
    start: f32,
    peak_n: f32,
}

/// The force sensors of both walls.
#[derive(Clone, Debug)]
pub struct Walls {
    sensors: WallSensors,
    /// Scales of the walls at −d and +d.
    scales: [ForceScale; 2],
    /// Contact time in ticks.
    contact: f32,
    pulses: Deque<Pulse, MAX_PULSES>,
    noise: Noise,
}

impl Walls {
    /// Makes sensors without a pulse; `seed` is that of the noise.
    ///
    /// # Errors
    /// Names a value that is not physical.
    pub fn new(sensors: &WallSensors, seed: u64) -> Result<Self, Invalid> {
        sensors.validate()?;
        let contact = sensors.contact_s * TICK_HZ;
        Ok(Self {
            sensors: *sensors,
            scales: [sensors.scale; 2],
            contact,
            pulses: Deque::new(),
            noise: Noise::new(seed, u16::MAX),
        })
    }

    /// Gives each wall a scale of its own.
    pub fn set_scales(&mut self, scales: [ForceScale; 2]) {
        self.scales = scales;
    }

    /// Adds the pulse of an impact in the present tick: `at` ticks from its start, on `side` (±1), with this impulse
    /// on the structure, N·s.
    pub fn hit(&mut self, at: f32, side: i8, impulse_n_s: f32) {
        if self.pulses.is_full() {
            self.pulses.pop_front();
        }
        let peak_n = 0.5 * PI * libm::fabsf(impulse_n_s) / self.sensors.contact_s;
        // Cannot fail: room was made above.
        let _ = self.pulses.push_back(Pulse { wall: usize::from(side > 0), start: at, peak_n });
    }

    /// Removes all pulses and restarts the noise with an independent `stream`.
    pub fn restart(&mut self, seed: u64, stream: u16) {
        self.pulses.clear();
        self.noise = Noise::new(seed, u16::MAX - stream);
    }

    /// Returns the tick's readings in counts, `N` pairs with the wall at −d first, and ends the tick. `pressed_n`: forces of soft
    /// walls at the instants of these readings, N.
    pub fn read<const N: usize>(&mut self, pressed_n: Option<&[[f32; 2]; N]>) -> [WallCounts; N] {
        let readings = self.look(pressed_n);
        self.pass();
        readings
    }

    fn look<const N: usize>(&mut self, pressed_n: Option<&[[f32; 2]; N]>) -> [WallCounts; N] {
        let sensors = &self.sensors;
        let [low, high] = self.scales.map(|scale| (1.0 / scale.newtons_per_count, scale.zero_counts + 0.5));
        let (range, highest) = (sensors.range_n, f32::from(sensors.highest_counts));
        // The cast truncates.
        let counts = |force_n: f32, (per_newton, zero): (f32, f32)| {
            let force_n = Scalar::min(Scalar::max(force_n, -range), range);
            Scalar::min(force_n * per_newton + zero, highest) as u16
        };
        // Loops rather than closures over arrays: the compiler vectorises them, and this is half of the simulator's time.
        let mut forces_n = [[sensors.offset_n; 2]; N];
        for pulse in &self.pulses {
            for (n, forces) in forces_n.iter_mut().enumerate() {
                let since = ((n + 1) as f32 / N as f32 - pulse.start) / self.contact;
                if since > 0.0 && since < 1.0 {
                    forces[pulse.wall] += pulse.peak_n * libm::sinf(PI * since);
                }
            }
        }
        if let Some(pressed_n) = pressed_n {
            for (forces, pressed) in forces_n.iter_mut().zip(pressed_n) {
                forces[0] += pressed[0];
                forces[1] += pressed[1];
            }
        }
        if sensors.noise_rms_n > 0.0 {
            for forces in &mut forces_n {
                let noise = self.noise.next_pair();
                forces[0] += sensors.noise_rms_n * noise[0];
                forces[1] += sensors.noise_rms_n * noise[1];
            }
        }
        let mut readings = [WallCounts::default(); N];
        for (reading, forces) in readings.iter_mut().zip(&forces_n) {
            *reading = WallCounts::new(counts(forces[0], low), counts(forces[1], high));
        }
        readings
    }

    /// Ends the tick.
    fn pass(&mut self) {
        for pulse in &mut self.pulses {
            pulse.start -= 1.0;
        }
        while self.pulses.front().is_some_and(|pulse| pulse.start + self.contact < 0.0) {
            self.pulses.pop_front();
        }
    }
}

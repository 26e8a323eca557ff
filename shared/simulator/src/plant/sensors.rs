//! Displacement sensors and their converters: from the true motion to the readings.
//!
//! [`SensorModel`] is an ideal sensor with range, resolution and white noise. A [`DataSheet`] adds imperfections in
//! the order of the signal path: linearity error and response lag of the sensor, the anti-alias filter, and a
//! converter that averages several conversions per sample. Both channels are alike, except that z is converted later.

use super::noise::Noise;
use core::f64::consts::TAU;
use damprig_core::io::{Invalid, SUBSAMPLES, TICK_HZ, not_negative, positive, require};
use damprig_core::scalar::Scalar;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Samples per second and channel.
const SAMPLES_PER_S: f64 = TICK_HZ as f64 * SUBSAMPLES as f64;

/// An ideal displacement sensor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct SensorModel {
    /// Range of the readings of x and of z: readings are limited to ± these values, m; greater than 0.
    pub range_m: [f32; 2],
    /// Resolution, m: readings are multiples of it; 0 for unlimited resolution. A [`DataSheet`] replaces it by the
    /// resolution of its converter.
    pub resolution_m: f32,
    /// RMS of the white noise of one 10 kHz sample, m.
    pub noise_rms_m: f32,
    /// Seed of the noise; every point of an experiment uses its own stream of it.
    pub seed: u64,
}

impl Default for SensorModel {
    /// The laser of the source document: ±80 mm. Its resolution (10 µm) and RMS noise (5 µm) are assumed.
    fn default() -> Self {
        Self { range_m: [0.08; 2], resolution_m: 1e-5, noise_rms_m: 5e-6, seed: 1 }
    }
}

impl SensorModel {
    /// Checks that every value is physical.
    ///
    /// # Errors
    /// Names the first value that is not.
    pub fn validate(&self) -> Result<(), Invalid> {
        let [x_m, z_m] = self.range_m;
        positive("sensors.range_m", f64::from(x_m))?;
        positive("sensors.range_m", f64::from(z_m))?;
        not_negative("sensors.resolution_m", f64::from(self.resolution_m))?;
        not_negative("sensors.noise_rms_m", f64::from(self.noise_rms_m))?;
        let coarsest = Scalar::min(x_m, z_m);
        let allowed = "at most a tenth of sensors.range_m";
        require(self.resolution_m <= 0.1 * coarsest, "sensors.resolution_m", f64::from(self.resolution_m), allowed)?;
        let counts = if self.resolution_m > 0.0 { Scalar::max(x_m, z_m) / self.resolution_m } else { 0.0 };
        require(
            counts < 4e6,
            "sensors.resolution_m",
            f64::from(self.resolution_m),
            "0, or at least sensors.range_m / 4,000,000",
        )
    }
}

/// Imperfections of a displacement sensor beyond [`SensorModel`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct DataSheet {
    /// Largest deviation from a straight line through the ends of the range, as a fraction of the range (one side); 0
    /// to 0.1. The deviation is taken as odd and cubic: it distorts a sine by a third harmonic.
    pub linearity: f32,
    /// Time constant of the sensor's first-order response, s; 0 or greater.
    pub response_s: f32,
    /// Delay of the conversion of z after that of x, s; 0 to one 10 kHz sample (the multiplexer's delay).
    pub skew_s: f32,
    /// Corner frequency of the first-order anti-alias filter, Hz; greater than 0.
    pub anti_alias_hz: f32,
    /// Resolution of the converter over the whole range, bits; 4 to 20.
    pub bits: u8,
    /// Number of conversions averaged into one sample, evenly spaced over it; 1 to 64.
    pub oversampling: u8,
}

impl Default for DataSheet {
    /// Assumed values, typical of triangulation lasers with analog output and of a microcontroller's converter: 0.1 %
    /// of range, 1 ms, 10 µs, 1.6 kHz (1 kΩ with 100 nF), 12 bits, 16 conversions.
    fn default() -> Self {
        Self { linearity: 1e-3, response_s: 1e-3, skew_s: 1e-5, anti_alias_hz: 1600.0, bits: 12, oversampling: 16 }
    }
}

impl DataSheet {
    /// Checks that every value is physical.
    ///
    /// # Errors
    /// Names the first value that is not.
    pub fn validate(&self) -> Result<(), Invalid> {
        let within = |name, value: f64, low: f64, high: f64, allowed| {
            require((low..=high).contains(&value), name, value, allowed)
        };
        within("sensors.linearity", f64::from(self.linearity), 0.0, 0.1, "from 0 to 0.1")?;
        not_negative("sensors.response_s", f64::from(self.response_s))?;
        within("sensors.skew_s", f64::from(self.skew_s), 0.0, 1.0001 / SAMPLES_PER_S, "from 0 to 0.0001")?;
        positive("sensors.anti_alias_hz", f64::from(self.anti_alias_hz))?;
        within("sensors.bits", f64::from(self.bits), 4.0, 20.0, "from 4 to 20")?;
        within("sensors.oversampling", f64::from(self.oversampling), 1.0, 64.0, "from 1 to 64")
    }
}

/// A first-order lag, exact for an input that is linear between its samples.
#[derive(Clone, Copy, Debug)]
struct Lag {
    /// Fraction of a difference that is left after one sample.
    decay: f32,
    /// Time constant divided by the sample interval.
    constant: f32,
    input: f32,
    output: f32,
}

impl Lag {
    fn new(time_constant_s: f64) -> Self {
        let constant = time_constant_s * SAMPLES_PER_S;
        let decay = if constant > 0.0 { libm::exp(-1.0 / constant) } else { 0.0 };
        Self { decay: decay as f32, constant: constant as f32, input: 0.0, output: 0.0 }
    }

    fn next(&mut self, input: f32) -> f32 {
        let behind = (input - self.input) * self.constant;
        self.output = input - behind + (self.output - self.input + behind) * self.decay;
        self.input = input;
        self.output
    }
}

/// One channel: converts a displacement to readings.
#[derive(Clone, Debug)]
pub(super) struct Channel {
    converter: Converter,
    imperfect: Option<Imperfect>,
}

/// The range, resolution and noise of one conversion.
#[derive(Clone, Debug)]
struct Converter {
    range: f32,
    resolution: f32,
    per_resolution: f32,
    /// RMS noise of one conversion.
    noise: f32,
}

#[derive(Clone, Debug)]
struct Imperfect {
    /// Deviation at r of the range: `bend·(r − r³)`.
    bend: f32,
    per_range: f32,
    response: Lag,
    filter: Lag,
    /// Time of the first conversion in the sample interval, and time between conversions, as fractions of the
    /// interval.
    first: f32,
    spacing: f32,
    conversions: u8,
    last: f32,
    before: f32,
}

impl Channel {
    /// Makes a channel; `late` if it is converted after the other channel.
    pub(super) fn new(model: &SensorModel, sheet: Option<&DataSheet>, late: bool) -> Self {
        let range = model.range_m[usize::from(late)];
        let resolution = match sheet {
            // The range is 2^bits codes wide.
            Some(sheet) => 2.0 * range / (1u32 << sheet.bits) as f32,
            None => model.resolution_m,
        };
        let conversions = sheet.map_or(1, |sheet| sheet.oversampling);
        let converter = Converter {
            range,
            resolution,
            per_resolution: if resolution > 0.0 { 1.0 / resolution } else { 0.0 },
            // `noise_rms_m` is that of a sample, which is the mean of the conversions.
            noise: model.noise_rms_m * libm::sqrtf(f32::from(conversions)),
        };
        Self { converter, imperfect: sheet.map(|sheet| Imperfect::new(range, sheet, late)) }
    }

    /// Resets the channel to a sensor that has seen this displacement, m, for long.
    pub(super) fn reset(&mut self, truth: f32) {
        if let Some(imperfect) = &mut self.imperfect {
            imperfect.reset(truth, self.converter.range);
        }
    }

    /// Returns the next sample's reading, m.
    pub(super) fn read(&mut self, truth: f32, noise: &mut Noise) -> f32 {
        let Some(imperfect) = &mut self.imperfect else { return self.converter.convert(truth, noise) };
        imperfect.push(truth, self.converter.range);
        let mut sum = 0.0;
        for n in 0..imperfect.conversions {
            sum += self.converter.convert(imperfect.at(n), noise);
        }
        sum / f32::from(imperfect.conversions)
    }
}

impl Converter {
    #[inline]
    fn convert(&self, signal: f32, noise: &mut Noise) -> f32 {
        let mut reading = signal;
        if self.noise > 0.0 {
            reading += self.noise * noise.next();
        }
        if self.per_resolution > 0.0 {
            // Adding 1.5 · 2²³ leaves no bits for a fraction, so the sum is rounded to the nearest integer. A branch
            // on the noise would be unpredictable.
            const NO_FRACTION: f32 = 12_582_912.0;
            reading = (reading * self.per_resolution + NO_FRACTION - NO_FRACTION) * self.resolution;
        }
        Scalar::min(Scalar::max(reading, -self.range), self.range)
    }
}

impl Imperfect {
    fn new(range: f32, sheet: &DataSheet, late: bool) -> Self {
        let n = f32::from(sheet.oversampling);
        let skew = if late { f64::from(sheet.skew_s) * SAMPLES_PER_S } else { 0.0 };
        Self {
            // max (r − r³) = 2/(3√3) on 0 … 1.
            bend: sheet.linearity * range * 2.598_076,
            per_range: 1.0 / range,
            response: Lag::new(f64::from(sheet.response_s)),
            filter: Lag::new(1.0 / (TAU * f64::from(sheet.anti_alias_hz))),
            // The conversions fill the interval before the sample instant. The last ones of a late channel come after
            // it; the signal is extrapolated linearly there.
            first: skew as f32 + 1.0 / n,
            spacing: 1.0 / n,
            conversions: sheet.oversampling,
            last: 0.0,
            before: 0.0,
        }
    }

    fn reset(&mut self, truth: f32, range: f32) {
        let bent = self.bent(truth, range);
        for lag in [&mut self.response, &mut self.filter] {
            (lag.input, lag.output) = (bent, bent);
        }
        (self.last, self.before) = (bent, bent);
    }

    /// The sensor's output for a displacement, with its deviation from a straight line.
    fn bent(&self, truth: f32, range: f32) -> f32 {
        // A sensor outputs its end value for a displacement beyond its range.
        let seen = Scalar::min(Scalar::max(truth, -range), range);
        let r = seen * self.per_range;
        seen + self.bend * (r - r * r * r)
    }

    fn push(&mut self, truth: f32, range: f32) {
        let bent = self.bent(truth, range);
        let filtered = self.filter.next(self.response.next(bent));
        self.before = self.last;
        self.last = filtered;
    }

    /// The signal at the instant of conversion `n`.
    fn at(&self, n: u8) -> f32 {
        self.before + (self.last - self.before) * (self.first + f32::from(n) * self.spacing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quiet() -> SensorModel {
        SensorModel { noise_rms_m: 0.0, resolution_m: 0.0, ..SensorModel::default() }
    }

    /// A data sheet without imperfections, to which each test adds its own.
    fn perfect() -> DataSheet {
        DataSheet { linearity: 0.0, response_s: 0.0, skew_s: 0.0, anti_alias_hz: 1e9, bits: 20, oversampling: 1 }
    }

    /// Amplitude ratio and phase (rad) of the reading of a sine, by correlation over whole cycles.
    fn response(sheet: &DataSheet, late: bool, frequency_hz: f64) -> (f64, f64) {
        let mut channel = Channel::new(&quiet(), Some(sheet), late);
        let mut noise = Noise::new(1, 0);
        let (mut sine, mut cosine) = (0.0, 0.0);
        let (settle, count) = (20_000, 20_000);
        for n in 0..settle + count {
            let angle = TAU * frequency_hz * f64::from(n) / SAMPLES_PER_S;
            let reading = f64::from(channel.read((0.04 * libm::sin(angle)) as f32, &mut noise));
            if n >= settle {
                sine += reading * libm::sin(angle);
                cosine += reading * libm::cos(angle);
            }
        }
        let scale = 2.0 / f64::from(count) / 0.04;
        (libm::hypot(sine, cosine) * scale, libm::atan2(cosine, sine))
    }

    #[test]
    fn readings_are_multiples_of_the_resolution_within_the_range() {
        let model = SensorModel { noise_rms_m: 0.0, ..SensorModel::default() };
        let (mut channel, mut noise) = (Channel::new(&model, None, false), Noise::new(1, 0));
        for (truth, reading) in [(0.000_123_6, 0.000_12), (-0.000_125_5, -0.000_13), (0.2, 0.08), (-3e9, -0.08)] {
            assert!((channel.read(truth, &mut noise) - reading).abs() < 1e-9, "{truth}");
        }
    }

    /// The expected values are |1/(1 + jωτ)| and its phase, for sensor and filter. Error: linear interpolation
    /// between 10 kHz samples takes at most (2πf/10⁴)²/12 of the amplitude; the converter has 20 bits.
    #[test]
    fn response_and_filter_are_first_order_lags() {
        let (response_s, corner) = (1e-3, 1600.0);
        let sheet = DataSheet { response_s: response_s as f32, anti_alias_hz: corner as f32, ..perfect() };
        for frequency in [2.5, 50.0, 160.0] {
            let omega = TAU * frequency;
            let (t1, t2) = (omega * response_s, frequency / corner);
            let expected = 1.0 / (libm::hypot(1.0, t1) * libm::hypot(1.0, t2));
            let (amplitude, phase) = response(&sheet, false, frequency);
            let tolerance = (omega / SAMPLES_PER_S).powi(2) / 12.0 * 2.0 + 5e-6;
            assert!((amplitude / expected - 1.0).abs() < tolerance, "{frequency} Hz: {amplitude} for {expected}");
            let expected = -libm::atan(t1) - libm::atan(t2);
            assert!((phase - expected).abs() < tolerance, "{frequency} Hz: {phase} for {expected}");
        }
    }

    #[test]
    fn a_late_channel_leads_by_its_skew() {
        let sheet = DataSheet { skew_s: 4e-5, ..perfect() };
        let (early, late) = (response(&sheet, false, 100.0).1, response(&sheet, true, 100.0).1);
        // Error of the linear extrapolation: second order in the angle between two samples, 0.063.
        assert!((late - early - TAU * 100.0 * 4e-5).abs() < 0.063f64.powi(2), "{}", late - early);
    }

    #[test]
    fn the_largest_linearity_error_is_the_stated_one() {
        let sheet = DataSheet { linearity: 2e-3, ..perfect() };
        let mut worst: f32 = 0.0;
        for n in -1000..=1000i16 {
            let truth = 0.08 * f32::from(n) / 1000.0;
            let mut channel = Channel::new(&quiet(), Some(&sheet), false);
            channel.read(truth, &mut Noise::new(1, 0));
            worst = worst.max((channel.read(truth, &mut Noise::new(1, 0)) - truth).abs());
        }
        assert!((worst / (2e-3 * 0.08) - 1.0).abs() < 1e-3, "{worst}");
    }

    /// A converter without noise errs by up to half a step. Noise of half a step and N conversions per sample spread
    /// the error, so the mean of many samples resolves far less than a step.
    #[test]
    fn oversampling_with_noise_resolves_less_than_a_step_of_the_converter() {
        let step = 0.16 / 4096.0;
        let truth = 10.3 * step;
        let mean = |model: &SensorModel, oversampling: u8| {
            let sheet = DataSheet { bits: 12, oversampling, ..perfect() };
            let (mut channel, mut noise) = (Channel::new(model, Some(&sheet), false), Noise::new(3, 0));
            // The first sample is still part of the transient from rest.
            channel.read(truth, &mut noise);
            (0..1000).map(|_| f64::from(channel.read(truth, &mut noise))).sum::<f64>() / 1000.0
        };
        let silent = mean(&quiet(), 16);
        assert!((silent / f64::from(step) - 10.0).abs() < 1e-4, "{silent}");
        let noisy = mean(&SensorModel { noise_rms_m: step / 8.0, ..quiet() }, 16);
        // The noise of a conversion is half a step, that of the mean of 16 000 is 0.004 steps (three times: 0.013).
        assert!((noisy / f64::from(step) - 10.3).abs() < 0.025, "{noisy}");
    }

    #[test]
    fn readings_are_limited_to_the_range() {
        let mut channel = Channel::new(&SensorModel::default(), Some(&DataSheet::default()), true);
        let mut noise = Noise::new(1, 0);
        let last = (0..1000).map(|_| channel.read(1.0, &mut noise)).last();
        assert!(last.is_some_and(|last| (0.0799..=0.08).contains(&last)), "{last:?}");
    }

    #[test]
    fn an_unphysical_value_of_a_data_sheet_is_rejected_by_name() {
        let name = |sheet: DataSheet| sheet.validate().unwrap_err().parameter;
        assert_eq!(name(DataSheet { bits: 24, ..perfect() }), "sensors.bits");
        assert_eq!(name(DataSheet { skew_s: 1e-3, ..perfect() }), "sensors.skew_s");
        assert_eq!(name(DataSheet { anti_alias_hz: f32::NAN, ..perfect() }), "sensors.anti_alias_hz");
        assert!(DataSheet::default().validate().is_ok());
    }
}

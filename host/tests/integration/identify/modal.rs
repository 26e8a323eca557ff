//! One mode of a frequency response: fn and ζ against closed forms of one to three modes with noise, and against an analyser's file.

use std::f64::consts::TAU;

use damprig::failure::Failure;
use damprig::identify::modal::unit::quantity_of;
use damprig::identify::modal::{FrequencyResponse, Modal, ModalMisfit, ResponseLine, Wish, identify};
use damprig_fourier::Complex;

use super::{Claim, some_seeds};

/// Random numbers of the tests.
struct Random(fastrand::Rng);

impl Random {
    fn new(seed: u64) -> Self {
        // Neighbouring seeds of this generator are correlated.
        Self(fastrand::Rng::with_seed(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15)))
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.f64()
    }

    /// Even in the logarithm.
    fn log_between(&mut self, low: f64, high: f64) -> f64 {
        (self.between(low.ln(), high.ln())).exp()
    }

    /// Complex normal, E|c|² = 1.
    fn complex(&mut self) -> Complex<f64> {
        let size = (-(1.0 - self.0.f64()).ln()).sqrt();
        Complex::from_polar(size, TAU * self.0.f64())
    }
}

/// A structure: its modes as frequency in Hz, damping ratio and modal constant, and what H is of.
#[derive(Clone, Debug)]
struct Structure {
    modes: Vec<(f64, f64, f64)>,
    unit: &'static str,
}

impl Structure {
    /// H, closed form: a sum over the modes.
    fn h(&self, hz: f64) -> Complex<f64> {
        let omega = TAU * hz;
        let receptance: Complex<f64> = self
            .modes
            .iter()
            .map(|(natural_hz, zeta, constant)| {
                let natural = TAU * natural_hz;
                Complex::from(*constant) / Complex::new(natural * natural - omega * omega, 2.0 * zeta * natural * omega)
            })
            .sum();
        match self.unit {
            "m/N" => receptance,
            "m/s/N" => receptance * Complex::new(0.0, omega),
            "m/s2/N" => -receptance * omega * omega,
            _ => receptance * omega * omega + 1.0,
        }
    }

    /// A mode of drawn frequency and damping ratio, and `others` beside it; and the spacing of lines that resolve its half-power width by 1.5 to 10.
    fn drawn(random: &mut Random, others: usize) -> (Self, f64) {
        let (natural_hz, zeta) = (random.log_between(5.0, 500.0), random.log_between(5e-4, 0.1));
        let unit = ["m/N", "m/s/N", "m/s2/N", "m/m"][random.0.usize(..4)];
        // Transmissibilities have participations of the order of 1, others modal masses.
        let constant = if unit == "m/m" { 1.0 } else { random.log_between(0.01, 100.0) };
        let mut modes = vec![(natural_hz, zeta, constant)];
        for n in 0..others {
            let ratio = random.between(1.6, 4.0);
            let other_hz = if n == 0 { natural_hz * ratio } else { natural_hz / ratio };
            let sign = if random.0.bool() { 1.0 } else { -1.0 };
            let size = random.between(0.1, 1.0) * sign * constant;
            modes.push((other_hz, random.log_between(5e-4, 0.1f64.min(3.0 * zeta)), size));
        }
        let spacing_hz = 2.0 * zeta * natural_hz / random.log_between(1.5, 10.0);
        (Self { modes, unit }, spacing_hz)
    }

    /// Lines about the first mode: 15 half-power widths to either side, but not beyond half of the way to another mode.
    fn frequencies(&self, spacing_hz: f64, random: &mut Random) -> Vec<f64> {
        let (natural_hz, zeta, _) = self.modes[0];
        let mut low = natural_hz * (1.0 - 30.0 * zeta).max(0.3);
        let mut high = natural_hz * (1.0 + 30.0 * zeta).min(3.0);
        for (other_hz, ..) in &self.modes[1..] {
            let middle = 0.5 * (other_hz + natural_hz);
            if *other_hz > natural_hz { high = high.min(middle) } else { low = low.max(middle) }
        }
        let first = (low / spacing_hz).ceil() + random.0.f64();
        let count = ((high - low) / spacing_hz) as usize;
        (0..count).map(|n| (first + n as f64) * spacing_hz).collect()
    }

    fn peak(&self) -> f64 {
        self.h(self.modes[0].0).norm()
    }

    fn response(&self, lines: Vec<ResponseLine>, averages: Option<f64>) -> FrequencyResponse {
        let quantity = quantity_of(self.unit).unwrap();
        FrequencyResponse {
            taken_from: "closed form".into(),
            quantity,
            lines,
            averages,
            window_hz: None,
            remarks: Vec::new(),
        }
    }

    /// With noise of a floor and of a share of |H|.
    fn with_noise(&self, spacing_hz: f64, random: &mut Random) -> FrequencyResponse {
        let (floor, share) = (random.log_between(3e-4, 1e-2) * self.peak(), random.log_between(1e-3, 1e-2));
        let frequencies = self.frequencies(spacing_hz, random);
        let line = |hz: f64, random: &mut Random| {
            let own = self.h(hz);
            ResponseLine {
                frequency_hz: hz,
                h: own + random.complex() * floor + random.complex() * own * share,
                coherence: None,
            }
        };
        let lines = frequencies.into_iter().map(|hz| line(hz, random)).collect();
        self.response(lines, None)
    }

    /// H1 and coherence of this many averages: a random excitation, and noise on the motion.
    fn averaged(&self, spacing_hz: f64, count: usize, random: &mut Random) -> Vec<ResponseLine> {
        let floor = random.log_between(3e-3, 3e-2) * self.peak();
        let frequencies = self.frequencies(spacing_hz, random);
        let line = |hz: f64, random: &mut Random| {
            let own = self.h(hz);
            let (mut xx, mut yy, mut xy) = (0.0, 0.0, Complex::from(0.0));
            for _ in 0..count {
                let x = random.complex();
                let y = own * x + random.complex() * floor;
                (xx, yy, xy) = (xx + x.norm_sqr(), yy + y.norm_sqr(), xy + x.conj() * y);
            }
            ResponseLine { frequency_hz: hz, h: xy / xx, coherence: Some(xy.norm_sqr() / (xx * yy)) }
        };
        frequencies.into_iter().map(|hz| line(hz, random)).collect()
    }
}

/// Errors of fn, in half-power widths, and of ζ and |A|, relative; how often something does not fit.
#[derive(Default)]
struct Account {
    frequency: Claim,
    damping: Claim,
    constant: Claim,
    of_line: Claim,
    misfits: usize,
    kinds: Vec<ModalMisfit>,
    refused: usize,
}

impl Account {
    fn note(&mut self, found: &Modal, structure: &Structure) {
        let (natural_hz, zeta, constant) = structure.modes[0];
        let width_hz = 2.0 * zeta * natural_hz;
        let frequency = &found.natural_frequency_hz;
        self.frequency.note(&frequency.mapped(frequency.value / width_hz, 1.0 / width_hz), natural_hz / width_hz);
        self.damping.note(&found.damping_ratio.mapped(found.damping_ratio.value / zeta, 1.0 / zeta), 1.0);
        self.constant.note(&found.size.mapped(found.size.value / constant, 1.0 / constant), 1.0);
        if let Some(line) = &found.by_line {
            self.of_line.note(&line.damping_ratio.mapped(line.damping_ratio.value / zeta, 1.0 / zeta), 1.0);
        }
        self.misfits += usize::from(!found.misfits.is_empty());
        self.kinds.extend(found.misfits.first());
    }

    fn take(&mut self, found: Result<Modal, Failure>, structure: &Structure, lines: usize) {
        match found {
            Ok(found) => self.note(&found, structure),
            Err(error) => {
                println!("{structure:?}, {lines} lines: {error}");
                self.refused += 1;
            }
        }
    }

    /// The intervals cover the truth, and nearly nothing is refused.
    fn check(&self, what: &str) {
        self.frequency.assert_covers(&format!("{what}: fn"));
        self.damping.assert_covers(&format!("{what}: ζ"));
        self.constant.assert_covers(&format!("{what}: |A|"));
        assert!(self.refused <= self.damping.errors.len() / 40, "{what}: {} refused", self.refused);
    }

    fn print(&self, what: &str) {
        let of = |kind: fn(&ModalMisfit) -> bool| self.kinds.iter().filter(|own| kind(own)).count();
        println!(
            "{what}: modes {}, background {}, shape {}, methods {}, scatter {}",
            of(|k| matches!(k, ModalMisfit::Mode(_))),
            of(|k| *k == ModalMisfit::Background),
            of(|k| *k == ModalMisfit::Shape),
            of(|k| matches!(k, ModalMisfit::Methods(_))),
            of(|k| matches!(k, ModalMisfit::Scatter(_)))
        );
        println!(
            "{what}: {} fits, {} refused, {} with a misfit; fn RMS {:.4} widths, covered {:.3}; ζ RMS {:.2} %, covered {:.3}; |A| RMS {:.2} %, covered \
             {:.3}; by the line ζ RMS {:.2} %, covered {:.3} of {}",
            self.damping.errors.len(),
            self.refused,
            self.misfits,
            self.frequency.rms(),
            self.frequency.coverage(),
            100.0 * self.damping.rms(),
            self.damping.coverage(),
            100.0 * self.constant.rms(),
            self.constant.coverage(),
            100.0 * self.of_line.rms(),
            self.of_line.coverage(),
            self.of_line.errors.len()
        );
    }
}

/// Frequencies from 5 to 500 Hz, damping ratios from 0.0005 to 0.1, four kinds of response, half-power widths of 1.5 to 10 lines, noise of 0.03 % to 1 % of the
/// peak and 0.1 % to 1 % of |H|.
#[test]
fn modes_of_closed_forms_are_found_with_intervals_that_cover_them() {
    for others in 0..3 {
        let mut account = Account::default();
        for seed in 1..=some_seeds() {
            let mut random = Random::new(seed + 10_000 * others as u64);
            let (structure, spacing_hz) = Structure::drawn(&mut random, others);
            let response = structure.with_noise(spacing_hz, &mut random);
            account.take(identify(&response, Wish::default()).map_err(Failure::from), &structure, response.lines.len());
        }
        account.print(&format!("{} modes", others + 1));
        if others == 0 {
            account.check("one mode");
            // One of a thousand by chance, in three tests.
            assert!(account.misfits <= 1 + account.damping.errors.len() / 100, "{} misfits", account.misfits);
        } else {
            // What bends the flanks and is below the noise of the test is in no interval: some of 95 % are lost.
            for (what, claim) in [("fn", &account.frequency), ("ζ", &account.damping), ("|A|", &account.constant)] {
                // Of a few draws three standard deviations of a share of 90 % less.
                let count = claim.errors.len();
                let least = if count < 200 { 0.9 - 3.0 * (0.09 / count as f64).sqrt() } else { 0.9 };
                assert!(claim.coverage() >= least, "{} modes: {what} covered {}", others + 1, claim.coverage());
            }
            assert!(account.refused <= account.damping.errors.len() / 40, "{} refused", account.refused);
        }
    }
}

#[test]
fn a_coherence_gives_the_noise_of_h1() {
    for (count, known) in [(4, false), (10, false), (10, true)] {
        let mut account = Account::default();
        for seed in 1..=some_seeds() {
            let mut random = Random::new(seed + 50_000 + count as u64);
            let (structure, spacing_hz) = Structure::drawn(&mut random, 0);
            let lines = structure.averaged(spacing_hz, count, &mut random);
            let found = identify(&structure.response(lines, known.then_some(count as f64)), Wish::default());
            account.take(found.map_err(Failure::from), &structure, 0);
        }
        let what = format!("{count} averages, known {known}");
        account.print(&what);
        account.check(&what);
    }
}

/// Without noise the fit is exact up to rounding and the end of its search.
#[test]
fn modes_without_noise_are_found_exactly() {
    for (zeta, unit) in [(5e-4, "m/N"), (5e-3, "m/s/N"), (0.03, "m/s2/N"), (0.1, "m/m")] {
        let structure = Structure { modes: vec![(40.0, zeta, 2.0)], unit };
        let mut random = Random::new(1);
        let frequencies = structure.frequencies(80.0 * zeta / 4.0, &mut random);
        let line = |hz| ResponseLine { frequency_hz: hz, h: structure.h(hz), coherence: None };
        let lines: Vec<ResponseLine> = frequencies.into_iter().map(line).collect();
        let found = identify(&structure.response(lines, None), Wish::default()).unwrap();
        assert!((found.natural_frequency_hz.value / 40.0 - 1.0).abs() < 1e-6 * zeta, "{zeta}: {found:?}");
        assert!((found.damping_ratio.value / zeta - 1.0).abs() < 1e-6, "{zeta}: {:?}", found.damping_ratio);
        assert!((found.constant - Complex::from(2.0)).norm() < 1e-5, "{zeta}: {}", found.constant);
        assert!(found.of_others < 1e-5, "{zeta}: {}", found.of_others);
    }
}

/// What a mode is not, each in noise of 0.2 % of the peak.
#[test]
fn what_is_not_one_mode_is_named() {
    let structure = Structure { modes: vec![(30.0, 0.01, 1.0)], unit: "m/s2/N" };
    let frequencies: Vec<f64> = (0..161).map(|n| 27.0 + 0.0375 * f64::from(n)).collect();
    let wish = Wish { from_hz: Some(27.0), to_hz: Some(33.0) };
    type Other = fn(&Structure, f64) -> Complex<f64>;
    let near: Other = |_, hz| Structure { modes: vec![(31.5, 0.01, 0.1)], unit: "m/s2/N" }.h(hz);
    let large: Other = |_, hz| Structure { modes: vec![(32.0, 0.012, -0.3)], unit: "m/s2/N" }.h(hz);
    let beside: Other = |_, hz| Structure { modes: vec![(25.5, 0.003, 1.0)], unit: "m/s2/N" }.h(hz);
    let window: Other = |own, hz| {
        // Hann's window of 4 s: three lines of 0.25 Hz with 1/4, 1/2, 1/4, less H itself.
        0.25 * (own.h(hz - 0.25) + own.h(hz + 0.25)) - 0.5 * own.h(hz)
    };
    for (what, other, expected) in [
        ("near", near, "there is another mode or a disturbance at 31."),
        ("large", large, "there is another mode or a disturbance at 3"),
        ("beside", beside, "what the other modes add bends over the band"),
        ("window", window, "the peak has not the shape of a mode"),
    ] {
        let mut named = 0;
        for seed in 1..=20 {
            let mut random = Random::new(seed);
            let mut line = |hz: &f64| {
                let noise = random.complex() * 2e-3 * structure.peak();
                ResponseLine {
                    frequency_hz: *hz,
                    h: structure.h(*hz) + other(&structure, *hz) + noise,
                    coherence: None,
                }
            };
            let lines = frequencies.iter().map(&mut line).collect();
            let found = identify(&structure.response(lines, None), wish).unwrap();
            named += usize::from(found.sentences().iter().any(|sentence| sentence.contains(expected)));
            assert!(found.contradiction().is_some(), "{what}, seed {seed}");
            let [low, high] = found.natural_frequency_hz.interval_95();
            if what != "window" {
                assert!((low..=high).contains(&30.0), "{what}, seed {seed}: {:?}", found.natural_frequency_hz);
                let [low, high] = found.size.interval_95();
                assert!((low..=high).contains(&1.0), "{what}, seed {seed}: {:?}", found.size);
            }
        }
        assert_eq!(named, 20, "{what}");
    }
    // A coherence of 1 − 1e-6 of ten averages states less noise than there is.
    let mut random = Random::new(3);
    let mut line = |hz: &f64| {
        let noise = random.complex() * 2e-3 * structure.peak();
        ResponseLine { frequency_hz: *hz, h: structure.h(*hz) + noise, coherence: Some(1.0 - 1e-6) }
    };
    let lines = frequencies.iter().map(&mut line).collect();
    let found = identify(&structure.response(lines, Some(10.0)), wish).unwrap();
    assert!(matches!(found.misfits[..], [ModalMisfit::Scatter(times)] if times > 5.0), "{:?}", found.misfits);
}

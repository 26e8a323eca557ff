//! The printed scheme of the impact damper against the exact solution: a fixed time step, and an impact at the end of every step at
//! which |y − x| ≥ d.
//!
//! Between impacts both masses move as they do without contact, here in closed form, so that only the treatment of the impacts differs. It is
//! computed as printed, with a test that the particle approaches the wall, and with the impact located within the step. The controller's own
//! driver, with its steps of 1 ms, stands beside them in `f64` and in the board's `f32`.

use std::path::Path;

use arrow_array::RecordBatch;
use arrow_schema::Metadata;
use damprig_core::integrator::base::BaseSegment;
use damprig_core::integrator::polynomial;
use damprig_core::integrator::sampled::{Flight, Sampled, SampledImpact, SampledObserver};
use damprig_core::integrator::units::Units;
use damprig_core::model::{Initial, Wall};
use damprig_core::scalar::Scalar;

use super::Ending;
use crate::results::METHOD_TABLE;
use damprig::failure::Failure;
use damprig::input::Source;
use damprig::quantity::Quantity;
use damprig::report::figures::case_overlay::{Series, over_step};
use damprig::run_folder::{own_files, sealed_parquet};
use damprig::simulation::{Case, RunOptions, SetValues, cost, simulate};
use damprig::table::{Column, TableBuilder};

/// Free vibration with a hard wall as measured, without internal friction.
const CASE: &str = r#"
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
initial = { x_m = 0.035 }
run = { duration_s = 12 }
particle = { mass_ratio = 0.1, clearance_ratio = 0.5, start = "at_negative_wall", wall = { kind = "restitution", coefficient = 0.82 } }
"#;

/// Clearances over the initial displacement, as published.
const CLEARANCE_RATIOS: [f64; 2] = [0.5, 0.85];

/// Time steps, s; the printed one is 1e-4 s.
const STEPS_S: [f64; 5] = [1e-3, 3e-4, 1e-4, 3e-5, 1e-5];

/// Step of the controller, s.
const TICK_S: f64 = 1e-3;

/// How an impact is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Variant {
    /// |y − x| ≥ d at the end of a step.
    Printed,
    /// The same, and the particle approaches the wall.
    Approaching,
    /// Within the step, where |y − x| = d.
    Located,
    /// By the controller's driver in `f64`.
    DriverF64,
    /// By the controller's driver in `f32`, as on the board.
    DriverF32,
}

impl Variant {
    /// The printed scheme and its mends.
    const SCHEMES: [Self; 3] = [Self::Printed, Self::Approaching, Self::Located];

    const fn name(self) -> &'static str {
        match self {
            Self::Printed => "as printed",
            Self::Approaching => "with a test of the approach",
            Self::Located => "located within the step",
            Self::DriverF64 => "the controller's driver, f64",
            Self::DriverF32 => "the controller's driver, f32",
        }
    }
}

/// Structure and particle: the structure vibrates freely, the particle keeps its velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
struct SchemeState {
    x_m: f64,
    v_m_per_s: f64,
    y_m: f64,
    u_m_per_s: f64,
}

/// The model of the scheme.
#[derive(Clone, Copy, Debug)]
struct Model {
    angular_frequency_rad_per_s: f64,
    damping_ratio: f64,
    mass_ratio: f64,
    clearance_m: f64,
    restitution: f64,
}

impl Model {
    /// The motion after `t_s` without contact.
    fn flow(&self, from: SchemeState, t_s: f64) -> SchemeState {
        let rate = self.damping_ratio * self.angular_frequency_rad_per_s;
        let damped = self.angular_frequency_rad_per_s * (1.0 - self.damping_ratio * self.damping_ratio).sqrt();
        let (sine, cosine) = (damped * t_s).sin_cos();
        let decay = (-rate * t_s).exp();
        let quadrature = (from.v_m_per_s + rate * from.x_m) / damped;
        let x_m = decay * (from.x_m * cosine + quadrature * sine);
        let turned = decay * damped * (quadrature * cosine - from.x_m * sine);
        SchemeState { x_m, v_m_per_s: turned - rate * x_m, y_m: from.y_m + from.u_m_per_s * t_s, ..from }
    }

    /// The velocities after an impact: momentum stays, the relative velocity turns and shrinks by the restitution.
    fn impact(&self, at: SchemeState) -> SchemeState {
        let closing = (1.0 + self.restitution) * (at.u_m_per_s - at.v_m_per_s) / (1.0 + self.mass_ratio);
        SchemeState { v_m_per_s: at.v_m_per_s + self.mass_ratio * closing, u_m_per_s: at.u_m_per_s - closing, ..at }
    }

    /// How far the particle is beyond its walls, m.
    fn overlap_m(&self, at: SchemeState) -> f64 {
        (at.y_m - at.x_m).abs() - self.clearance_m
    }

    fn approaches(at: SchemeState) -> bool {
        (at.y_m - at.x_m) * (at.u_m_per_s - at.v_m_per_s) > 0.0
    }

    /// The time within a step at which the particle reaches its wall, by bisection to the last bit that matters.
    fn touch_s(&self, from: SchemeState, step_s: f64) -> f64 {
        let (mut before_s, mut after_s) = (0.0, step_s);
        for _ in 0..60 {
            let middle_s = 0.5 * (before_s + after_s);
            if self.overlap_m(self.flow(from, middle_s)) < 0.0 { before_s = middle_s } else { after_s = middle_s }
        }
        after_s
    }

    fn step(&self, from: SchemeState, step_s: f64, variant: Variant, counted: &mut Counted) -> SchemeState {
        let to = self.flow(from, step_s);
        let overlap_m = self.overlap_m(to);
        if overlap_m < 0.0 || (variant != Variant::Printed && !Self::approaches(to)) {
            return to;
        }
        counted.impacts += 1.0;
        if variant == Variant::Located {
            let touch_s = self.touch_s(from, step_s);
            return self.flow(self.impact(self.flow(from, touch_s)), step_s - touch_s);
        }
        counted.overlap_m = counted.overlap_m.max(overlap_m);
        self.impact(to)
    }
}

/// What a run of the scheme is compared by.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Counted {
    rms_x_m: f64,
    impacts: f64,
    overlap_m: f64,
}

fn run_scheme(model: &Model, start: SchemeState, duration_s: f64, step_s: f64, variant: Variant) -> Counted {
    let steps = (duration_s / step_s).round() as u64;
    let step_s = duration_s / steps as f64;
    let (mut state, mut counted, mut square) = (start, Counted::default(), 0.0);
    for _ in 0..steps {
        let next = model.step(state, step_s, variant, &mut counted);
        square += 0.5 * (state.x_m * state.x_m + next.x_m * next.x_m);
        state = next;
    }
    counted.rms_x_m = (square / steps as f64).sqrt();
    counted
}

/// A row of the table.
struct SchemeRow {
    clearance_ratio: f64,
    variant: Variant,
    step_s: f64,
    scheme: Counted,
    exact: Counted,
}

/// Computes the table and the figure of a part.
pub(super) fn run(folder: &Path, report: &(dyn Fn(f64) -> bool + Sync)) -> Result<Ending, Failure> {
    let mut rows = Vec::new();
    let all = (CLEARANCE_RATIOS.len() * STEPS_S.len() * Variant::SCHEMES.len()) as f64;
    for clearance_ratio in CLEARANCE_RATIOS {
        let case = case(clearance_ratio)?;
        let exact = exact(&case)?;
        let (model, start) = model(&case).ok_or_else(|| Failure::failed("the scheme has hard walls"))?;
        for step_s in STEPS_S {
            for variant in Variant::SCHEMES {
                if !report(rows.len() as f64 / all) {
                    return Ok(Ending::Stopped);
                }
                let scheme = run_scheme(&model, start, case.run.duration_s, step_s, variant);
                rows.push(SchemeRow { clearance_ratio, variant, step_s, scheme, exact });
            }
        }
        let drivers =
            [(Variant::DriverF64, driver::<f64> as fn(&Case) -> Result<_, _>), (Variant::DriverF32, driver::<f32>)];
        for (variant, driver) in drivers {
            rows.push(SchemeRow { clearance_ratio, variant, step_s: TICK_S, scheme: driver(&case)?, exact });
        }
    }
    let bytes = sealed_parquet::bytes(&table(&rows)?)?;
    own_files::replace(&folder.join(METHOD_TABLE), &bytes)?;
    let series = |(clearance_ratio, variant): (f64, Variant)| {
        let own = rows.iter().filter(move |row| row.clearance_ratio == clearance_ratio && row.variant == variant);
        let points = own.map(|row| (row.step_s, 100.0 * row.error())).collect();
        Series { label: format!("d/x0 = {clearance_ratio}, {}", variant.name()), points }
    };
    let all = CLEARANCE_RATIOS.into_iter().flat_map(|ratio| Variant::SCHEMES.map(|variant| series((ratio, variant))));
    let title = "Free vibration, e = 0.82: the printed scheme against the exact solution";
    let picture = over_step(all.collect(), title, "time step (s)", "error of the RMS of x (%)");
    picture.write(folder, "error")?;
    Ok(Ending::Complete)
}

fn case(clearance_ratio: f64) -> Result<Case, Failure> {
    let set = SetValues::from_arguments(&[format!("particle.clearance_ratio={clearance_ratio}")])?;
    Case::parse_changed(&Source::new("the case of the scheme", CASE), "scheme", &set)
}

fn model(case: &Case) -> Option<(Model, SchemeState)> {
    let (structure, particle) = (&case.set_up.structure, case.set_up.particle?);
    let Wall::Restitution { coefficient } = particle.wall else { return None };
    let model = Model {
        angular_frequency_rad_per_s: structure.angular_frequency_rad_per_s(),
        damping_ratio: structure.damping_ratio(),
        mass_ratio: particle.mass_kg / structure.mass_kg,
        clearance_m: particle.clearance_m,
        restitution: coefficient,
    };
    let Initial { x_m, v_m_per_s, y_m, u_m_per_s } = case.initial;
    Some((model, SchemeState { x_m, v_m_per_s, y_m, u_m_per_s }))
}

fn exact(case: &Case) -> Result<Counted, Failure> {
    let longest_part_s = cost::longest_part_s(case, None)?;
    let options = RunOptions { keep: false, longest_part_s, go_on: &mut |_| true };
    let summary = simulate(case, &mut (), options)?.summary;
    Ok(Counted { rms_x_m: summary.rms_x_m, impacts: summary.impact_count as f64, overlap_m: 0.0 })
}

/// The controller's driver, on a base at rest.
fn driver<S: Scalar>(case: &Case) -> Result<Counted, Failure> {
    let mut motion = Sampled::<S>::new(&case.set_up, Units::metres(TICK_S), &case.initial)?;
    let ticks = (case.run.duration_s / TICK_S).round();
    let mut seen = Seen::default();
    for _ in 0..ticks as u64 {
        motion.step(&BaseSegment::at_rest(S::ZERO), &mut seen);
    }
    Ok(Counted { rms_x_m: (seen.square / ticks).sqrt(), impacts: seen.impacts, overlap_m: 0.0 })
}

/// Sums up the flights of the driver.
#[derive(Default)]
struct Seen {
    /// Integral of x² over the steps, m².
    square: f64,
    impacts: f64,
}

impl<S: Scalar> SampledObserver<S> for Seen {
    fn flight(&mut self, _: S, length: S, flight: &Flight<S>) {
        let length = length.to_f64();
        let x_m =
            |share: f64| flight.x[0].to_f64() + polynomial::increment(&flight.x, S::from_f64(share * length)).to_f64();
        // Gauss's rule with three nodes: its error is far below that of the flight.
        let node = 0.5 * 0.6_f64.sqrt();
        let ends = x_m(0.5 - node).powi(2) + x_m(0.5 + node).powi(2);
        self.square += length * (5.0 * ends + 8.0 * x_m(0.5).powi(2)) / 18.0;
    }

    fn impact(&mut self, _: &SampledImpact<S>) {
        self.impacts += 1.0;
    }
}

impl SchemeRow {
    /// Relative error of the RMS of x.
    fn error(&self) -> f64 {
        self.scheme.rms_x_m / self.exact.rms_x_m - 1.0
    }
}

fn table(rows: &[SchemeRow]) -> Result<RecordBatch, Failure> {
    let number = |name: &str, unit: &str| Column::new(name, unit, "");
    TableBuilder::new(rows)
        .column(number("variant", ""), |row| row.variant.name())
        .column(number("clearance_ratio", "1"), |row| row.clearance_ratio)
        .column(number("step_s", "s"), |row| row.step_s)
        .column(Quantity::RmsXM, |row| row.scheme.rms_x_m)
        .column(number("exact_rms_x_m", "m"), |row| row.exact.rms_x_m)
        .column(number("relative_error", "1"), SchemeRow::error)
        .column(Quantity::Impacts, |row| row.scheme.impacts)
        .column(number("exact_impacts", "1"), |row| row.exact.impacts)
        .column(number("largest_overlap_m", "m"), |row| row.scheme.overlap_m)
        .finish(Metadata::new())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_impact_keeps_the_momentum_and_turns_the_relative_velocity() {
        let (model, start) = model(&case(0.5).expect("a case")).expect("hard walls");
        let before = SchemeState { v_m_per_s: 0.3, u_m_per_s: -0.2, ..start };
        let after = model.impact(before);
        let momentum = |state: SchemeState| state.v_m_per_s + model.mass_ratio * state.u_m_per_s;
        assert!((momentum(after) - momentum(before)).abs() < 1e-16);
        let relative = |state: SchemeState| state.u_m_per_s - state.v_m_per_s;
        assert!((relative(after) + 0.82 * relative(before)).abs() < 1e-15);
    }

    #[test]
    fn located_impacts_give_the_exact_motion_up_to_the_last_chatter() {
        for clearance_ratio in CLEARANCE_RATIOS {
            let mut case = case(clearance_ratio).expect("a case");
            // One period: a few impacts, before small differences have grown.
            case.run.duration_s = 0.4;
            let exact = exact(&case).expect("it runs");
            let (model, start) = model(&case).expect("hard walls");
            let error =
                |step_s: f64| run_scheme(&model, start, 0.4, step_s, Variant::Located).rms_x_m / exact.rms_x_m - 1.0;
            // The sum over the steps has an error of second order in the step.
            assert!(error(1e-5).abs() < 1e-8, "{clearance_ratio}: {}", error(1e-5));
            assert!(error(1e-3).abs() < 1e-4, "{clearance_ratio}: {}", error(1e-3));
        }
    }
    /// The driver's flights are exact to the last bits of `f64`; `f32` has 6e-8, which the impacts of a hard wall let grow.
    #[test]
    fn the_controllers_driver_agrees_in_f64_and_stays_close_in_f32() {
        for clearance_ratio in CLEARANCE_RATIOS {
            let case = case(clearance_ratio).expect("a case");
            let exact = exact(&case).expect("it runs");
            let error = |rms_x_m: f64| rms_x_m / exact.rms_x_m - 1.0;
            let [double, single] = [driver::<f64>(&case), driver::<f32>(&case)].map(|driven| driven.expect("it runs"));
            assert!(error(double.rms_x_m).abs() < 1e-9, "{}", error(double.rms_x_m));
            assert_eq!(double.impacts, exact.impacts);
            assert!(error(single.rms_x_m).abs() < 2e-3, "{}", error(single.rms_x_m));
        }
    }
}

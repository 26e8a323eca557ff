//! Derivatives of a periodic motion: its start moves with the quantities so that it repeats.

use std::f64::consts::TAU;

use damprig_core::integrator::exact::Excitation;
use nalgebra::{Complex, DMatrix, Schur};

use super::follow::Follower;
use super::setting::Sloped;
use super::{Drive, MotionCase, NoDerivatives, Varied};
use crate::State;
use crate::contacts::{Slide, Touch};
use crate::motion::Motion;

/// Two states are the same if they differ by less than this share of the motion.
const REPEATS: f64 = 1e-6;

/// Singular values of 1 − M below this share of its largest are zero: the rounding of M is 10⁻¹⁴ per event.
const SINGULAR: f64 = 1e-9;

/// Steps of the search for eigenvalues.
const MAX_ITERATIONS: usize = 10_000;

/// Sections of a period that are tried.
const SECTIONS: u32 = 16;

/// An instant of a motion: its state, what it touches, and how far the events before and after it are.
struct Section {
    state: State,
    at_s: f64,
    /// A particle touches a wall: it has no room for disturbances, or its contact is no part of a state.
    touches: bool,
    sticking: usize,
    clear_s: f64,
}

/// Runs a case to where its last `periods` periods begin, at a section away from events: when, and the state there.
pub(super) fn section(case: &MotionCase, periods: u32) -> Result<(f64, State), NoDerivatives> {
    let Drive::ClosedForm(excitation) = &case.drive else { return Err(NoDerivatives::NotPeriodic) };
    let turning = excitation.angular_frequency_rad_per_s();
    if excitation.next_break_s(0.0).is_finite() || turning == 0.0 {
        return Err(NoDerivatives::NotPeriodic);
    }
    let period_s = TAU / turning;
    let whole = (case.duration_s / period_s * (1.0 + 1e-12)).floor();
    let from = whole - f64::from(periods) - 1.0;
    if from < 0.0 {
        return Err(NoDerivatives::NotPeriodic);
    }
    let mut motion = Motion::new(&case.set_up, excitation, &case.start)?;
    motion.run(from * period_s, &mut ())?;
    let mut sections: Vec<Section> = Vec::new();
    let mut last_event_s = f64::NEG_INFINITY;
    for n in 1..=SECTIONS {
        let at_s = (from + f64::from(n) / f64::from(SECTIONS)) * period_s;
        while motion.time.until(at_s) > 0.0 {
            motion.advance(at_s, &mut ())?;
            if motion.handled.is_some() {
                last_event_s = motion.time_s();
                if let Some(last) = sections.last_mut() {
                    last.clear_s = last.clear_s.min(last_event_s - last.at_s);
                }
            }
        }
        let contacts = &motion.contacts;
        sections.push(Section {
            state: motion.state(),
            at_s,
            touches: contacts.touches.iter().any(|touch| *touch != Touch::None),
            sticking: contacts.slides.iter().filter(|slide| **slide == Slide::Stuck).count(),
            clear_s: at_s - last_event_s,
        });
    }
    let better = |a: &Section, b: &Section| b.sticking.cmp(&a.sticking).then(a.clear_s.total_cmp(&b.clear_s));
    let best = sections.into_iter().filter(|section| !section.touches).max_by(better);
    best.map(|section| (section.at_s, section.state)).ok_or(NoDerivatives::NotIsolated)
}

/// After how many of the `most` periods of a case its state is that of its start.
pub(super) fn repeats_after(case: &MotionCase, most: u32) -> Result<u32, NoDerivatives> {
    let mut motion = Motion::new(&case.set_up, &case.excitation(), &case.start)?;
    let (mut size_m, (start, start_rate)) = (0.0_f64, motion.bodies());
    let mass: Vec<f64> = motion.mount.bodies.mass.iter().map(|mass| mass.sqrt()).collect();
    let norm =
        |of: &mut dyn Iterator<Item = f64>| of.zip(&mass).map(|(of, root)| (of * root).abs()).fold(0.0, f64::max);
    let mut speed_m_per_s = 0.0_f64;
    for period in 1..=most {
        for part in 1..=SECTIONS {
            let share = (f64::from(period - 1) + f64::from(part) / f64::from(SECTIONS)) / f64::from(most);
            motion.run(share * case.duration_s, &mut ())?;
            let (q, v) = motion.bodies();
            size_m = size_m.max(norm(&mut q.into_iter()));
            speed_m_per_s = speed_m_per_s.max(norm(&mut v.into_iter()));
        }
        let (q, v) = motion.bodies();
        let apart_m = norm(&mut q.iter().zip(&start).map(|(a, b)| a - b));
        let apart_m_per_s = norm(&mut v.iter().zip(&start_rate).map(|(a, b)| a - b));
        if apart_m <= REPEATS * size_m && apart_m_per_s <= REPEATS * speed_m_per_s {
            return Ok(period);
        }
    }
    Err(NoDerivatives::NotPeriodic)
}

impl MotionCase {
    /// The motion over `periods` periods of its sine from `state`, with the phase of the sine `advance_rad` later than at the start.
    pub(super) fn of_periods(&self, periods: u32, state: &State, advance_rad: f64) -> Self {
        let mut case = self.clone();
        case.start = state.clone();
        if let Drive::ClosedForm(
            Excitation::Sine { phase_rad, angular_frequency_rad_per_s, .. }
            | Excitation::ForceSine { phase_rad, angular_frequency_rad_per_s, .. },
        ) = &mut case.drive
        {
            *phase_rad += advance_rad;
            case.duration_s = f64::from(periods) * TAU / *angular_frequency_rad_per_s;
        }
        if let Some(beside) = &mut case.set_up.force_beside_base {
            beside.phase_rad += advance_rad;
        }
        case
    }
}

impl Follower<'_> {
    /// The disturbances of the start as independent ones of comparable size, where friction does not let all begin.
    pub(super) fn take_free_starts(&mut self) {
        let (bodies, quantities) = (self.bodies(), self.others.len());
        let svd = DMatrix::from_fn(2 * bodies, 2 * bodies, |i, j| {
            self.scale(i) * self.s[(i, quantities + j)] / self.scale(j)
        })
        .svd(true, false);
        let Some(along) = svd.u else { return };
        for (j, size) in svd.singular_values.iter().enumerate() {
            let share = if *size > SINGULAR * svd.singular_values.max() { 1.0 } else { 0.0 };
            for i in 0..2 * bodies {
                self.s[(i, quantities + j)] = share * along[(i, j)] / self.scale(i);
            }
        }
        self.start = self.s.clone();
        self.start_w = self.w.clone();
    }

    /// Lets the start move with the quantities so that the motion repeats; gives the multipliers of disturbances, the largest first.
    pub(super) fn close_orbit(&mut self) -> Result<Vec<Complex<f64>>, NoDerivatives> {
        let (bodies, quantities) = (self.bodies(), self.others.len());
        let scaled = |of: &DMatrix<f64>, from: usize, count: usize| {
            DMatrix::from_fn(2 * bodies, count, |i, j| self.scale(i) * of[(i, from + j)])
        };
        let along = scaled(&self.start, quantities, 2 * bodies);
        let grown = along.transpose() * scaled(&self.s, quantities, 2 * bodies);
        let stays = along.transpose() * &along - &grown;
        let moves = along.transpose() * (scaled(&self.s, 0, quantities) - scaled(&self.start, 0, quantities));
        // Directions that friction does not let begin have no part in it.
        let free: Vec<usize> = (0..2 * bodies).filter(|&i| along.column(i).norm() > 0.0).collect();
        let of_free = |matrix: &DMatrix<f64>| matrix.select_rows(&free).select_columns(&free);
        // Without a bound the iteration may not end, as for some matrices with several zeros; the multipliers are then not known.
        let schur = Schur::try_new(of_free(&grown), f64::EPSILON, MAX_ITERATIONS);
        let mut multipliers: Vec<Complex<f64>> =
            schur.map(|schur| schur.complex_eigenvalues().iter().copied().collect()).unwrap_or_default();
        multipliers.sort_by(|a, b| b.norm_sqr().total_cmp(&a.norm_sqr()));
        let stays = of_free(&stays);
        let svd = stays.svd(true, true);
        if svd.singular_values.min() <= SINGULAR * svd.singular_values.max() {
            return Err(NoDerivatives::NotIsolated);
        }
        let solve = |of: &DMatrix<f64>| svd.solve(&of.select_rows(&free), 0.0).map_err(|_| NoDerivatives::NotIsolated);
        // How far the motion is from the orbit, by what it misses after its periods.
        let missed = DMatrix::from_fn(2 * bodies, 1, |i, _| self.scale(i) * (self.w[i] - self.start_w[i]));
        if solve(&(along.transpose() * missed))?.norm() > REPEATS * self.sizes[0] {
            return Err(NoDerivatives::NotPeriodic);
        }
        let solved = solve(&moves)?;
        let mut by = DMatrix::zeros(2 * bodies, quantities);
        for (row, &i) in free.iter().enumerate() {
            by.row_mut(i).copy_from(&solved.row(row));
        }
        let moved = |of: &mut Sloped| {
            let more = by.tr_mul(&of.slopes.rows(quantities, 2 * bodies));
            let mut own = of.slopes.rows_mut(0, quantities);
            own += more;
        };
        let more = self.s.view((0, quantities), (2 * bodies, 2 * bodies)) * &by;
        let mut own = self.s.view_mut((0, 0), (2 * bodies, quantities));
        own += more;
        self.margins.iter_mut().for_each(moved);
        self.squares.iter_mut().for_each(moved);
        self.peaks.iter_mut().flatten().for_each(moved);
        for (.., time, speed) in &mut self.impacts {
            moved(time);
            moved(speed);
        }
        Ok(multipliers)
    }
}

/// The motions of [`Varied`] over these periods.
pub(super) fn varied_at(varied: &[Varied], periods: u32, state: &State, advance_rad: f64) -> Vec<Varied> {
    let at = |varied: &Varied| Varied {
        value: varied.value,
        cases: varied.cases.each_ref().map(|case| case.of_periods(periods, state, advance_rad)),
    };
    varied.iter().map(at).collect()
}

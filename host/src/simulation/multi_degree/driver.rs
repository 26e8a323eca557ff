//! Runs a case with a structure of several degrees of freedom: every event at its instant.

use damprig_core::analysis::energy::Balance;
use damprig_core::integrator::exact::flow::ExactState;
use damprig_core::integrator::exact::response::{Response, Wanted};
use damprig_core::io::Invalid;
use damprig_motion::placed_motion::powers;
use damprig_structures::{EnergyBook, HertzContact, Impact, Motion, Observer, Piece, Refused, State};

use super::measure::{DamperMeter, HarvestMeter, ModeMeter, PlaceMeter, PlacesResult, measured_from_s};
use super::piece::PieceAtPlace;
use super::{MultiDegree, Shown};
use crate::motion_record::{Play, Record};
use crate::simulation::Case;
use crate::simulation::collector::{Collector, RunOptions, run_in_parts};
use crate::simulation::motion::{ContactRecord, ImpactRecord, Viewer};
use crate::simulation::result::Summary;

/// Steps between two questions whether to go on: about a millisecond.
const STEPS_PER_QUESTION: u32 = 256;

/// Shows the motion at the observed place to a viewer and measures all places.
struct MotionWatch<'a, 'v> {
    of: &'a MultiDegree,
    shown: Shown,
    viewer: &'a mut (dyn Viewer + 'v),
    /// Of every place; none if only the viewer is to see the motion.
    places: &'a mut [PlaceMeter],
    /// Of every impact damper; none if only the viewer is to see the motion.
    dampers: &'a mut [DamperMeter],
    /// Of every mode; none if only the viewer is to see the motion.
    modes: &'a mut [ModeMeter],
    /// Of the piezoelectric walls, while it is measured.
    harvest: &'a mut Option<HarvestMeter>,
    go_on: &'a mut dyn FnMut(f64) -> bool,
    steps: u32,
    is_stopped: bool,
}

impl Observer for MotionWatch<'_, '_> {
    const PIECES: bool = true;

    fn piece(&mut self, piece: &Piece) {
        if piece.start_s + piece.length_s >= self.viewer.pieces_from_s() {
            self.viewer.piece(&PieceAtPlace::new(piece, self.of.observed, self.shown));
        }
        self.places.iter_mut().for_each(|meter| meter.piece(piece));
        self.dampers.iter_mut().for_each(|meter| meter.piece(piece));
        self.modes.iter_mut().for_each(|meter| meter.piece(piece));
        self.harvest.iter_mut().for_each(|meter| meter.piece(piece));
    }

    fn impact(&mut self, impact: &Impact) {
        let Impact { time_s, damper, side, approach_speed_m_per_s, y_m, .. } = *impact;
        if let Some(meter) = self.dampers.get_mut(damper) {
            meter.impact(impact);
        }
        let is_shown = self.shown.particle == Some(damper);
        self.viewer.impact(&ImpactRecord {
            t_s: time_s,
            side,
            approach_speed_m_per_s,
            y_m: if is_shown { y_m } else { f64::NAN },
            damper: u32::try_from(damper + 1).ok(),
        });
    }

    fn contact(&mut self, contact: &HertzContact) {
        let HertzContact { touch_s, damper, side, approach_speed_m_per_s, separation_speed_m_per_s, .. } = *contact;
        if let Some(meter) = self.dampers.get_mut(damper) {
            meter.contact(contact);
        }
        self.viewer.contact(&ContactRecord {
            t_s: touch_s,
            side,
            approach_speed_m_per_s,
            duration_s: contact.duration_s,
            peak_force_n: contact.peak_force_n,
            restitution: (approach_speed_m_per_s > 0.0).then(|| separation_speed_m_per_s / approach_speed_m_per_s),
            damper: u32::try_from(damper + 1).ok(),
        });
    }

    fn goes_on(&mut self, time_s: f64) -> bool {
        self.steps += 1;
        if self.steps >= STEPS_PER_QUESTION {
            self.steps = 0;
            self.is_stopped |= !(self.go_on)(time_s);
        }
        !self.is_stopped
    }
}

/// The motion of a case: under its excitation, or on its record, sample interval after sample interval.
struct CaseMotion<'a> {
    motion: Motion,
    on_record: Option<OnRecord<'a>>,
}

/// Where a record is being played.
struct OnRecord<'a> {
    record: &'a Record,
    play: Play<'a>,
    /// Intervals that have begun.
    begun: u64,
}

impl<'a> CaseMotion<'a> {
    fn new(case: &'a Case, of: &MultiDegree) -> Result<Self, Refused> {
        let Some(record) = &case.record else {
            return Ok(Self { motion: Motion::new(&of.set_up, &case.excitation, &of.start)?, on_record: None });
        };
        let mut play = record.play();
        let first = powers(&play.next_segment(), record.step_s);
        let motion = Motion::on_base(&of.set_up, first, &of.start)?;
        Ok(Self { motion, on_record: Some(OnRecord { record, play, begun: 1 }) })
    }

    /// Advances to `until_s`, or to where the observer ends the run.
    fn run(&mut self, until_s: f64, observer: &mut impl Observer) -> Result<(), Refused> {
        let Some(on_record) = &mut self.on_record else { return self.motion.run(until_s, observer) };
        loop {
            let end_s = on_record.begun as f64 * on_record.record.step_s;
            self.motion.run(until_s.min(end_s), observer)?;
            if end_s >= until_s || self.motion.time_s() < end_s {
                return Ok(());
            }
            self.motion.follow(powers(&on_record.play.next_segment(), on_record.record.step_s))?;
            on_record.begun += 1;
        }
    }
}

/// Whether a case can be simulated.
pub(super) fn check(case: &Case, of: &MultiDegree) -> Result<(), Refused> {
    CaseMotion::new(case, of).map(drop)
}

/// Runs the case.
///
/// # Errors
/// Names a value that is not physical.
pub(in crate::simulation) fn run<V: Viewer>(
    case: &Case,
    of: &MultiDegree,
    wanted: Wanted,
    collector: &mut Collector<'_, V>,
    options: RunOptions,
) -> Result<(Summary, ExactState, PlacesResult), Invalid> {
    let mut running = CaseMotion::new(case, of).map_err(Invalid::from)?;
    let mut response = Response::new(wanted);
    let mut places: Vec<_> = (0..of.places.len()).map(|place| PlaceMeter::new(place, of.is_frame())).collect();
    let mut dampers = DamperMeter::all(of);
    let from_s = measured_from_s(case);
    let mut modes = ModeMeter::all(of, from_s);
    let mut harvest = None;
    let mut refused = Ok(());
    let shown = of.shown();
    run_in_parts(case.run.duration_s, options, collector, |until_s, collector, go_on| {
        let mut viewer = (&mut response, collector.all());
        let mut watch = MotionWatch {
            of,
            shown,
            viewer: &mut viewer,
            places: &mut places,
            dampers: &mut dampers,
            modes: &mut modes,
            harvest: &mut harvest,
            go_on,
            steps: 0,
            is_stopped: false,
        };
        // The clock of an estimate starts after the set-up.
        if refused.is_ok() && (running.motion.time_s() > 0.0 || (watch.go_on)(0.0)) {
            refused = running.run(from_s.max(running.motion.time_s()).min(until_s), &mut watch);
            if watch.harvest.is_none() && running.motion.time_s() >= from_s {
                *watch.harvest = HarvestMeter::new(&running.motion);
            }
            refused = refused.and_then(|()| running.run(until_s, &mut watch));
        }
        running.motion.time_s()
    });
    refused.map_err(Invalid::from)?;
    let motion = running.motion;
    response.finish(motion.time_s());
    DamperMeter::end(&mut dampers, &motion);
    let harvested = |damper| harvest.as_ref().and_then(|meter| meter.power_and_voltage(motion.time_s(), damper));
    let summary = Summary {
        harvested_power_w: harvested(None).map(|(power_w, _)| power_w),
        peak_contact_force_n: DamperMeter::largest_n(&dampers),
        ..Summary::of(case, &response, motion.time_s(), motion.unresolved())
    };
    let impact_dampers = of.set_up.impact_dampers.iter().zip(dampers).enumerate();
    let result = PlacesResult {
        places: of.places.iter().zip(&places).map(|(name, meter)| meter.result(name)).collect(),
        impact_dampers: impact_dampers
            .map(|(n, (damper, meter))| meter.result(&of.places[damper.place], harvested(Some(n))))
            .collect(),
        mode_shares: ModeMeter::shares(&modes),
        measured_from_s: from_s,
    };
    Ok((summary, end(of, &motion), result))
}

/// Keeps the energy book of a run.
struct Booked<'a> {
    book: EnergyBook,
    go_on: &'a mut dyn FnMut(f64) -> bool,
    steps: u32,
    is_stopped: bool,
}

impl Observer for Booked<'_> {
    const PIECES: bool = true;

    fn piece(&mut self, piece: &Piece) {
        self.book.piece(piece);
    }

    fn impact(&mut self, impact: &Impact) {
        self.book.impact(impact);
    }

    fn goes_on(&mut self, time_s: f64) -> bool {
        self.steps += 1;
        if self.steps.is_multiple_of(STEPS_PER_QUESTION) {
            self.is_stopped |= !(self.go_on)(time_s);
        }
        !self.is_stopped
    }
}

/// The energy balance of the whole run; `None` if it was stopped, or is not known ([`EnergyBook::new`]).
pub fn energy(case: &Case, of: &MultiDegree, go_on: &mut dyn FnMut(f64) -> bool) -> Option<Balance> {
    let mut running = CaseMotion::new(case, of).ok()?;
    let book = EnergyBook::new(&running.motion)?;
    let mut booked = Booked { book, go_on, steps: 0, is_stopped: false };
    running.run(case.run.duration_s, &mut booked).ok()?;
    (!booked.is_stopped).then(|| booked.book.balance(&running.motion))
}

/// Runs a case up to `end_s`, s, and gives its summary from the cycle `first_cycle` on, which begins at `from_s`. `None` if it was stopped: `go_on` is
/// asked now and then.
///
/// # Errors
/// Names a value that is not physical.
pub fn counted(
    case: &Case,
    of: &MultiDegree,
    (first_cycle, from_s): (u64, f64),
    end_s: f64,
    wanted: Wanted,
    go_on: &dyn Fn() -> bool,
) -> Result<Option<Summary>, Invalid> {
    let mut running = CaseMotion::new(case, of).map_err(Invalid::from)?;
    let mut go_on = |_: f64| go_on();
    let mut response = Response::new(wanted);
    response.skip_to(first_cycle);
    let (mut nothing, mut is_stopped, shown) = ((), false, of.shown());
    let (mut harvest, mut dampers) = (None, Vec::new());
    for (until_s, is_counted) in [(from_s, false), (end_s, true)] {
        if is_counted {
            harvest = HarvestMeter::new(&running.motion);
            dampers = if wanted.whole_run { DamperMeter::all(of) } else { Vec::new() };
        }
        let viewer: &mut dyn Viewer = if is_counted { &mut response } else { &mut nothing };
        let mut watch = MotionWatch {
            of,
            shown,
            viewer,
            places: &mut [],
            dampers: &mut dampers,
            modes: &mut [],
            harvest: &mut harvest,
            go_on: &mut go_on,
            steps: 0,
            is_stopped,
        };
        running.run(until_s, &mut watch).map_err(Invalid::from)?;
        is_stopped = watch.is_stopped;
    }
    let motion = running.motion;
    response.finish(motion.time_s());
    DamperMeter::end(&mut dampers, &motion);
    let harvested = harvest.and_then(|meter| meter.power_and_voltage(end_s, None));
    Ok((!is_stopped).then(|| Summary {
        harvested_power_w: harvested.map(|(power_w, _)| power_w),
        peak_contact_force_n: DamperMeter::largest_n(&dampers),
        ..Summary::of(case, &response, end_s, motion.unresolved())
    }))
}

/// Simulates cycles of the excitation from a state: after those of a transient it passes the state at the observed place at the end of each and the
/// largest |x| of the cycle to `keep`. Returns the last state.
///
/// # Errors
/// Names a value that is not physical.
pub fn cycles(
    case: &Case,
    of: &MultiDegree,
    start: &State,
    (settle, count): (u32, u32),
    keep: &mut dyn FnMut(&ExactState, f64),
) -> Result<State, Invalid> {
    let mut motion = Motion::new(&of.set_up, &case.excitation, start).map_err(Invalid::from)?;
    let cycle_s = case.drive_period_s().unwrap_or_else(|| case.cycle_s());
    motion.run(f64::from(settle) * cycle_s, &mut ()).map_err(Invalid::from)?;
    for cycle in settle..settle + count {
        let mut response = response_of_cycle(cycle, cycle_s);
        let mut watch = MotionWatch {
            of,
            shown: of.shown(),
            viewer: &mut response,
            places: &mut [],
            dampers: &mut [],
            modes: &mut [],
            harvest: &mut None,
            go_on: &mut |_| true,
            steps: 0,
            is_stopped: false,
        };
        motion.run(f64::from(cycle + 1) * cycle_s, &mut watch).map_err(Invalid::from)?;
        response.finish(motion.time_s());
        keep(&end(of, &motion), response.last_cycle_max_m().unwrap_or(f64::NAN));
    }
    Ok(motion.state())
}

/// Measures the cycle of this number alone.
pub fn response_of_cycle(cycle: u32, cycle_s: f64) -> Response {
    let first = u64::from(cycle);
    let mut response =
        Response::new(Wanted { cycle_s: Some(cycle_s), steady_from_cycle: Some(first), whole_run: false });
    response.skip_to(first);
    response
}

/// The state at the observed place at the end of a run.
fn end(of: &MultiDegree, motion: &Motion) -> ExactState {
    let state = motion.state();
    let here = of.set_up.place(&state, of.observed, motion.base());
    let second = of.second_mass(&state).unwrap_or(here);
    ExactState {
        x_m: here.y_m,
        v_m_per_s: here.u_m_per_s,
        offset_m: second.y_m - here.y_m,
        slide_m_per_s: second.u_m_per_s - here.u_m_per_s,
    }
}

//! Exact derivatives of a motion under a sine by its start and by parameters, through every event.
//!
//! One column after the other, a motion is followed with dual numbers: within a leg by the exponential of its matrix, and at an
//! event by the shift of its time, −(∂g/∂p)/g′ of the guard g, and by the reset (saltation). A periodic orbit moves with a parameter by
//! (1 − M)⁻¹ b, M being the derivative of its return by the state and b that by the parameter.

use damprig_core::integrator::modes::{Contact, Grip};
use damprig_core::model::Initial;
use nalgebra::DMatrix;

use crate::checks::root_within;
use crate::dual::{Dual, Real};
use crate::equations::Equations;
use crate::flow::place::{V, X};
use crate::flow::{N, STATE, Square, Vector, complete, dot, exponential, steps, times};
use crate::parameter::Parameter;
use crate::return_map::{Leg, LegEnd, ReturnMap, UnresolvedEvent};
use crate::sequence::{Guard, Phase};

/// A value with its derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct Derived {
    /// The value.
    pub value: f64,
    /// Its derivatives by x, x′, y − x and y′ − x′ at the start, in SI units; 0 of a periodic orbit, whose start follows the parameters.
    pub by_start: [f64; 4],
    /// Its derivatives by the parameters, per SI unit of each.
    pub by_parameters: Vec<f64>,
}

/// The largest of several values.
#[derive(Clone, Debug, PartialEq)]
pub struct Largest {
    /// It, with its derivatives.
    pub of: Derived,
    /// Whether another one is as large, to within 10⁻⁹, with other derivatives: there is no derivative from both sides then, and that here is of
    /// one of them.
    pub is_tie: bool,
}

/// An impact on a hard wall, or the touch of a soft one.
#[derive(Clone, Debug, PartialEq)]
pub struct DerivedImpact {
    /// Time after the start, s.
    pub time_s: Derived,
    /// Approach speed, m/s.
    pub approach_speed_m_per_s: Derived,
}

/// What a motion over whole drive periods is, with derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct Derivatives {
    /// x, x′, y − x and y′ − x′ at the end, m and m/s.
    pub end: [Derived; 4],
    /// Impacts, in the order of time.
    pub impacts: Vec<DerivedImpact>,
    /// Largest |x|, m.
    pub largest_abs_x_m: Largest,
    /// Approach speed of the fastest impact, m/s; `None` without impacts.
    pub fastest_impact_m_per_s: Option<Largest>,
    /// Root of the mean of x² over the motion, m.
    pub rms_x_m: Derived,
    /// Largest growth of a small disturbance of the start, displacements per amplitude and velocities per amplitude × Ω.
    pub growth: f64,
    /// Of each parameter the relative change within which, to first order, the sequence of events stays; infinite if no change ends it.
    pub holds_within: Vec<f64>,
}

/// Why a motion has no derivatives.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoDerivatives {
    /// An event is not certain.
    #[error("no derivatives: {0}")]
    UnresolvedEvent(#[from] UnresolvedEvent),
    /// Impacts accumulate.
    #[error("no derivatives: the particle comes to rest on a wall after infinitely many impacts (chatter)")]
    Chatter,
    /// A small change of a parameter removes an event or adds one.
    #[error(
        "no derivatives: a relative change of {change:.0e} of a parameter changes the sequence of events (grazing)"
    )]
    Grazing {
        /// The smallest such relative change.
        change: f64,
    },
    /// Small disturbances grow so much that rounding is no longer small.
    #[error(
        "no derivatives: disturbances grow {growth:.0e} times over the motion, which is chaotic, or passes through chaos; a longer run may end on a periodic motion, which has them"
    )]
    Growth {
        /// The growth.
        growth: f64,
    },
    /// The orbit is not isolated, or does not depend smoothly on the parameters: it is at a bifurcation.
    #[error(
        "no derivatives: the orbit is not alone (a particle that meets no wall may be anywhere), or at a bifurcation"
    )]
    NotIsolated,
}

/// A motion changes its events within this relative change of a parameter: it is said to graze. Chosen: a derivative that holds for less
/// says nothing about a design.
const GRAZING: f64 = 1e-6;

/// Largest growth. The rounding of the start, 10⁻¹⁶, then changes the derivatives by 10⁻⁹ of their size.
const MAX_GROWTH: f64 = 1e7;

/// Two values are equally large within this share of them.
const TIE: f64 = 1e-9;

/// Derivatives of two equally large values differ if they do by this share of them, per relative change.
const DIFFERENT: f64 = 1e-6;

/// Longest step between looks at a leg: an angle of its fastest rate, rad.
const STEP_RAD: f64 = 0.25;

/// Nodes and weights of Gauss and Legendre on 0 to 1, with five nodes: over steps of 0.25 rad, whose squares turn by 0.5 rad, the
/// rest is below 10⁻¹⁶.
const GAUSS: [(f64, f64); 5] = [
    (0.046910077030668, 0.118463442528094_54),
    (0.230765344947158_45, 0.239314335249683_23),
    (0.5, 0.284444444444444_44),
    (0.769234655052841_5, 0.239314335249683_23),
    (0.953089922969332, 0.118463442528094_54),
];

/// A guard below this share of its terms is zero.
const ZERO: f64 = 1e-9;

/// Singular values of 1 − M below this share of its largest are zero: the rounding of M is 10⁻¹⁴ per event.
const SINGULAR: f64 = 1e-9;

/// A motion with its derivative along one column, without units.
struct Column {
    end: [Dual<f64>; STATE],
    /// Time and approach speed of the impacts.
    impacts: Vec<(Dual<f64>, Dual<f64>)>,
    /// |x| where it may be largest.
    peaks: Vec<Dual<f64>>,
    rms: Dual<f64>,
    /// By how much a guard, a duration or a force may change before an event is lost or gained, to first order, with the derivative of it.
    margins: Vec<Dual<f64>>,
}

impl ReturnMap {
    /// Derivatives of the motion from `start`, by its start and by `parameters`. Every other quantity keeps its value in SI units.
    ///
    /// # Errors
    /// The motion has none, with the reason.
    pub fn derivatives(&self, start: &Initial, parameters: &[Parameter]) -> Result<Derivatives, NoDerivatives> {
        let followed = self.followed(start, parameters)?;
        followed.derivatives(None)
    }

    /// Derivatives of the periodic orbit through `start` by `parameters`: the start moves so that the motion repeats.
    ///
    /// # Errors
    /// The orbit has none, with the reason.
    pub fn orbit_derivatives(&self, start: &Initial, parameters: &[Parameter]) -> Result<Derivatives, NoDerivatives> {
        let followed = self.followed(start, parameters)?;
        let moves = followed.start_of_orbit()?;
        followed.derivatives(Some(&moves))
    }

    /// Follows the motion once for each component of its start and each parameter.
    fn followed(&self, start: &Initial, parameters: &[Parameter]) -> Result<Followed<'_>, NoDerivatives> {
        let legs = self.legs(start)?;
        if legs.iter().any(|leg| matches!(leg.end, LegEnd::Rest(_))) {
            return Err(NoDerivatives::Chatter);
        }
        let system = self.system();
        let of_start = (0..system.size()).map(|k| follow(&legs, &system.equations::<Dual<f64>>(&[]), Some(k)));
        let settings: Vec<_> = parameters.iter().map(|parameter| (*parameter, system.value(*parameter))).collect();
        let of_parameters = settings.iter().map(|setting| follow(&legs, &system.equations_along(&[*setting], 0), None));
        Ok(Followed {
            map: self,
            values: settings.iter().map(|(_, value)| *value).collect(),
            of_start: of_start.collect(),
            of_parameters: of_parameters.collect(),
        })
    }
}

/// A motion with its derivatives, without units but for those by the parameters.
struct Followed<'a> {
    map: &'a ReturnMap,
    /// Of the parameters, in SI units.
    values: Vec<f64>,
    of_start: Vec<Column>,
    of_parameters: Vec<Column>,
}

impl Followed<'_> {
    /// Derivative of the end by the start.
    fn matrix(&self) -> DMatrix<f64> {
        let size = self.of_start.len();
        DMatrix::from_fn(size, size, |row, k| self.of_start[k].end[row].slope)
    }

    /// The derivatives of the start of a periodic orbit by the parameters.
    fn start_of_orbit(&self) -> Result<DMatrix<f64>, NoDerivatives> {
        let size = self.of_start.len();
        let matrix = DMatrix::identity(size, size) - self.matrix();
        let by_parameters =
            DMatrix::from_fn(size, self.of_parameters.len(), |row, p| self.of_parameters[p].end[row].slope);
        let svd = matrix.svd(true, true);
        if svd.singular_values.min() <= SINGULAR * svd.singular_values.max() {
            return Err(NoDerivatives::NotIsolated);
        }
        svd.solve(&by_parameters, 0.0).map_err(|_| NoDerivatives::NotIsolated)
    }

    /// `moves`: how the start moves with the parameters.
    fn derivatives(&self, moves: Option<&DMatrix<f64>>) -> Result<Derivatives, NoDerivatives> {
        let growth = self.matrix().singular_values().max();
        if growth.is_nan() || growth > MAX_GROWTH {
            return Err(NoDerivatives::Growth { growth });
        }
        let holds_within = self.holds_within(moves);
        let change = holds_within.iter().copied().fold(f64::INFINITY, f64::min);
        if change < GRAZING {
            return Err(NoDerivatives::Grazing { change });
        }
        let (length, time) = (self.map.system().length_m, self.map.system().time_s);
        let units = [length, length / time, length, length / time];
        let derive = |unit: f64, of: &dyn Fn(&Column) -> Dual<f64>| self.derive(unit, units, moves, of);
        let first = &self.of_start[0];
        let impacts = (0..first.impacts.len()).map(|n| DerivedImpact {
            time_s: derive(time, &move |column| column.impacts[n].0),
            approach_speed_m_per_s: derive(units[V], &move |column| column.impacts[n].1),
        });
        // By the start in units of the motion, by parameters for relative changes.
        let sizes: Vec<f64> = units.iter().chain(&self.values).map(|size| size.abs()).collect();
        let peaks = |n: usize| derive(length, &move |column| column.peaks[n]);
        let impacts: Vec<DerivedImpact> = impacts.collect();
        Ok(Derivatives {
            end: std::array::from_fn(|row| derive(units[row], &move |column| column.end[row])),
            largest_abs_x_m: largest((0..first.peaks.len()).map(peaks), &sizes).ok_or(UnresolvedEvent)?,
            fastest_impact_m_per_s: largest(impacts.iter().map(|impact| impact.approach_speed_m_per_s.clone()), &sizes),
            impacts,
            rms_x_m: derive(length, &|column| column.rms),
            growth,
            holds_within,
        })
    }

    /// A quantity of the columns in a unit.
    fn derive(
        &self,
        unit: f64,
        start_units: [f64; 4],
        moves: Option<&DMatrix<f64>>,
        of: &dyn Fn(&Column) -> Dual<f64>,
    ) -> Derived {
        let by_start: Vec<f64> = self.of_start.iter().map(|column| of(column).slope).collect();
        let by_parameters = self.of_parameters.iter().enumerate().map(|(p, column)| {
            let by_move =
                |moves: &DMatrix<f64>| by_start.iter().zip(moves.column(p).iter()).map(|(by, of)| by * of).sum();
            unit * (of(column).slope + moves.map_or(0.0, by_move))
        });
        let own = |k: usize| by_start.get(k).map_or(0.0, |by| unit * by / start_units[k]);
        Derived {
            value: unit * of(&self.of_start[0]).value,
            by_start: if moves.is_some() { [0.0; 4] } else { std::array::from_fn(own) },
            by_parameters: by_parameters.collect(),
        }
    }

    /// Of each parameter the relative change within which the sequence of events stays.
    fn holds_within(&self, moves: Option<&DMatrix<f64>>) -> Vec<f64> {
        let mut within = vec![f64::INFINITY; self.values.len()];
        for n in 0..self.of_start[0].margins.len() {
            let margin = self.derive(1.0, [1.0; 4], moves, &|column| column.margins[n]);
            for (within, (by, value)) in within.iter_mut().zip(margin.by_parameters.iter().zip(&self.values)) {
                *within = within.min(margin.value / (by * value).abs());
            }
        }
        within
    }
}

/// The largest of some values; `sizes`: those of the quantities that their derivatives are taken by. `None` of none.
fn largest(values: impl Iterator<Item = Derived>, sizes: &[f64]) -> Option<Largest> {
    let all: Vec<Derived> = values.collect();
    let of = all.iter().max_by(|a, b| a.value.total_cmp(&b.value))?.clone();
    let changes = |of: &Derived| of.by_start.iter().chain(&of.by_parameters).copied().collect::<Vec<f64>>();
    let differs = |other: &Derived| {
        let pairs = changes(other).into_iter().zip(changes(&of));
        pairs.zip(sizes).any(|((a, b), size)| (a - b).abs() * size > DIFFERENT * of.value)
    };
    let is_tie = all.iter().filter(|other| other.value >= of.value * (1.0 - TIE)).any(differs);
    Some(Largest { of, is_tie })
}

/// Follows the legs along one column: a component of the start, or the parameter along which `equations` have derivatives.
fn follow(legs: &[Leg], equations: &Equations<Dual<f64>>, of_start: Option<usize>) -> Column {
    let zero = Dual::constant(0.0);
    let mut column =
        Column { end: [zero; STATE], impacts: Vec::new(), peaks: Vec::new(), rms: zero, margins: Vec::new() };
    let mut slopes = [0.0; STATE];
    if let Some(k) = of_start {
        slopes[k] = 1.0;
    }
    // A disturbance of bodies that friction holds together.
    let begin = with_slopes(&legs[0].start, &slopes);
    let regained = equations.regain(&legs[0].phase);
    slopes = regained.map(|row| dot(&row, &begin).slope);
    column.see_peak(begin[X]);
    let (mut time, mut square) = (zero, zero);
    for (n, leg) in legs.iter().enumerate() {
        let a = equations.matrix(&leg.phase);
        let start = with_slopes(&leg.start, &slopes);
        if n > 0 {
            column.margins.extend(begins_held(equations, &leg.phase, &start));
        }
        let mut end = column.look(leg, equations, &a, &start, &mut square);
        let guard = equations.guard(&leg.phase, leg.end.event().unwrap_or(Guard::Turn(0)));
        let rate = times(&a, &end);
        let speed = dot(&guard, &rate).value;
        let gap = dot(&guard, &end);
        let shift = -gap.slope / speed;
        if let LegEnd::Event(event, after) = &leg.end {
            // A guard that curves away from zero is missed if it is higher by this.
            let bend = dot(&guard, &times(&a, &rate)).value;
            if bend > 0.0 {
                column.margins.push(Dual { value: 0.5 * speed * speed / bend, slope: gap.slope });
            }
            // The event and the one before it change places.
            if n > 0 {
                column.margins.push(Dual { value: leg.duration, slope: shift });
            }
            column.margins.extend(not_held(equations, *event, after, &end).map(absolute));
        }
        for (end, rate) in end.iter_mut().zip(&rate) {
            end.slope += rate.value * shift;
        }
        square.slope += end[X].value * end[X].value * shift;
        time = time + Dual { value: leg.duration, slope: shift };
        if let Some(Guard::Wall(_)) = leg.end.event() {
            column.impacts.push((time, -dot(&equations.rate(&guard, &leg.phase), &end)));
        }
        column.see_peak(end[X]);
        let rows = leg.reset(equations, &end.map(|entry| Dual::constant(entry.value)));
        let after = rows.map(|row| dot(&row, &end));
        slopes = after.map(|entry| entry.slope);
        column.end = after;
    }
    column.rms = (square / time).sqrt();
    column
}

/// Where a body that stops is not held: what the force is beyond what friction holds.
fn not_held(
    equations: &Equations<Dual<f64>>,
    event: Guard,
    after: &Phase,
    end: &Vector<Dual<f64>>,
) -> Option<Dual<f64>> {
    let (held, breaks) = match (event, after.grip, after.contact) {
        (Guard::SlipStops(_), Grip::Slip(direction), _) => {
            (Phase { grip: Grip::Stuck, ..*after }, Guard::GripBreaks(direction))
        }
        (Guard::SlideStops(_), _, Contact::Free(direction)) if direction != 0 => {
            (Phase { contact: Contact::Held(0), ..*after }, Guard::HoldBreaks(direction))
        }
        _ => return None,
    };
    Some(dot(&equations.guard(&held, breaks), end))
}

/// Where a leg begins with bodies that friction holds: by how much it does.
fn begins_held(equations: &Equations<Dual<f64>>, phase: &Phase, start: &Vector<Dual<f64>>) -> Vec<Dual<f64>> {
    let guards = phase.guards().into_iter();
    let breaks = guards.filter(|guard| matches!(guard, Guard::GripBreaks(_) | Guard::HoldBreaks(_)));
    breaks.map(|guard| absolute(dot(&equations.guard(phase, guard), start))).collect()
}

fn absolute(x: Dual<f64>) -> Dual<f64> {
    if x.value < 0.0 { -x } else { x }
}

/// A completed state with derivatives.
fn with_slopes(state: &[f64; STATE], slopes: &[f64; STATE]) -> Vector<Dual<f64>> {
    complete::<Dual<f64>>(&std::array::from_fn::<_, STATE, _>(|k| Dual { value: state[k], slope: slopes[k] }))
}

impl Column {
    fn see_peak(&mut self, x: Dual<f64>) {
        self.peaks.push(absolute(x));
    }

    /// Follows a leg from its completed start to its end at a fixed duration, and notes what lies between.
    fn look(
        &mut self,
        leg: &Leg,
        equations: &Equations<Dual<f64>>,
        a: &Square<Dual<f64>>,
        start: &Vector<Dual<f64>>,
        square: &mut Dual<f64>,
    ) -> Vector<Dual<f64>> {
        let values = a.map(|row| row.map(|entry| entry.value));
        let count = steps(&values, leg.duration, STEP_RAD);
        let step = leg.duration / count as f64;
        let flow = |after: f64| exponential(a, Dual::constant(after));
        let (one, nodes) = (flow(step), GAUSS.map(|(at, weight)| (flow(at * step), weight * step)));
        let ends = leg.end.event();
        let guards = leg.phase.guards().into_iter().filter(|guard| Some(*guard) != ends);
        // Rows, and their rates, whose roots are extrema.
        let watched: Vec<_> = guards.map(|guard| equations.guard(&leg.phase, guard)).collect();
        let rates: Vec<_> =
            watched.iter().map(|row| equations.rate(row, &leg.phase).map(|entry| entry.value)).collect();
        let mut velocity = [0.0; N];
        velocity[V] = 1.0;
        let mut at = *start;
        // A guard may leave zero with zero rate: what it does in the first step is then rounding.
        let size = |row: &Vector<Dual<f64>>| row.iter().zip(start).map(|(r, w)| (r.value * w.value).abs()).sum::<f64>();
        let leaves_zero = |row: &Vector<Dual<f64>>| dot(row, start).value.abs() <= ZERO * size(row);
        for n in 0..count {
            for (node, weight) in &nodes {
                let x = dot(&node[X], &at);
                *square = *square + x * x * Dual::constant(*weight);
            }
            let next = times(&one, &at);
            let (here, there) = (at.map(|entry| entry.value), next.map(|entry| entry.value));
            // Where a row is zero within the step, the state there.
            let root = |row: &Vector<f64>| {
                let after = root_within(row, &values, &here, step)?;
                Some(times(&flow(after), &at))
            };
            if here[V] * there[V] < 0.0
                && let Some(peak) = root(&velocity)
            {
                self.see_peak(peak[X]);
            }
            for (row, rate) in watched.iter().zip(&rates) {
                if !(n == 0 && leaves_zero(row))
                    && dot(rate, &here) < 0.0
                    && dot(rate, &there) > 0.0
                    && let Some(lowest) = root(rate)
                {
                    let gap = dot(row, &lowest);
                    self.margins.push(Dual { value: gap.value.max(0.0), slope: gap.slope });
                }
            }
            at = next;
        }
        at
    }
}

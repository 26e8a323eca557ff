//! Which impacts of a run can be used, and why others cannot.

use std::collections::BTreeMap;

use super::kink::{HALF_WIDTH_PERIODS, ImpactWindow, MIN_READINGS, MIN_SIDE_PERIODS, SENSOR_S};
use super::{Hit, KnownSetUp, Record};

/// Why an impact is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum LeftOut {
    /// There is no impact before or after it to measure a flight.
    AtTheEnd,
    /// It or a neighbour is a particle that came to rest on the wall.
    Held,
    /// The impact before or after it is on the same wall.
    SameWall,
    /// Another impact is too near for a fit to x between them.
    Crowded,
    /// Readings of x are missing around it.
    Gap,
    /// The friction changed its sign in the flight before or after it, or may have.
    Reversed,
    /// It does not fit the others.
    Misfit,
}

impl LeftOut {
    /// The reason in words, after a number of impacts.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::AtTheEnd => "without an impact before or after",
            Self::Held => "next to a particle at rest on the wall",
            Self::SameWall => "in a chatter, or next to one too weak to be measured (two on one wall in a row)",
            Self::Crowded => "too near to another one",
            Self::Gap => "with missing samples around",
            Self::Reversed => "with a flight in which the particle slid back, or may have",
            Self::Misfit => "that do not fit the others (an impact between was missed, or the rig was disturbed)",
        }
    }
}

/// Three impacts on alternating walls, of which the middle one is used.
#[derive(Clone, Debug)]
pub(super) struct Usable {
    /// Places of the three among all impacts.
    pub(super) places: [usize; 3],
    /// Time of the flights before and after it, s.
    pub(super) flights_s: [f64; 2],
    /// The wall of the middle one, ±1.
    pub(super) side: f64,
}

/// All impacts of some records.
#[derive(Clone, Debug, Default)]
pub(super) struct Sorted {
    /// The readings around each impact; `None` where they do not suffice.
    pub(super) windows: Vec<Option<ImpactWindow>>,
    /// Contact times that are known, s.
    pub(super) contacts_s: Vec<f64>,
    /// The impacts that can be used.
    pub(super) usable: Vec<Usable>,
    /// The others, counted by reason.
    pub(super) left_out: BTreeMap<LeftOut, usize>,
}

impl Sorted {
    /// Sorts the impacts of all records.
    pub(super) fn new(records: &[Record], known: &KnownSetUp) -> Self {
        let mut all = Self::default();
        for record in records {
            all.add(record, known);
        }
        all
    }

    fn add(&mut self, record: &Record, known: &KnownSetUp) {
        let first = self.windows.len();
        let step_s = usual_step_s(&record.t_s);
        let cuts: Vec<Result<ImpactWindow, LeftOut>> =
            (0..record.hits.len()).map(|n| window(record, n, step_s, known)).collect();
        for (n, hit) in record.hits.iter().enumerate() {
            if !hit.clipped && !hit.held {
                self.contacts_s.push(hit.contact_s);
            }
            match reason(record, n, &cuts, known) {
                Some(reason) => *self.left_out.entry(reason).or_default() += 1,
                None => self.usable.push(Usable {
                    places: [first + n - 1, first + n, first + n + 1],
                    flights_s: [n, n + 1].map(|n| record.hits[n].t_s - record.hits[n - 1].t_s),
                    side: hit.side,
                }),
            }
        }
        self.windows.extend(cuts.into_iter().map(Result::ok));
    }
}

/// Why the impact at `n` cannot be used, if it cannot.
fn reason(record: &Record, n: usize, cuts: &[Result<ImpactWindow, LeftOut>], known: &KnownSetUp) -> Option<LeftOut> {
    let hits = &record.hits;
    if n == 0 || n + 1 >= hits.len() {
        return Some(LeftOut::AtTheEnd);
    }
    let three = &hits[n - 1..=n + 1];
    if three.iter().any(|hit| hit.held) {
        return Some(LeftOut::Held);
    }
    if three.windows(2).any(|pair| pair[0].side == pair[1].side) {
        return Some(LeftOut::SameWall);
    }
    // x at the neighbours gives the lengths of the flights.
    if let Some(reason) = cuts[n - 1..=n + 1].iter().find_map(|cut| cut.as_ref().err()) {
        return Some(*reason);
    }
    let slides_back = |from: usize| known.friction_m_per_s2 > 0.0 && slides_back(record, from, known);
    (slides_back(n - 1) || slides_back(n)).then_some(LeftOut::Reversed)
}

/// The readings, `step_s` apart, around an impact for the fit to x.
fn window(record: &Record, n: usize, step_s: f64, known: &KnownSetUp) -> Result<ImpactWindow, LeftOut> {
    let hit = &record.hits[n];
    let period_s = std::f64::consts::TAU / known.angular_frequency_rad_per_s;
    // The pulse of another impact, and what the sensor then sees, end the window.
    let until = |other: &Hit| (other.t_s - hit.t_s).abs() - other.contact_s;
    let before_s = n.checked_sub(1).map_or(f64::MAX, |n| until(&record.hits[n]) - SENSOR_S);
    let after_s = record.hits.get(n + 1).map_or(f64::MAX, until);
    let [before_s, after_s] = [before_s, after_s].map(|side_s| side_s.min(HALF_WIDTH_PERIODS * period_s));
    let inside_s = [-hit.contact_s, hit.contact_s + SENSOR_S];
    if before_s + inside_s[0] < MIN_SIDE_PERIODS * period_s || after_s - inside_s[1] < MIN_SIDE_PERIODS * period_s {
        return Err(LeftOut::Crowded);
    }
    let from = record.t_s.partition_point(|t| *t < hit.t_s - before_s);
    let until = record.t_s.partition_point(|t| *t <= hit.t_s + after_s);
    let times = &record.t_s[from..until];
    let is_whole = times.windows(2).all(|pair| pair[1] - pair[0] < 1.5 * step_s)
        && times.first().is_some_and(|t| t - (hit.t_s - before_s) < 1.5 * step_s)
        && times.last().is_some_and(|t| hit.t_s + after_s - t < 1.5 * step_s);
    if !is_whole {
        return Err(LeftOut::Gap);
    }
    let mut window = ImpactWindow { t_s: Vec::new(), x_m: Vec::new(), side: hit.side };
    let mut sides = [0; 2];
    for (t, x) in times.iter().zip(&record.x_m[from..until]) {
        let since_s = t - hit.t_s;
        if since_s < inside_s[0] || since_s > inside_s[1] {
            window.t_s.push(since_s);
            window.x_m.push(*x);
            sides[usize::from(since_s > 0.0)] += 1;
        }
    }
    if sides.iter().any(|count| *count < MIN_READINGS) { Err(LeftOut::Crowded) } else { Ok(window) }
}

/// The step of evenly spaced times with gaps, s.
pub(super) fn usual_step_s(t_s: &[f64]) -> f64 {
    t_s.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::MAX, f64::min)
}

/// Readings on either side for the structure's velocity in a flight.
const BESIDE: usize = 10;

/// Whether the particle slid back in the flight that begins with the impact at `n`, or may have: its velocity relative to the structure
/// changed its sign, and so did its friction.
///
/// The particle's velocity is taken to change evenly. A slide back of the length τ adds 2aτ to it, a = μi·g, and the flight's travel
/// stays, so at its middle the particle moves towards the other wall slower than that by cτ, c = a(1 − 2p), with p the share of the
/// flight before it. Down to the velocity −D it lasts τ = √(8D/j), with j the structure's jerk. So where it slid back, the even
/// velocity was at most cτ − D ≤ 2c²/j.
fn slides_back(record: &Record, n: usize, known: &KnownSetUp) -> bool {
    let (start, end) = (&record.hits[n], &record.hits[n + 1]);
    let from = record.t_s.partition_point(|t| *t < start.t_s);
    let until = record.t_s.partition_point(|t| *t <= end.t_s);
    let (t, x) = (&record.t_s[from..until], &record.x_m[from..until]);
    if t.len() < 4 * BESIDE {
        return true;
    }
    let length_s = end.t_s - start.t_s;
    let travel_m = x[x.len() - 1] - x[0] + (end.side - start.side) * known.clearance_m;
    (BESIDE..t.len() - BESIDE).any(|at| {
        let structure = (x[at + BESIDE] - x[at - BESIDE]) / (t[at + BESIDE] - t[at - BESIDE]);
        let to_middle_s = 0.5 * length_s - (t[at] - start.t_s);
        let particle = travel_m / length_s - start.side * known.friction_m_per_s2 * to_middle_s;
        // The structure's motion is taken as a sine of its natural frequency.
        let jerk = known.angular_frequency_rad_per_s.powi(2) * structure.abs();
        let c = known.friction_m_per_s2 * (2.0 * to_middle_s / length_s).max(0.0);
        (structure - particle) * start.side * jerk <= 2.0 * c * c
    })
}

//! What is measured at each place, of each impact damper and of each mode.

use std::f64::consts::TAU;

use damprig_core::model::{Particle, Wall};
use damprig_structures::{Course, Harvest, HertzContact, Impact, ImpactDamper, Mode, Motion, Observer, Piece};
use serde::Serialize;

use super::MultiDegree;
use crate::setup::StatedContact;
use crate::simulation::Case;
use crate::table::Column;

/// What happened at each place, to each impact damper and in each mode.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlacesResult {
    /// The places.
    pub places: Vec<PlaceResult>,
    /// The impact dampers.
    pub impact_dampers: Vec<DamperResult>,
    /// The modes of the structure without its dampers, from the lowest frequency up; empty if the run was stopped before they were measured.
    pub mode_shares: Vec<ModeShare>,
    /// From when on `mode_shares` and the harvest are measured, s: the last 20 cycles of a sine, otherwise the run.
    pub measured_from_s: f64,
}

/// What a mode takes part by, relative to the base: over the last 20 cycles of a sine, otherwise over the run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ModeShare {
    /// Its undamped natural frequency, Hz.
    pub frequency_hz: f64,
    /// Its mean energy over that of all modes, from 0 to 1: of ½(q′² + ω²q²) with the modal coordinate q, whose mass is 1 kg. 0 at rest.
    pub energy_share: f64,
    /// √(1/T ∫(φq)² dt) at the observed place, with the mode's shape φ there, m.
    pub rms_x_m: f64,
}

/// The motion of a place.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlaceResult {
    /// Its name.
    pub place: String,
    /// Largest |x|, m.
    pub max_abs_x_m: f64,
    /// Largest |x − z|, m.
    pub max_abs_x_minus_z_m: f64,
    /// √(1/T ∫x² dt), m.
    pub rms_x_m: f64,
    /// Largest |x″| between impacts, m/s²: absolute, not relative to the base.
    pub max_abs_acceleration_m_per_s2: f64,
    /// Of a frame: largest displacement relative to the floor below, or to the base, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_abs_drift_m: Option<f64>,
}

/// The impacts of an impact damper.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DamperResult {
    /// Name of its place.
    pub place: String,
    /// Impacts.
    pub impact_count: u64,
    /// Largest approach speed, m/s; 0 without an impact.
    pub max_approach_speed_m_per_s: f64,
    /// Largest force on a wall, N: of soft walls that of spring and dashpot, of hard ones that of their stated contact. Left out where no wall was
    /// touched, or the contact of a hard one is not stated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub peak_contact_force_n: Option<f64>,
    /// Mean power in the loads of its piezoelectric walls, W: over the last 20 cycles of a sine, otherwise over the run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub harvested_power_w: Option<f64>,
    /// Largest voltage of these walls in that time, V.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_abs_voltage_v: Option<f64>,
}

/// Measures what the loads of piezoelectric walls take, from the present instant on.
pub(super) struct HarvestMeter {
    harvest: Harvest,
    from_s: f64,
}

impl HarvestMeter {
    /// From where the motion is now; `None` where no wall is piezoelectric.
    pub fn new(motion: &Motion) -> Option<Self> {
        let harvest = Harvest::new(motion);
        (!harvest.walls().is_empty()).then(|| Self { harvest, from_s: motion.time_s() })
    }

    /// Takes a piece of motion.
    pub fn piece(&mut self, piece: &Piece) {
        self.harvest.piece(piece);
    }

    /// Mean power in the loads up to a time, W, and their largest voltage, V: of one impact damper, or of all.
    pub fn power_and_voltage(&self, until_s: f64, damper: Option<usize>) -> Option<(f64, f64)> {
        let walls = self.harvest.walls().iter().filter(|wall| damper.is_none_or(|damper| wall.damper == damper));
        let taken = walls.map(|wall| (wall.energy_j / (until_s - self.from_s), wall.largest_abs_v));
        taken.reduce(|(power, voltage), (more, other)| (power + more, f64::max(voltage, other)))
    }
}

/// Counts the impacts of an impact damper, and takes the largest force on its walls.
pub(super) struct DamperMeter {
    damper: usize,
    particle: Particle,
    contacts: [Option<StatedContact>; 2],
    /// mM/(M + m) of particle and structure at its place, whose mass is that of all modes, kg.
    reduced_mass_kg: f64,
    impact_count: u64,
    max_approach_speed_m_per_s: f64,
    peak_n: f64,
}

impl DamperMeter {
    /// Of every impact damper.
    pub fn all(of: &MultiDegree) -> Vec<Self> {
        let meter = |(damper, (own, contacts)): (usize, (&ImpactDamper, &[Option<StatedContact>; 2]))| {
            let of_modes: f64 = of.set_up.structure.modes.iter().map(|mode| mode.shape[own.place].powi(2)).sum();
            Self {
                damper,
                particle: own.particle,
                contacts: *contacts,
                reduced_mass_kg: 1.0 / (1.0 / own.particle.mass_kg + of_modes),
                impact_count: 0,
                max_approach_speed_m_per_s: 0.0,
                peak_n: 0.0,
            }
        };
        of.set_up.impact_dampers.iter().zip(&of.contacts).enumerate().map(meter).collect()
    }

    /// Takes an impact on a hard wall, or the first touch of a soft one.
    pub fn impact(&mut self, impact: &Impact) {
        let (side, speed) = (usize::from(impact.side > 0), impact.approach_speed_m_per_s);
        self.impact_count += 1;
        self.max_approach_speed_m_per_s = self.max_approach_speed_m_per_s.max(speed);
        if let Some((contact, law)) = self.contacts[side].zip(self.particle.walls()[side].impact_law(1.0)) {
            self.peak_n = self.peak_n.max(contact.peak_force_n(&law, self.reduced_mass_kg, speed));
        }
    }

    /// Takes a contact with a Hertz wall.
    pub fn contact(&mut self, contact: &HertzContact) {
        self.peak_n = self.peak_n.max(contact.peak_force_n);
    }

    /// Takes the contacts with Hertz walls that last at the end of a motion.
    pub fn end(all: &mut [Self], motion: &Motion) {
        for contact in motion.hertz_contacts() {
            if let Some(meter) = all.get_mut(contact.damper) {
                meter.contact(&contact);
            }
        }
    }

    /// Takes the force of a wall of spring and dashpot, or of a piezoelectric one, during a piece of motion.
    pub fn piece(&mut self, piece: &Piece) {
        let pressed = piece.pressed_side(self.damper).map(|side| self.particle.walls()[usize::from(side > 0)]);
        if pressed.is_none_or(|wall| wall.hertz().is_some()) {
            return;
        }
        if let Some(force) = piece.wall_force_n(self.damper) {
            self.peak_n = force.largest_abs((0.0, piece.length_s), self.peak_n);
        }
    }

    /// Whether each of its walls has a force: it is soft, or its contact is stated.
    fn is_known(&self) -> bool {
        let is_known = |(wall, contact): (Wall, Option<StatedContact>)| wall.is_soft() || contact.is_some();
        self.particle.walls().into_iter().zip(self.contacts).all(is_known)
    }

    /// The largest force on a wall of all dampers, N; `None` if no wall was touched, or the contact of a hard one is not stated.
    pub fn largest_n(all: &[Self]) -> Option<f64> {
        let peak_n = all.iter().map(|meter| meter.peak_n).reduce(f64::max)?;
        Some(peak_n).filter(|peak_n| *peak_n > 0.0 && all.iter().all(Self::is_known))
    }

    /// The result of the damper at the place of this name; `harvested` is power, W, and voltage, V, of its piezoelectric walls.
    pub fn result(&self, place: &str, harvested: Option<(f64, f64)>) -> DamperResult {
        DamperResult {
            place: place.to_string(),
            impact_count: self.impact_count,
            max_approach_speed_m_per_s: self.max_approach_speed_m_per_s,
            peak_contact_force_n: Self::largest_n(std::slice::from_ref(self)),
            harvested_power_w: harvested.map(|(power_w, _)| power_w),
            max_abs_voltage_v: harvested.map(|(_, voltage_v)| voltage_v),
        }
    }
}

/// Cycles of a sine at the end of a run that the parts of the modes and the harvest are measured over.
const MEASURED_CYCLES: f64 = 20.0;

/// The time from which on the parts of the modes and the harvest are measured, s.
pub(super) fn measured_from_s(case: &Case) -> f64 {
    case.drive_period_s().map_or(0.0, |period_s| (case.run.duration_s - MEASURED_CYCLES * period_s).max(0.0))
}

/// Measures the part of a mode.
pub(super) struct ModeMeter {
    mode: usize,
    from_s: f64,
    angular_frequency_rad_per_s: f64,
    /// φ at the observed place, 1/√kg.
    shape_per_root_kg: f64,
    measured_s: f64,
    /// ∫q² dt and ∫q′² dt.
    square: f64,
    square_of_rate: f64,
}

impl ModeMeter {
    /// Of every mode, from the lowest frequency up, in pieces from this time on.
    pub fn all(of: &MultiDegree, from_s: f64) -> Vec<Self> {
        let meter = |(mode, own): (usize, &Mode)| Self {
            mode,
            from_s,
            angular_frequency_rad_per_s: own.angular_frequency_rad_per_s,
            shape_per_root_kg: own.shape[of.observed],
            measured_s: 0.0,
            square: 0.0,
            square_of_rate: 0.0,
        };
        let mut all: Vec<Self> = of.set_up.structure.modes.iter().enumerate().map(meter).collect();
        all.sort_by(|a, b| a.angular_frequency_rad_per_s.total_cmp(&b.angular_frequency_rad_per_s));
        all
    }

    /// Takes a piece of motion.
    pub fn piece(&mut self, piece: &Piece) {
        if piece.start_s + 0.5 * piece.length_s < self.from_s {
            return;
        }
        let coordinate = piece.modal_coordinate(self.mode);
        self.measured_s += piece.length_s;
        self.square += coordinate.square_m2_s();
        self.square_of_rate += coordinate.rate().square_m2_s();
    }

    /// ∫½(q′² + ω²q²) dt, J·s.
    fn energy_j_s(&self) -> f64 {
        let stiffness = self.angular_frequency_rad_per_s.powi(2);
        0.5 * (self.square_of_rate + stiffness * self.square).max(0.0)
    }

    /// The shares of all modes.
    pub fn shares(all: &[Self]) -> Vec<ModeShare> {
        let whole: f64 = all.iter().map(Self::energy_j_s).sum();
        let share = |of: &Self| ModeShare {
            frequency_hz: of.angular_frequency_rad_per_s / TAU,
            energy_share: if whole > 0.0 { of.energy_j_s() / whole } else { 0.0 },
            rms_x_m: of.shape_per_root_kg.abs() * root_mean(of.square, of.measured_s),
        };
        all.iter().filter(|of| of.measured_s > 0.0).map(share).collect()
    }
}

/// The root of an integral over the time that it was taken over; 0 before any time.
fn root_mean(square_s: f64, measured_s: f64) -> f64 {
    if measured_s > 0.0 { (square_s.max(0.0) / measured_s).sqrt() } else { 0.0 }
}

impl MultiDegree {
    /// The columns that a time history has besides: of every place displacement and acceleration, of every particle and tuned mass the
    /// displacement. In the order of [`Piece::places_at`](crate::simulation::motion::Piece::places_at).
    #[must_use]
    pub fn place_columns(&self) -> Vec<Column> {
        let mut columns = Vec::new();
        for (number, place) in (1..).zip(&self.places) {
            columns.push(Column::new(format!("x_{number}_m"), "m", format!("displacement of {place}")));
            let meaning = format!("absolute acceleration of {place}");
            columns.push(Column::new(format!("acceleration_{number}_m_per_s2"), "m/s²", meaning));
        }
        for (number, damper) in (1..).zip(&self.set_up.impact_dampers) {
            let meaning = format!("displacement of particle {number}, at {}", self.places[damper.place]);
            columns.push(Column::new(format!("y_{number}_m"), "m", meaning));
        }
        for (number, damper) in (1..).zip(&self.set_up.tuned_masses) {
            let meaning = format!("displacement of tuned mass {number}, at {}", self.places[damper.place]);
            columns.push(Column::new(format!("y_tmd_{number}_m"), "m", meaning));
        }
        columns
    }
}

/// Measures the motion of a place.
#[derive(Default)]
pub(super) struct PlaceMeter {
    place: usize,
    is_of_frame: bool,
    measured_s: f64,
    square_m2_s: f64,
    max_abs_x_m: f64,
    max_abs_x_minus_z_m: f64,
    max_abs_acceleration_m_per_s2: f64,
    max_abs_drift_m: f64,
}

impl PlaceMeter {
    /// Of a place; those of a frame have a drift.
    pub fn new(place: usize, is_of_frame: bool) -> Self {
        Self { place, is_of_frame, ..Self::default() }
    }

    /// Takes a piece of motion.
    pub fn piece(&mut self, piece: &Piece) {
        let (x, base) = (piece.place(self.place), piece.base());
        let take = |course: &Course, most: &mut f64| *most = course.largest_abs((0.0, piece.length_s), *most);
        self.measured_s += piece.length_s;
        self.square_m2_s += x.square_m2_s();
        take(&x, &mut self.max_abs_x_m);
        take(&x.minus(&base), &mut self.max_abs_x_minus_z_m);
        take(&x.acceleration(), &mut self.max_abs_acceleration_m_per_s2);
        if self.is_of_frame {
            let below = self.place.checked_sub(1).map_or(base, |below| piece.place(below));
            take(&x.minus(&below), &mut self.max_abs_drift_m);
        }
    }

    /// The result of the place of this name.
    pub fn result(&self, place: &str) -> PlaceResult {
        PlaceResult {
            place: place.to_string(),
            max_abs_x_m: self.max_abs_x_m,
            max_abs_x_minus_z_m: self.max_abs_x_minus_z_m,
            rms_x_m: root_mean(self.square_m2_s, self.measured_s),
            max_abs_acceleration_m_per_s2: self.max_abs_acceleration_m_per_s2,
            max_abs_drift_m: self.is_of_frame.then_some(self.max_abs_drift_m),
        }
    }
}

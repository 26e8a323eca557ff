//! What is measured at each place and of each impact damper.

use damprig_core::integrator::exact::response::{Response, Wanted};
use damprig_structures::Piece;
use serde::Serialize;

use super::piece::PieceAtPlace;
use super::{MultiDegree, Shown};
use crate::simulation::motion::Viewer;
use crate::table::Column;

/// What happened at each place and to each impact damper.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlacesResult {
    /// The places.
    pub places: Vec<PlaceResult>,
    /// The impact dampers.
    pub impact_dampers: Vec<DamperResult>,
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
pub(super) struct PlaceMeter {
    place: usize,
    is_of_frame: bool,
    response: Response,
    max_abs_acceleration_m_per_s2: f64,
    max_abs_drift_m: f64,
}

impl PlaceMeter {
    /// Of a place; those of a frame have a drift.
    pub fn new(place: usize, is_of_frame: bool) -> Self {
        let response = Response::new(Wanted { whole_run: true, ..Wanted::default() });
        Self { place, is_of_frame, response, max_abs_acceleration_m_per_s2: 0.0, max_abs_drift_m: 0.0 }
    }

    /// Takes a piece of motion.
    pub fn piece(&mut self, piece: &Piece) {
        let here = PieceAtPlace::new(piece, self.place, Shown::NOTHING);
        self.response.piece(&here);
        let whole = (0.0, piece.length_s);
        let most = &mut self.max_abs_acceleration_m_per_s2;
        *most = here.x().acceleration().largest_abs(whole, *most);
        if self.is_of_frame {
            let below = self.place.checked_sub(1).map_or_else(|| piece.base(), |below| piece.place(below));
            self.max_abs_drift_m = here.x().minus(&below).largest_abs(whole, self.max_abs_drift_m);
        }
    }

    /// The result of the place of this name.
    pub fn result(&self, place: &str) -> PlaceResult {
        PlaceResult {
            place: place.to_string(),
            max_abs_x_m: self.response.max_abs_x_m(),
            max_abs_x_minus_z_m: self.response.max_abs_x_minus_z_m(),
            rms_x_m: self.response.rms_x_m(),
            max_abs_acceleration_m_per_s2: self.max_abs_acceleration_m_per_s2,
            max_abs_drift_m: self.is_of_frame.then_some(self.max_abs_drift_m),
        }
    }
}

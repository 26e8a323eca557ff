//! Reads the start of a motion: displacement and velocity in the shape of a mode.

use damprig_core::integrator::exact::Excitation;
use damprig_motion::placed_motion::powers;
use damprig_structures::{Body, State, base_at_start};

use super::dampers::Dampers;
use crate::input::Section;
use crate::motion_record::Record;
use crate::simulation::keys::initial;

/// x and x′ at the observed place in the shape of a mode.
#[derive(Clone, Copy, Debug, Default)]
pub struct ShapeStart {
    /// x, m; `None`: where the base's motion puts it.
    pub x_m: Option<f64>,
    /// x′, m/s.
    pub v_m_per_s: f64,
    /// Number of the mode, from 0.
    pub mode: usize,
}

/// The base at the start.
#[derive(Clone, Copy, Debug)]
pub struct BaseStart {
    /// z, m, and z′, m/s.
    pub base: (f64, f64),
    /// Displacement of the places that have moved with it, m: a structure starts where its record does.
    moved_m: f64,
}

impl BaseStart {
    /// Of an excitation, or of a record.
    pub fn of(excitation: &Excitation, record: Option<&Record>) -> Self {
        match record {
            Some(record) => {
                let [start_m, rate_m_per_s, ..] = powers(&record.play().next_segment(), record.step_s);
                Self { base: (start_m, rate_m_per_s), moved_m: start_m }
            }
            None => Self { base: base_at_start(excitation), moved_m: 0.0 },
        }
    }
}

/// Reads `initial`; `None` after a problem has been reported.
pub fn read_initial(s: &Section) -> Option<ShapeStart> {
    for quantity in [&initial::Y, &initial::U] {
        if s.is_given(quantity) {
            let help = "give `start` or `start_m` of the particle";
            s.reject(quantity.name(), "is for a structure with one place", Some(help.into()));
        }
    }
    let x_m = if s.is_given(&initial::X) { Some(s.scalar(&initial::X)?) } else { None };
    let v_m_per_s = s.scalar(&initial::V);
    let mode = if s.is_given(&initial::MODE) { s.scalar(&initial::MODE) } else { Some(1.0) };
    s.finish();
    Some(ShapeStart { x_m, v_m_per_s: v_m_per_s?, mode: mode? as usize - 1 })
}

/// The state at the start, and the displacement and velocity of each place.
pub fn start(
    read: &Dampers,
    BaseStart { base, moved_m }: BaseStart,
    initial: ShapeStart,
    observed: usize,
    section: Option<&Section>,
) -> Option<(State, Vec<Body>)> {
    let set_up = &read.set_up;
    let mut state = set_up.at_rest((base.0 - moved_m, base.1));
    let modes = &set_up.structure.modes;
    let mut order: Vec<usize> = (0..modes.len()).collect();
    order.sort_by(|&a, &b| modes[a].angular_frequency_rad_per_s.total_cmp(&modes[b].angular_frequency_rad_per_s));
    let Some(&mode) = order.get(initial.mode) else {
        section?.reject(initial::MODE.name(), format!("must be at most {}, the number of modes", modes.len()), None);
        return None;
    };
    let moved_m = set_up.structure.influence[observed] * moved_m;
    let displaced_m = initial.x_m.unwrap_or(moved_m) - moved_m;
    if displaced_m != 0.0 || initial.v_m_per_s != 0.0 {
        let phi = modes[mode].shape[observed];
        if phi == 0.0 {
            section?.reject(initial::MODE.name(), "must be a mode that moves the observed place", None);
            return None;
        }
        state.modal[mode] += displaced_m / phi;
        state.modal_rate[mode] += initial.v_m_per_s / phi;
    }
    let places: Vec<Body> =
        (0..set_up.structure.influence.len()).map(|place| set_up.place(&state, place, base)).collect();
    let body = |place: usize, start_m: f64| Body { y_m: places[place].y_m + start_m, ..places[place] };
    state.particles =
        set_up.impact_dampers.iter().zip(&read.starts_m).map(|(of, start_m)| body(of.place, *start_m)).collect();
    state.tuned_masses = set_up.tuned_masses.iter().map(|of| body(of.place, 0.0)).collect();
    Some((state, places))
}

//! Reads the start of a motion: displacement and velocity in the shape of a mode.

use damprig_core::integrator::exact::Excitation;
use damprig_structures::{Body, State, base_at_start};

use super::dampers::Dampers;
use crate::input::Section;
use crate::simulation::keys::initial;

/// x and x′ at the observed place in the shape of a mode.
#[derive(Clone, Copy, Debug, Default)]
pub struct Start {
    /// x, m.
    pub x_m: f64,
    /// x′, m/s.
    pub v_m_per_s: f64,
    /// Number of the mode, from 0.
    pub mode: usize,
}

/// Reads `initial`; `None` after a problem has been reported.
pub fn read_initial(s: &Section) -> Option<Start> {
    for quantity in [&initial::Y, &initial::U] {
        if s.is_given(quantity) {
            let help = "give `start` or `start_m` of the particle";
            s.reject(quantity.name(), "is for a structure with one place", Some(help.into()));
        }
    }
    let x_m = if s.is_given(&initial::X) { s.scalar(&initial::X) } else { Some(0.0) };
    let v_m_per_s = s.scalar(&initial::V);
    let mode = if s.is_given(&initial::MODE) { s.scalar(&initial::MODE) } else { Some(1.0) };
    s.finish();
    Some(Start { x_m: x_m?, v_m_per_s: v_m_per_s?, mode: mode? as usize - 1 })
}

/// The state at the start, and the displacement and velocity of each place.
pub fn start(
    read: &Dampers,
    excitation: &Excitation,
    initial: Start,
    observed: usize,
    section: Option<&Section>,
) -> Option<(State, Vec<Body>)> {
    let set_up = &read.set_up;
    let mut state = set_up.at_rest(excitation);
    let modes = &set_up.structure.modes;
    let mut order: Vec<usize> = (0..modes.len()).collect();
    order.sort_by(|&a, &b| modes[a].angular_frequency_rad_per_s.total_cmp(&modes[b].angular_frequency_rad_per_s));
    let Some(&mode) = order.get(initial.mode) else {
        section?.reject(initial::MODE.name(), format!("must be at most {}, the number of modes", modes.len()), None);
        return None;
    };
    if initial.x_m != 0.0 || initial.v_m_per_s != 0.0 {
        let phi = modes[mode].shape[observed];
        if phi == 0.0 {
            section?.reject(initial::MODE.name(), "must be a mode that moves the observed place", None);
            return None;
        }
        state.modal[mode] += initial.x_m / phi;
        state.modal_rate[mode] += initial.v_m_per_s / phi;
    }
    let base = base_at_start(excitation);
    let places: Vec<Body> =
        (0..set_up.structure.influence.len()).map(|place| set_up.place(&state, place, base)).collect();
    let body = |place: usize, start_m: f64| Body { y_m: places[place].y_m + start_m, ..places[place] };
    state.particles =
        set_up.impact_dampers.iter().zip(&read.starts_m).map(|(of, start_m)| body(of.place, *start_m)).collect();
    state.tuned_masses = set_up.tuned_masses.iter().map(|of| body(of.place, 0.0)).collect();
    Some((state, places))
}

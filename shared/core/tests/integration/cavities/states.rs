//! A motion that is taken up from its state, also where the particle is beyond a soft wall.

use damprig_core::integrator::exact::{Arc, Exact, Observer};
use damprig_core::model::{Hertz, Initial, Wall};

use super::{particle, with};
use crate::draw::Draw;

/// The contact at the end of a motion.
#[derive(Default)]
struct LastContact {
    pressed_side: i8,
}

impl Observer for LastContact {
    fn arc(&mut self, arc: &Arc<'_>) {
        self.pressed_side = arc.pressed_side();
    }
}

#[test]
fn a_motion_goes_on_from_its_state_pressed_into_a_soft_wall_or_leaving_it() {
    let mut draw = Draw::new(77);
    let (mut pressed, mut leaving, mut pushed_again) = (0, 0, 0);
    for n in 0..16_000 {
        let set_up = draw.cavity();
        let (sine, initial) = (draw.sine(&set_up), draw.initial(&set_up));
        let mut motion = Exact::new(&set_up, &sine, &initial).expect("drawn within the ranges");
        let mut last = LastContact::default();
        motion.run(draw.between(0.3, 1.0), &mut last);
        let (from_s, state) = (motion.time_s(), *motion.state());
        let [low, high] = particle(&set_up).ends_m();
        let past_m = (low - state.offset_m).max(state.offset_m - high);
        if past_m < 1e-9 {
            continue;
        }
        let side = if state.offset_m > high { 1 } else { -1 };
        let (stiffness, damping) =
            particle(&set_up).walls()[usize::from(side > 0)].spring_and_dashpot().expect("a soft wall");
        let push_n = stiffness * past_m + damping * f64::from(side) * state.slide_m_per_s;
        match last.pressed_side {
            0 if push_n > 0.0 => {
                // The structure has caught up with a wall that counts as left until the particle is inside the cavity.
                pushed_again += 1;
                continue;
            }
            0 => leaving += 1,
            _ => pressed += 1,
        }
        let start =
            Initial { x_m: state.x_m, v_m_per_s: state.v_m_per_s, y_m: state.y_m(), u_m_per_s: state.u_m_per_s() };
        let mut again = Exact::new(&set_up, &sine, &start).expect("a state of a motion");
        again.reset(from_s, &start);
        let mut first = LastContact::default();
        again.run(from_s + 1e-6, &mut first);
        assert_eq!(first.pressed_side, last.pressed_side, "{n}: {set_up:?}");
        let until_s = from_s + draw.between(0.002, 0.05);
        again.run(until_s, &mut ());
        motion.run(until_s, &mut ());
        // The start is rounded once; some rad of a stiff wall and an impact or two magnify that.
        let (there, here) = (motion.state(), again.state());
        let reach_m = there.x_m.abs() + there.offset_m.abs() + high - low;
        let speed = there.v_m_per_s.abs() + there.slide_m_per_s.abs() + 0.1;
        let apart = [
            (there.x_m - here.x_m) / reach_m,
            (there.offset_m - here.offset_m) / reach_m,
            (there.v_m_per_s - here.v_m_per_s) / speed,
            (there.slide_m_per_s - here.slide_m_per_s) / speed,
        ];
        assert!(apart.iter().all(|a| a.abs() < 1e-11), "{n}: {apart:?} {set_up:?}");
    }
    assert!(pressed > 3_000 && leaving > 5 && pushed_again < pressed / 50, "{pressed} {leaving} {pushed_again}");
}

/// What a Hertz wall exerts depends on the speed at which the contact began, which a state does not tell.
#[test]
fn a_state_beyond_a_hertz_wall_is_refused_and_a_restart_there_is_at_the_wall() {
    let mut draw = Draw::new(78);
    let hertz = Hertz::elastic(1e6);
    let set_up = with(&draw.cavity(), |p| (p.wall, p.cavity.positive_wall) = (Wall::Hertz(hertz), None));
    let sine = draw.sine(&set_up);
    let [_, high] = particle(&set_up).ends_m();
    let beyond = Initial { y_m: high + 1e-4, ..Initial::default() };
    assert_eq!(Exact::new(&set_up, &sine, &beyond).expect_err("beyond").parameter, "initial.y_m");
    let mut motion = Exact::new(&set_up, &sine, &set_up.neutral()).expect("physical");
    motion.reset(0.0, &beyond);
    assert_eq!(motion.state().offset_m, high);
}

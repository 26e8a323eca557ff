//! Where contacts with piezoelectric walls begin, and what their charge does to the modes.

use std::f64::consts::TAU;

use damprig_core::integrator::exact::Excitation;
use damprig_core::model::Wall;
use damprig_structures::{
    Body, Harvest, Impact, Mode, Modes, Motion, Observer, Piece, PiezoelectricWall, SetUp, State,
};

use crate::piezoelectric::{SINE, STEPS, WALL, apart, excitation, motion, set_up, soft};
use crate::piezoelectric_second_method::{CHARGE, Point, Reference, Y};

/// Touches and impacts, and the state of the first piece.
#[derive(Default)]
struct Seen {
    impacts: Vec<Impact>,
    /// Whether the first and the last piece press.
    pressed: Vec<bool>,
    /// Start of the first piece that presses, and the force at the end of each.
    began_s: Option<f64>,
    forces: Vec<(f64, f64)>,
}

impl Observer for Seen {
    const PIECES: bool = true;

    fn piece(&mut self, piece: &Piece) {
        self.pressed.push(piece.pressed_side(0).is_some());
        if let Some(force) = piece.wall_force_n(0) {
            self.began_s = self.began_s.or(Some(piece.start_s));
            self.forces.push((piece.start_s + piece.length_s, force.at(piece.length_s).0));
        }
    }

    fn impact(&mut self, impact: &Impact) {
        self.impacts.push(*impact);
    }
}

/// A set-up whose structure stays at rest.
fn alone(wall: Wall, piezoelectric: [Option<PiezoelectricWall>; 2]) -> SetUp {
    let mut set_up = set_up(wall, piezoelectric);
    set_up.structure.modes.iter_mut().for_each(|mode| mode.shape = vec![0.0; 2]);
    set_up
}

fn seen(set_up: &SetUp, start: &State, duration_s: f64) -> Seen {
    let mut motion = Motion::new(set_up, &Excitation::Fixed, start).unwrap();
    let mut seen = Seen::default();
    motion.run(duration_s, &mut seen).unwrap();
    assert_eq!(motion.unresolved(), 0);
    seen
}

/// A start is no impact; a particle at rest at its wall does not press it until something moves.
#[test]
fn a_start_at_the_surface_presses_only_with_an_approach() {
    for side in [0, 1] {
        let sign = if side == 0 { -1.0 } else { 1.0 };
        let mut walls = [None; 2];
        walls[side] = Some(WALL);
        let set_up = alone(soft(1.0), walls);
        let mut start = set_up.at_rest((0.0, 0.0));
        start.particles[0] = Body { y_m: sign * 0.006, u_m_per_s: 0.0 };
        let rests = seen(&set_up, &start, 0.1);
        assert!(rests.impacts.is_empty() && !rests.pressed.is_empty() && !rests.pressed.contains(&true), "{side}");
        start.particles[0].u_m_per_s = -sign * 0.1;
        let leaves = seen(&set_up, &start, 0.01);
        assert!(leaves.impacts.is_empty() && !leaves.pressed.contains(&true), "{side}");
        start.particles[0].u_m_per_s = sign * 0.1;
        let approaches = seen(&set_up, &start, 0.01);
        assert!(approaches.impacts.is_empty() && approaches.began_s == Some(0.0), "{side}: {:?}", approaches.impacts);
        assert!(approaches.forces.iter().any(|(_, force_n)| *force_n > 1.0), "{side}");
    }
}

/// The surface of one wall stands inwards of where it rests, by a charge that stays. A particle meets it there, and the other wall, which has no charge,
/// where that rests.
#[test]
fn each_of_two_walls_is_met_where_it_stands_itself() {
    let wall = PiezoelectricWall { load_ohm: 1e9, ..WALL };
    let (k, c, theta) = (wall.stiffness_n_per_m, wall.capacitance_f, wall.coupling_n_per_v);
    let charge_c = -2e-5;
    let stands_m = theta * charge_c / (k * c + theta * theta);
    assert!(stands_m < -5e-4);
    let time_s = wall.load_ohm * (c + theta * theta / k);
    let speed = 0.2;
    for charged in [0, 1] {
        let mut walls = [None; 2];
        walls[charged] = Some(wall);
        for other in [soft(3_000.0), Wall::Restitution { coefficient: 0.5 }] {
            let set_up = alone(other, walls);
            for side in [0, 1] {
                let sign = if side == 0 { -1.0 } else { 1.0 };
                let mut start = set_up.at_rest((0.0, 0.0));
                start.charges_c[0] = charge_c;
                start.particles[0].u_m_per_s = sign * speed;
                // v t = d + s e^(−t/τ), where the surface has moved by 10⁻³ of s.
                let mut expected_s = 0.006 / speed;
                for _ in 0..20 {
                    let stands = if side == charged { stands_m * f64::exp(-expected_s / time_s) } else { 0.0 };
                    expected_s = (0.006 + stands) / speed;
                }
                // Up to before the particle is where the other of both is met.
                let seen = seen(&set_up, &start, 1.01 * expected_s);
                let [impact] = seen.impacts[..] else { panic!("{charged} {side}: {:?}", seen.impacts) };
                assert_eq!(usize::from(impact.side > 0), side);
                assert!((impact.time_s / expected_s - 1.0).abs() < 1e-12, "{charged} {side}: {impact:?} {expected_s}");
            }
        }
    }
}

/// At the place of the walls the second mode weighs 40 g, a quarter of the particle. Without the reaction of the charge it would move as at short circuit.
#[test]
fn the_charge_acts_on_a_light_mode() {
    let mode = |hz: f64, shape: f64, participation: f64| Mode {
        angular_frequency_rad_per_s: TAU * hz,
        damping_ratio: 0.02,
        shape: vec![shape, 0.0],
        participation,
    };
    let structure = Modes {
        modes: vec![mode(2.5, 0.8, 1.2), mode(14.0, 5.0, 0.1)],
        influence: vec![1.0; 2],
        coupling_per_s: Vec::new(),
    };
    let end = |coupling_n_per_v: f64| {
        let wall = PiezoelectricWall { coupling_n_per_v, ..WALL };
        let set_up = SetUp { structure: structure.clone(), ..set_up(soft(1.0), [Some(wall); 2]) };
        let mut motion = motion(&set_up, &excitation(SINE));
        let (start, mut harvest) = (motion.state(), Harvest::new(&motion));
        let body = start.particles[0];
        let begin = [&[0.0], &start.modal[..], &start.modal_rate, &[body.y_m, body.u_m_per_s], &[0.0; 4]].concat();
        let begin: Point = begin.try_into().unwrap();
        let until_s = 2.0 * TAU / SINE.turning;
        motion.run(until_s, &mut harvest).unwrap();
        let points = [2 * STEPS, STEPS].map(|steps| {
            let mut reference = Reference::new(&set_up, SINE, begin);
            reference.run(until_s, 2 * steps);
            assert!(reference.contacts >= 4, "{}", reference.contacts);
            reference.point
        });
        let [fine, coarse] = points.map(|of| State {
            modal: of[1..3].to_vec(),
            modal_rate: of[3..5].to_vec(),
            particles: vec![Body { y_m: of[Y], u_m_per_s: of[Y + 1] }],
            charges_c: of[CHARGE..CHARGE + 2].to_vec(),
            ..State::default()
        });
        let state = motion.state();
        // Order 4: the finer steps have a fifteenth of the difference.
        let (found, error) = (apart(&state, &fine), 0.1 * apart(&coarse, &fine) + 1e-12);
        assert!(found < error && error < 1e-7, "{coupling_n_per_v}: {found} {error}");
        for (own, [fine, coarse]) in
            state.charges_c.iter().zip([0, 1].map(|n| [fine.charges_c[n], coarse.charges_c[n]]))
        {
            assert!((own - fine).abs() < (coarse - fine).abs() + 1e-14, "{own} {fine}");
        }
        state
    };
    let (with, without) = (end(WALL.coupling_n_per_v), end(0.0));
    assert!((with.modal[1] - without.modal[1]).abs() > 1e-5, "the charge moves the light mode");
}

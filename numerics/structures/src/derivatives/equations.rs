//! The equations of one state of the contacts in first order, `w′ = A w`, with everything that events need as rows over w.
//!
//! w has the displacements and velocities of the bodies relative to the base, the excitation's sine and cosine, the base's cubic with its
//! derivatives, and a one: time is no part of it.

use damprig_core::integrator::modes::{Sign, signed};
use damprig_core::model::Release;
use nalgebra::{DMatrix, DVector};

use crate::bodies::Bodies;
use crate::contacts::{Contacts, Event, Slide, Touch};
use crate::mount::{Mount, WallLaw};

/// Places of what w has besides the bodies, counted from twice their number.
pub(super) const SINE: usize = 0;
pub(super) const COSINE: usize = 1;
pub(super) const BASE: usize = 2;
pub(super) const ONE: usize = 6;

/// How many they are.
pub(super) const MORE: usize = 7;

/// The equations of one state of the contacts.
#[derive(Clone, Debug)]
pub(super) struct Equations {
    /// A.
    pub a: DMatrix<f64>,
    /// What each guard is, and its row; a guard is positive until its event.
    pub events: Vec<Event>,
    pub guards: DMatrix<f64>,
    /// Rows of the absolute displacements of the places.
    pub places: DMatrix<f64>,
    /// Rows of the relative velocities of the joints.
    pub slips: DMatrix<f64>,
    /// Row of z′.
    pub base_rate: DVector<f64>,
    /// Inertia per mass of each body: its change of velocity per change of −z′.
    pub inertia: DVector<f64>,
}

/// An impact on a hard wall.
#[derive(Clone, Debug)]
pub(super) struct HardImpact {
    /// Row of the approach speed.
    pub approach: DVector<f64>,
    /// Change of w per change of the relative velocity away from the wall.
    pub push: DVector<f64>,
}

impl Equations {
    /// The equations under an excitation that turns by `turning` rad/s; `None` if the joints that stick depend on each other.
    pub fn new(mount: &Mount, contacts: &Contacts, turning: f64) -> Option<Self> {
        let count = mount.bodies.len();
        let (n, more) = (2 * count + MORE, 2 * count);
        let mut acceleration = forces(mount, contacts);
        for (mut row, mass) in acceleration.row_iter_mut().zip(&mount.bodies.mass) {
            row /= *mass;
        }
        // z″ and z′.
        let mut base_acceleration = DVector::zeros(n);
        base_acceleration[more + SINE] = -mount.share * turning * turning;
        base_acceleration[more + BASE + 2] = 1.0;
        let mut base_rate = DVector::zeros(n);
        base_rate[more + COSINE] = mount.share * turning;
        base_rate[more + BASE + 1] = 1.0;
        let stuck: Vec<usize> = (0..mount.joints.len()).filter(|&j| contacts.slides[j] == Slide::Stuck).collect();
        let rows = DMatrix::from_fn(stuck.len(), count, |k, i| mount.joints[stuck[k]].row[i]);
        let mut relative = &rows * &acceleration;
        for (mut row, joint) in relative.row_iter_mut().zip(&stuck) {
            row += mount.joints[*joint].influence * base_acceleration.transpose();
        }
        let compliance = DMatrix::from_fn(stuck.len(), stuck.len(), |k, l| mount.compliance[(stuck[k], stuck[l])]);
        let holding = if stuck.is_empty() { relative } else { -compliance.lu().solve(&relative)? };
        for (i, (mut row, mass)) in acceleration.row_iter_mut().zip(&mount.bodies.mass).enumerate() {
            row += rows.column(i).transpose() * &holding / *mass;
        }
        let mut a = DMatrix::zeros(n, n);
        a.view_mut((0, count), (count, count)).fill_with_identity();
        a.view_mut((count, 0), (count, n)).copy_from(&acceleration);
        a[(more + SINE, more + COSINE)] = turning;
        a[(more + COSINE, more + SINE)] = -turning;
        for order in 0..3 {
            a[(more + BASE + order, more + BASE + order + 1)] = 1.0;
        }
        let guards = guards(mount, contacts, (&stuck, &holding), &base_rate);
        let (events, rows): (Vec<Event>, Vec<DVector<f64>>) = guards.into_iter().unzip();
        let places = mount.places.iter().map(|place| {
            let mut row = DVector::zeros(n);
            row.rows_mut(0, place.shape.len()).copy_from_slice(&place.shape);
            row[more + SINE] = place.influence * mount.share;
            row[more + BASE] = place.influence;
            row
        });
        let slips = DMatrix::from_fn(mount.joints.len(), n, |k, i| {
            let joint = &mount.joints[k];
            let own = i.checked_sub(count).and_then(|body| joint.row.get(body)).copied().unwrap_or(0.0);
            own + joint.influence * base_rate[i]
        });
        let per_mass = mount.bodies.inertia.iter().zip(&mount.bodies.mass).map(|(inertia, mass)| inertia / mass);
        Some(Self {
            a,
            events,
            guards: stacked(rows, n),
            places: stacked(places.collect(), n),
            slips,
            base_rate,
            inertia: DVector::from_iterator(count, per_mass),
        })
    }

    /// The row of a guard.
    pub fn guard(&self, event: Event) -> Option<usize> {
        self.events.iter().position(|own| *own == event)
    }
}

impl HardImpact {
    /// Of the first of these particles at its wall, while the others, which rest at theirs, are pushed against them; `None` if they depend on each
    /// other.
    pub fn new(mount: &Mount, closed: &[(usize, Sign)]) -> Option<Self> {
        let impulses = impulses(mount, closed)?;
        let count = mount.bodies.len();
        let (mut approach, mut push) = (DVector::zeros(2 * count + MORE), DVector::zeros(2 * count + MORE));
        for (n, ((particle, side), impulse)) in closed.iter().zip(impulses.iter()).enumerate() {
            let along = f64::from(*side);
            for (i, (row, mass)) in mount.offset_row(*particle).iter().zip(&mount.bodies.mass).enumerate() {
                if n == 0 {
                    approach[count + i] = along * row;
                }
                push[count + i] -= along * row / mass * impulse;
            }
        }
        Some(Self { approach, push })
    }

    /// The particles that an impact acts on: those that rest at walls and are pushed against them, after the one that meets its own.
    pub fn closed(mount: &Mount, contacts: &Contacts, hit: (usize, Sign)) -> Option<Vec<(usize, Sign)>> {
        let rest = contacts.touches.iter().enumerate().filter_map(|(particle, touch)| match *touch {
            Touch::Wall(side) if particle != hit.0 => Some((particle, side)),
            _ => None,
        });
        let mut closed: Vec<(usize, Sign)> = std::iter::once(hit).chain(rest).collect();
        loop {
            let pushed = impulses(mount, &closed)?;
            let Some(pulled) = (1..closed.len()).find(|&k| pushed[k] <= 0.0) else { return Some(closed) };
            closed.remove(pulled);
        }
    }
}

/// Impulses of contacts for a unit change of the relative velocity of the first away from its wall, the others staying.
fn impulses(mount: &Mount, closed: &[(usize, Sign)]) -> Option<DVector<f64>> {
    let compliance = DMatrix::from_fn(closed.len(), closed.len(), |k, l| {
        let [own, other] = [closed[k], closed[l]];
        signed(own.1, signed(other.1, mount.compliance[(mount.joint_of(own.0), mount.joint_of(other.0))]))
    });
    let mut bounce = DVector::zeros(closed.len());
    bounce[0] = 1.0;
    compliance.lu().solve(&bounce)
}

/// Rows of n numbers as a matrix.
fn stacked(rows: Vec<DVector<f64>>, n: usize) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), n, |k, i| rows[k][i])
}

/// Rows of the forces on the bodies, but for those of joints that stick.
fn forces(mount: &Mount, contacts: &Contacts) -> DMatrix<f64> {
    let (constant, pressed) = contacts.loads(mount);
    let mut bodies = mount.bodies.clone();
    bodies.links.extend(pressed);
    let count = bodies.len();
    let more = 2 * count;
    let mut rows = DMatrix::zeros(count, more + MORE);
    rows.columns_mut(0, count).copy_from(&-bodies.matrix(Bodies::springs));
    rows.columns_mut(count, count).copy_from(&-bodies.matrix(Bodies::dashpots));
    for i in 0..count {
        // Re(F̂ (cosine + i sine)).
        rows[(i, more + COSINE)] = mount.force[i].re;
        rows[(i, more + SINE)] = -mount.force[i].im;
        rows[(i, more + BASE + 2)] = -bodies.inertia[i];
        rows[(i, more + ONE)] = constant[i];
    }
    rows
}

/// The guards with their rows; `holding`: rows of the forces of the joints that stick.
fn guards(
    mount: &Mount,
    contacts: &Contacts,
    (stuck, holding): (&[usize], &DMatrix<f64>),
    base_rate: &DVector<f64>,
) -> Vec<(Event, DVector<f64>)> {
    let count = mount.bodies.len();
    let (n, one) = (2 * count + MORE, 2 * count + ONE);
    let body_row = |row: &[f64], of: f64, of_rate: f64| {
        let mut all = DVector::zeros(n);
        for (i, row) in row.iter().enumerate() {
            all[i] = of * row;
            all[count + i] = of_rate * row;
        }
        all
    };
    let mut guards = Vec::new();
    for (number, joint) in mount.joints.iter().enumerate() {
        if let Slide::Free(direction) = contacts.slides[number]
            && direction != 0
        {
            let along = f64::from(direction);
            let row = body_row(&joint.row, 0.0, along) + along * joint.influence * base_rate;
            guards.push((Event::Stops(number), row));
        }
    }
    for (which, &joint) in stuck.iter().enumerate() {
        let limits = contacts.limits(mount, joint);
        for (limit, direction) in [(limits.low, 1_i8), (limits.high, -1)] {
            if limit.is_finite() {
                let mut row = f64::from(direction) * holding.row(which).transpose();
                row[one] -= f64::from(direction) * limit;
                guards.push((Event::Breaks(joint, direction), row));
            }
        }
    }
    for (particle, (cavity, touch)) in mount.cavities.iter().zip(&contacts.touches).enumerate() {
        if contacts.slides[mount.joint_of(particle)] == Slide::Stuck {
            continue;
        }
        let row = mount.offset_row(particle);
        if let Touch::Pressing(side) = *touch {
            if let WallLaw::Soft { stiffness, damping, release } = *cavity.wall(side) {
                // The penetration, or the force.
                let (of, of_rate) = match release {
                    Release::ZeroPenetration => (1.0, 0.0),
                    Release::ZeroForce => (stiffness, damping),
                };
                let mut guard = body_row(row, signed(side, of), signed(side, of_rate));
                guard[one] -= of * cavity.end(side);
                guards.push((Event::Releases(particle, side), guard));
            }
            continue;
        }
        for side in [-1_i8, 1] {
            let is_leaving = *touch == Touch::Leaving(side);
            let sign = if is_leaving { -1.0 } else { 1.0 };
            let mut guard = body_row(row, -sign * f64::from(side), 0.0);
            guard[one] += sign * cavity.end(side);
            let event = if is_leaving { Event::Inside(particle, side) } else { Event::Wall(particle, side) };
            guards.push((event, guard));
        }
    }
    guards
}

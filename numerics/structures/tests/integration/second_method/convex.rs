//! The convex problem of contact forces, solved by enumeration.

/// Where the force of a contact lies within its limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hold {
    /// Between them, without a relative acceleration.
    Inside,
    /// At the lower one, with a relative acceleration of 0 or greater.
    Lower,
    /// At the upper one, with a relative acceleration of 0 or less.
    Upper,
}

/// The force and the relative acceleration of a contact.
#[derive(Clone, Copy, Debug)]
pub struct Held {
    pub hold: Hold,
    pub force: f64,
    pub acceleration: f64,
}

/// Forces f within `limits` with accelerations b + W f, where the two fit together as [`Hold`] says. Of all assignments it takes
/// the one that violates its conditions least; `violation` is by how much, as an acceleration.
pub fn solve(w: &[Vec<f64>], b: &[f64], limits: &[[f64; 2]]) -> (Vec<Held>, f64) {
    let count = b.len();
    let mut best = (Vec::new(), f64::INFINITY);
    for number in 0..3_u32.pow(u32::try_from(count).expect("few contacts")) {
        let holds: Vec<Hold> = (0..count)
            .map(|i| match number / 3_u32.pow(u32::try_from(i).expect("few contacts")) % 3 {
                0 => Hold::Inside,
                1 => Hold::Lower,
                _ => Hold::Upper,
            })
            .collect();
        let Some(held) = assigned(w, b, limits, &holds) else { continue };
        let violation = held.iter().enumerate().fold(0.0_f64, |worst, (i, contact)| {
            worst.max(match contact.hold {
                Hold::Inside => w[i][i] * (limits[i][0] - contact.force).max(contact.force - limits[i][1]),
                Hold::Lower => -contact.acceleration,
                Hold::Upper => contact.acceleration,
            })
        });
        if violation < best.1 {
            best = (held, violation);
        }
    }
    best
}

/// Forces and accelerations of one assignment; `None` where a limit is infinite or the forces are not determined.
fn assigned(w: &[Vec<f64>], b: &[f64], limits: &[[f64; 2]], holds: &[Hold]) -> Option<Vec<Held>> {
    let count = b.len();
    let mut force = vec![0.0; count];
    for i in 0..count {
        match holds[i] {
            Hold::Inside => {}
            Hold::Lower => force[i] = limits[i][0],
            Hold::Upper => force[i] = limits[i][1],
        }
        if !force[i].is_finite() {
            return None;
        }
    }
    let with = |force: &[f64], i: usize| b[i] + (0..count).map(|j| w[i][j] * force[j]).sum::<f64>();
    let inside: Vec<usize> = (0..count).filter(|i| holds[*i] == Hold::Inside).collect();
    let inverse = inverse(&part(w, &inside))?;
    let wanted: Vec<f64> = inside.iter().map(|i| -with(&force, *i)).collect();
    for (row, i) in inside.iter().enumerate() {
        force[*i] = inverse[row].iter().zip(&wanted).map(|(a, b)| a * b).sum();
    }
    let held = |i: usize| Held { hold: holds[i], force: force[i], acceleration: with(&force, i) };
    Some((0..count).map(held).collect())
}

/// The rows and columns `of` a matrix.
pub fn part(w: &[Vec<f64>], of: &[usize]) -> Vec<Vec<f64>> {
    of.iter().map(|i| of.iter().map(|j| w[*i][*j]).collect()).collect()
}

/// The inverse of a symmetric positive definite matrix by Gauss and Jordan; `None` where it has none.
pub fn inverse(matrix: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
    let n = matrix.len();
    let mut left = matrix.to_vec();
    let mut right: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| f64::from(u8::from(i == j))).collect()).collect();
    for pivot in 0..n {
        let by = left[pivot][pivot];
        if by < 1e-11 * matrix[pivot][pivot] || by <= 0.0 {
            return None;
        }
        for column in 0..n {
            left[pivot][column] /= by;
            right[pivot][column] /= by;
        }
        for row in (0..n).filter(|row| *row != pivot) {
            let times = left[row][pivot];
            for column in 0..n {
                left[row][column] -= times * left[pivot][column];
                right[row][column] -= times * right[pivot][column];
            }
        }
    }
    Some(right)
}

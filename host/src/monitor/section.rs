//! Poincaré points: position and velocity of the structure once a cycle, at the rising zero of the drive.

/// Columns of the rows from which the points are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct SectionColumns {
    x: usize,
    drive: usize,
    frequency: Option<usize>,
}

/// A row as far as the points need it.
#[derive(Clone, Copy, Debug)]
struct SectionRow {
    t_s: f64,
    x_m: f32,
    drive_m: f32,
}

/// Finds the points, row by row.
#[derive(Clone, Debug, Default)]
pub struct PointFinder {
    columns: Option<SectionColumns>,
    last: Option<SectionRow>,
}

/// Fewest rows in a cycle from which a velocity is computed.
const MIN_ROWS: f64 = 20.0;

impl PointFinder {
    /// For rows with these columns; without x or the drive there are no points.
    #[must_use]
    pub fn new(names: &[String]) -> Self {
        let at = |name: &str| names.iter().position(|known| known == name);
        let columns =
            at("x").zip(at("drive")).map(|(x, drive)| SectionColumns { x, drive, frequency: at("frequency") });
        Self { columns, last: None }
    }

    /// Forgets the row before: the time axis has jumped.
    pub fn restart(&mut self) {
        self.last = None;
    }

    /// Adds a row; returns x (m), its velocity (m/s) and the drive frequency (Hz) if the drive rose through zero since the row
    /// before. Both are linear between rows, so the velocity is off by at most (Ωh)²/24 of its amplitude for rows h apart.
    pub fn push(&mut self, t_s: f64, row: &[f32]) -> Option<(f32, f32, f32)> {
        let columns = self.columns?;
        let now = SectionRow { t_s, x_m: *row.get(columns.x)?, drive_m: *row.get(columns.drive)? };
        let before = self.last.replace(now)?;
        let frequency_hz = columns.frequency.and_then(|at| row.get(at)).copied().unwrap_or(0.0);
        let step_s = now.t_s - before.t_s;
        let is_rising = before.drive_m < 0.0 && now.drive_m >= 0.0;
        if !is_rising || step_s <= 0.0 || f64::from(frequency_hz) * step_s * MIN_ROWS > 1.0 {
            return None;
        }
        let part = before.drive_m / (before.drive_m - now.drive_m);
        let x_m = before.x_m + part * (now.x_m - before.x_m);
        let velocity = (now.x_m - before.x_m) / step_s as f32;
        (x_m.is_finite() && velocity.is_finite()).then_some((x_m, velocity, frequency_hz))
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    #[test]
    fn a_sine_gives_one_point_a_cycle_at_its_phase() {
        let names: Vec<String> = ["x", "drive", "frequency"].map(String::from).into();
        let (mut section, omega, lag) = (PointFinder::new(&names), TAU * 2.5, 0.7);
        let mut points = Vec::new();
        for tick in 0..4000 {
            let t = f64::from(tick) * 1e-3;
            let row = [(0.01 * (omega * t - lag).sin()) as f32, (1e-3 * (omega * t).sin()) as f32, 2.5];
            points.extend(section.push(t, &row));
        }
        // The first rising zero lies before the first row.
        assert_eq!(points.len(), 9);
        for (x, v, f) in points {
            // Linear between rows 1 ms apart: (Ωh)²/8 of the amplitude, and the velocity's difference within half a step.
            assert!((f64::from(x) - 0.01 * (-lag).sin()).abs() < 0.01 * 4e-5, "{x}");
            assert!(
                (f64::from(v) / (0.01 * omega * lag.cos()) - 1.0).abs() < 0.5 * omega * 1e-3 * lag.tan() + 1e-4,
                "{v}"
            );
            assert_eq!(f, 2.5);
        }
    }

    #[test]
    fn rows_without_a_drive_give_no_points() {
        let mut section = PointFinder::new(&["x".to_string()]);
        assert!((0..100).all(|i| section.push(f64::from(i), &[1.0]).is_none()));
    }
}

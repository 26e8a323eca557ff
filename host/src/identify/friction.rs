//! Internal friction from incline tests, and the friction force of a spring from a table of deflections.
//!
//! On a slope θ a body slides with a = g·(sin θ − μ·cos θ), so μ = tan θ − a/(g·cos θ). At the angle at which it just slides
//! on, a = 0. From rest, a = 2s/t².

use super::Estimate;
use super::statistics::{Value, line};
use super::table::{METRES, NumberTable, SECONDS, TableQuantity};
use crate::failure::Failure;

const ANGLE: TableQuantity = TableQuantity {
    stem: "angle",
    units: &[("rad", 1.0), ("deg", std::f64::consts::PI / 180.0)],
    about: "slope of the incline",
    most: 1.57,
};
const DISTANCE: TableQuantity =
    TableQuantity { stem: "distance", units: METRES, about: "distance slid from rest", most: 20.0 };
const DURATION: TableQuantity =
    TableQuantity { stem: "duration", units: SECONDS, about: "time of the slide", most: 1e3 };
const DEFLECTION: TableQuantity =
    TableQuantity { stem: "deflection", units: METRES, about: "deflection of the spring", most: 0.5 };
const FORCE: TableQuantity = TableQuantity { stem: "force", units: &[("n", 1.0)], about: "friction force", most: 1e4 };

/// Identifies by the columns of the table: an incline test or a table of deflections.
///
/// # Errors
/// Other columns, too few rows, a body that does not slide.
pub fn identify(table: &NumberTable, gravity_m_per_s2: f64) -> Result<Vec<Estimate>, Failure> {
    if table.has(&ANGLE) {
        Ok(vec![of_incline(table, gravity_m_per_s2)?])
    } else if table.has(&DEFLECTION) {
        of_spring(table)
    } else {
        Err(table.refuse(
            "these are not the columns of a friction test\n  incline, angle of sliding: angle_deg; incline, slide from rest: \
             angle_deg,distance_m,duration_s; spring: deflection_m,force_n",
        ))
    }
}

fn of_incline(table: &NumberTable, gravity_m_per_s2: f64) -> Result<Estimate, Failure> {
    let angles = table.column(&ANGLE)?;
    let slides = table.has(&DISTANCE) || table.has(&DURATION);
    let (distances, durations) = if slides {
        (table.column(&DISTANCE)?, table.column(&DURATION)?)
    } else {
        (vec![0.0; angles.len()], vec![1.0; angles.len()])
    };
    let mut values = Vec::with_capacity(angles.len());
    for row in 0..angles.len() {
        if !(angles[row] > 0.0 && durations[row] > 0.0 && distances[row] >= 0.0) {
            let text = format!("line {}: angle, distance and duration must be greater than 0", table.line(row));
            return Err(table.refuse(text));
        }
        let acceleration = 2.0 * distances[row] / durations[row].powi(2);
        let friction = angles[row].tan() - acceleration / (gravity_m_per_s2 * angles[row].cos());
        if friction < 0.0 {
            return Err(table.refuse(format!(
                "line {}: it slid with {acceleration:.3} m/s², more than the slope gives without friction ({:.3} m/s²)\n  check \
                 the angle's unit, and that the slide began at rest",
                table.line(row),
                gravity_m_per_s2 * angles[row].sin()
            )));
        }
        values.push(friction);
    }
    let mean = Value::mean(&values)
        .ok_or_else(|| table.refuse("one slide has no uncertainty: repeat the test and give at least two rows"))?;
    let method = if slides { "incline: slides from rest" } else { "incline: angle of sliding" };
    Ok(Estimate::new("friction coefficient of the particle", "", method, &mean).of_key("particle.friction_coefficient"))
}

fn of_spring(table: &NumberTable) -> Result<Vec<Estimate>, Failure> {
    let (deflections, forces) = (table.column(&DEFLECTION)?, table.column(&FORCE)?);
    let line = line(&deflections, &forces, |_| 1.0)
        .ok_or_else(|| table.refuse("a line needs at least three rows with different deflections"))?;
    const METHOD: &str = "straight line through the table";
    Ok(vec![
        Estimate::new("friction force per deflection", "N/m", METHOD, &line.slope),
        Estimate::new("friction force at zero deflection", "N", METHOD, &line.intercept),
    ])
}

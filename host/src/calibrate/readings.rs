//! The points of a calibration: read from a CSV file, and kept in one while they are taken.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use damprig_core::settings::Settings;
use serde::Serialize;

use super::Channel;
use crate::failure::Failure;
use crate::identify::table::{NumberTable, TableQuantity};
use crate::storage::whole_file::replace;

/// A point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct CalibrationPoint {
    /// The reference, in the channel's SI unit.
    pub reference: f64,
    /// The reading under the settings in use, in the channel's SI unit.
    pub reading: f64,
    /// RMS scatter of the samples of the reading; 0 where it is not known.
    pub scatter: f64,
    /// Change of the reading over its measurement; 0 where it is not known.
    pub drift: f64,
    /// The wall that was hit: −1 or +1; 0 for other channels.
    pub side: i8,
    /// Frequency of a moving target, Hz; 0 for others.
    pub frequency_hz: f64,
    /// Phase by which z leads x on one target, rad.
    pub lead_rad: f64,
}

impl CalibrationPoint {
    /// A point of which nothing else is known.
    #[must_use]
    pub fn new(reference: f64, reading: f64) -> Self {
        Self { reference, reading, ..Self::default() }
    }
}

/// The wall of a blow.
const SIDE: TableQuantity =
    TableQuantity { stem: "side", units: &[("", 1.0)], about: "wall that was hit, −1 or 1", most: 1.0 };
/// Frequency of a moving target.
const FREQUENCY: TableQuantity =
    TableQuantity { stem: "frequency", units: &[("hz", 1.0)], about: "frequency of the target", most: 1e3 };
/// Lead of z.
const LEAD: TableQuantity = TableQuantity {
    stem: "lead",
    units: &[("rad", 1.0), ("deg", std::f64::consts::PI / 180.0)],
    about: "phase by which z leads x",
    most: 7.0,
};

/// Reads points from a CSV file with the columns `reference_…` and `reading_…`; `settings` make readings of counts.
///
/// # Errors
/// An unreadable file, missing columns, values that are no numbers or not probable in their unit: file, line and what to do.
pub fn read(path: &Path, channel: Channel, settings: &Settings) -> Result<Vec<CalibrationPoint>, Failure> {
    let table = NumberTable::read(path)?;
    let references = table.column(&channel.reference())?;
    let readings = match channel.counts().filter(|counts| table.has(counts)) {
        Some(counts) if !table.has(&channel.reading()) => {
            table.column(&counts)?.iter().map(|counts| of_counts(channel, *counts, settings)).collect()
        }
        _ => table.column(&channel.reading())?,
    };
    let optional =
        |quantity: &TableQuantity| if table.has(quantity) { table.column(quantity).map(Some) } else { Ok(None) };
    let (sides, frequencies, leads) = (optional(&SIDE)?, optional(&FREQUENCY)?, optional(&LEAD)?);
    let at = |column: &Option<Vec<f64>>, row: usize| column.as_ref().map_or(0.0, |values| values[row]);
    if let Some(row) = sides.iter().flatten().position(|side| side.abs() != 1.0) {
        let line = table.line(row);
        let text = format!("line {line}: side must be −1 (the wall at −d) or 1 (the wall at +d)");
        return Err(table.refuse(text));
    }
    let point = |(row, (reference, reading)): (usize, (&f64, &f64))| CalibrationPoint {
        side: at(&sides, row) as i8,
        frequency_hz: at(&frequencies, row),
        lead_rad: at(&leads, row),
        ..CalibrationPoint::new(*reference, *reading)
    };
    Ok(references.iter().zip(&readings).enumerate().map(point).collect())
}

/// The reading of a converter's counts, which may be a mean.
fn of_counts(channel: Channel, counts: f64, settings: &Settings) -> f64 {
    let calibration = &settings.calibration;
    let (zero, gain) = match channel {
        Channel::Z => (calibration.z.zero_counts, calibration.z.metres_per_count),
        Channel::Spring => (calibration.spring.zero_counts, calibration.spring.newtons_per_count),
        _ => (calibration.x.zero_counts, calibration.x.metres_per_count),
    };
    (counts - f64::from(zero)) * f64::from(gain)
}

/// A column of the kept file: its name and its value.
type KeptColumn = (String, fn(&CalibrationPoint) -> f64);

/// Points as CSV that [`read`] reads.
#[must_use]
pub fn to_csv(channel: Channel, points: &[CalibrationPoint]) -> String {
    let unit = |quantity: TableQuantity| quantity.units[0].0;
    let (reference, reading) = (unit(channel.reference()), unit(channel.reading()));
    let has = |of: &fn(&CalibrationPoint) -> f64| points.iter().any(|point| of(point) != 0.0);
    let mut columns: Vec<KeptColumn> =
        vec![(format!("reference_{reference}"), |p| p.reference), (format!("reading_{reading}"), |p| p.reading)];
    let optional: [KeptColumn; 5] = [
        (format!("scatter_{reading}"), |p| p.scatter),
        (format!("drift_{reading}"), |p| p.drift),
        ("side".into(), |p| f64::from(p.side)),
        ("frequency_hz".into(), |p| p.frequency_hz),
        ("lead_rad".into(), |p| p.lead_rad),
    ];
    columns.extend(optional.into_iter().filter(|(_, of)| has(of)));
    let mut text = columns.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(",") + "\n";
    for point in points {
        let row: Vec<String> = columns.iter().map(|(_, of)| format!("{}", of(point))).collect();
        let _ = writeln!(text, "{}", row.join(","));
    }
    text
}

/// The file in which points are kept while they are taken, so that none is lost.
#[derive(Clone, Debug)]
pub struct KeptFile {
    path: PathBuf,
    channel: Channel,
}

impl KeptFile {
    /// Makes the file, which must be new.
    ///
    /// # Errors
    /// It exists or cannot be written.
    pub fn create(path: PathBuf, channel: Channel) -> Result<Self, Failure> {
        if path.symlink_metadata().is_ok() {
            let text =
                format!("cannot keep the readings in {}: it exists; give another name with --keep", path.display());
            return Err(Failure::Input(text));
        }
        let kept = Self { path, channel };
        kept.write(&[])?;
        Ok(kept)
    }

    /// Makes the first file of `stem`.csv, `stem`-2.csv and so on that is new.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn create_new(stem: &str, channel: Channel) -> Result<Self, Failure> {
        let names = std::iter::once(format!("{stem}.csv")).chain((2..).map(|n| format!("{stem}-{n}.csv")));
        let path = names.map(PathBuf::from).find(|path| path.symlink_metadata().is_err());
        Self::create(path.unwrap_or_else(|| PathBuf::from(format!("{stem}.csv"))), channel)
    }

    /// Replaces its content by these points.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(&self, points: &[CalibrationPoint]) -> Result<(), Failure> {
        let failed = |e: &dyn std::fmt::Display| {
            Failure::Failed(format!("cannot keep the readings in {}: {e}", self.path.display()))
        };
        replace(&self.path, to_csv(self.channel, points).as_bytes()).map_err(|e| failed(&e))
    }

    /// Its path.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Removes a file without a point.
    pub fn remove(&self) {
        // It says nothing; whether it can be removed does not matter.
        let _ = std::fs::remove_file(&self.path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str, channel: Channel) -> Result<Vec<CalibrationPoint>, Failure> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("readings.csv");
        std::fs::write(&path, text).unwrap();
        read(&path, channel, &Settings::default())
    }

    #[test]
    fn kept_points_are_read_as_they_were_taken() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("kept.csv");
        let points = [
            CalibrationPoint { side: -1, scatter: 1e-3, ..CalibrationPoint::new(0.1 + 0.2, 0.25) },
            CalibrationPoint { side: 1, ..CalibrationPoint::new(1.0 / 3.0, 0.125) },
        ];
        let kept = KeptFile::create(path.clone(), Channel::Walls).unwrap();
        kept.write(&points).unwrap();
        let found = read(&path, Channel::Walls, &Settings::default()).unwrap();
        let without_scatter = points.map(|point| CalibrationPoint { scatter: 0.0, ..point });
        assert_eq!(found, without_scatter);
        assert!(KeptFile::create(path, Channel::Walls).is_err(), "it exists");
    }

    #[test]
    fn units_are_those_of_the_columns() {
        let found = read_text("reference_mm,reading_counts\n0,32760\n20,40950\n", Channel::X).unwrap();
        assert!((found[1].reference - 0.02).abs() < 1e-12 && found[0].reading == 0.0);
        assert!((found[1].reading - 0.02).abs() < 1e-8, "{found:?}");
    }

    #[test]
    fn a_reference_in_the_wrong_unit_and_a_missing_column_are_named() {
        let told = |text: &str, channel| read_text(text, channel).unwrap_err().to_string();
        let metres = told("reference_m,reading_m\n20,0.02\n", Channel::X);
        assert!(metres.contains("line 2: reference_m = 20") && metres.contains("reference_mm"), "{metres}");
        let missing = told("referance_mm,reading_m\n20,0.02\n", Channel::X);
        assert!(missing.contains("reference_m") && missing.contains("rename it"), "{missing}");
        let side = told("reference_n_s,reading_n_s,side\n0.1,0.1,0\n", Channel::Walls);
        assert!(side.contains("line 2") && side.contains("−1"), "{side}");
    }
}

//! Reads a tracked film: frame number or time, and the place of a ball in each frame.
//!
//! The columns are known by their names (`Frame`, `Slice`, `t_s`; `X1`, `y_px`, `POSITION_Y`); without names by their content. A track may
//! have columns of its own (X1, Y1, X2, Y2), or a number in a column (`particle`, `TRACK_ID`).

use std::path::Path;

use crate::failure::Failure;
use crate::input::regular;
use crate::signal_file::unit::{Unit, UnitKind};
use crate::signal_file::{Dialect, SAMPLE_BYTES, is_plain_table};

/// The places of a ball.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Track {
    /// Its number.
    pub(super) number: u32,
    /// Frame numbers, or times in seconds.
    pub(super) at: Vec<f64>,
    /// x and y at these, NaN where missing; empty where the file has no such column.
    pub(super) places: [Vec<f64>; 2],
}

/// A tracked film.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Film {
    pub(super) file: String,
    /// Whether the file has times, in seconds, in place of frame numbers.
    pub(super) has_times: bool,
    /// Metres per unit of the places, if the file states the unit.
    pub(super) metres: Option<f64>,
    /// Tracks with a place in at least one frame.
    pub(super) tracks: Vec<Track>,
}

/// Which columns hold what.
#[derive(Clone, Debug, PartialEq)]
struct FilmColumns {
    at: usize,
    /// Seconds per unit of a column of times; `None` for frame numbers.
    seconds: Option<f64>,
    /// Column of the track's number.
    track: Option<usize>,
    /// For each track its number and its columns of x and y.
    places: Vec<(u32, [Option<usize>; 2])>,
    metres: Option<f64>,
}

/// A column's name in small letters and digits, without the words that say nothing of its axis.
fn plain(name: &str) -> String {
    let name: String = name.to_lowercase().chars().filter(char::is_ascii_alphanumeric).collect();
    let words = ["position", "pos", "coordinate", "coord", "centroid", "center", "centre", "pixels", "pixel", "px"];
    words.iter().fold(name, |name, word| name.replace(word, ""))
}

/// The axis (0 for x) and the number of the track of a column of places.
fn place(name: &str) -> Option<(usize, u32)> {
    let name = plain(name);
    let (axis, number) = [(0, name.strip_prefix('x')), (1, name.strip_prefix('y'))]
        .into_iter()
        .find_map(|(axis, rest)| Some((axis, rest?.to_string())))?;
    if number.is_empty() { Some((axis, 1)) } else { Some((axis, number.parse().ok()?)) }
}

fn is_frame(name: &str) -> bool {
    let name = plain(name);
    ["frame", "slice", "image"].iter().any(|word| name.starts_with(word))
}

fn is_track(name: &str) -> bool {
    matches!(plain(name).as_str(), "track" | "trackid" | "trackn" | "trackno" | "tracknr" | "particle")
}

/// Whether a file is a tracked film: a text with places over frames or times.
pub(super) fn is_film(path: &Path) -> bool {
    let Ok(bytes) = regular::read_input(path) else { return false };
    if !is_plain_table(&bytes) {
        return false;
    }
    let text = String::from_utf8_lossy(&bytes);
    if is_headed(&text) {
        return true;
    }
    let Ok(dialect) = dialect(&text) else { return false };
    if !dialect.has_names() {
        return dialect.columns.len() >= 3;
    }
    let names: Vec<&str> = dialect.columns.iter().map(|column| column.name.as_str()).collect();
    let has_places = names.iter().any(|name| place(name).is_some());
    let has_frames = names.iter().any(|name| is_frame(name));
    has_frames || (has_places && (dialect.time.is_some() || names.iter().any(|name| is_time(name))))
}

/// Lines in which a header is looked for.
const HEAD: usize = 20;

/// Whether a line at the beginning names frames and places.
fn is_headed(text: &str) -> bool {
    text.lines().take(HEAD).any(|line| {
        let names: Vec<&str> = line.split([',', ';', '\t']).collect();
        names.iter().any(|name| is_frame(name)) && names.iter().any(|name| place(name).is_some())
    })
}

fn is_time(name: &str) -> bool {
    matches!(plain(name).as_str(), "t" | "time")
}

fn dialect(text: &str) -> Result<Dialect, String> {
    let end = text.char_indices().nth(SAMPLE_BYTES).map_or(text.len(), |(at, _)| at);
    let sample = if end < text.len() { &text[..text[..end].rfind('\n').unwrap_or(end)] } else { text };
    // A film may begin with minutes in which nothing is tracked, and flags may be signs: only rows with a place say what the columns are.
    Dialect::of(sample)
}

impl FilmColumns {
    fn of(dialect: &Dialect, rows: &[(usize, Vec<&str>)]) -> Result<Self, String> {
        let columns = &dialect.columns;
        let listed = || {
            let names: Vec<String> = columns.iter().map(|column| format!("{:?}", column.name)).collect();
            format!("the columns are {}", names.join(", "))
        };
        let find = |is: fn(&str) -> bool| (0..columns.len()).find(|n| is(&columns[*n].name));
        let (at, seconds) = match (dialect.time, find(is_frame)) {
            (Some((at, seconds)), _) => (at, Some(seconds)),
            (None, Some(at)) => (at, None),
            (None, None) => {
                if let Some(n) = find(is_time) {
                    return Err(format!(
                        "the unit of the times in {:?} is not known\n  name the column with its unit, for example t_s",
                        columns[n].name
                    ));
                }
                let whole = (0..columns.len()).find(|n| is_counted(dialect, rows, *n));
                let none =
                    || format!("there is no column of frame numbers or times; {}\n  name it frame or t_s", listed());
                (whole.ok_or_else(none)?, None)
            }
        };
        let track = find(is_track);
        let named: Vec<(usize, usize, u32)> = (0..columns.len())
            .filter(|n| *n != at && Some(*n) != track)
            .filter_map(|n| place(&columns[n].name).map(|(axis, number)| (n, axis, number)))
            .collect();
        let mut places: Vec<(u32, [Option<usize>; 2])> = Vec::new();
        for (n, axis, number) in &named {
            let known = places.iter().position(|(other, _)| other == number);
            let known = known.unwrap_or_else(|| {
                places.push((*number, [None; 2]));
                places.len() - 1
            });
            if let Some(first) = places[known].1[*axis].replace(*n) {
                let (first, second) = (&columns[first].name, &columns[*n].name);
                return Err(format!(
                    "{first:?} and {second:?} are the same axis of a track\n  keep one, or number the tracks: X1, X2"
                ));
            }
        }
        if places.is_empty() {
            let others: Vec<usize> =
                (0..columns.len()).filter(|n| *n != at && Some(*n) != track && varies(dialect, rows, *n)).collect();
            match others[..] {
                [only] => places.push((1, [None, Some(only)])),
                [first, second] => places.push((1, [Some(first), Some(second)])),
                _ => {
                    return Err(format!(
                        "there are {} columns that may be places; {}\n  name those of the ball x and y",
                        others.len(),
                        listed()
                    ));
                }
            }
        }
        let units: Vec<Option<f64>> = places
            .iter()
            .flat_map(|(_, axes)| axes.iter().flatten())
            .map(|n| {
                Unit::of(&columns[*n].unit_text).filter(|unit| unit.kind == UnitKind::Displacement).map(|unit| unit.si)
            })
            .collect();
        if units.iter().any(|unit| *unit != units[0]) {
            return Err(format!("the places have different units; {}\n  give x and y in the same unit", listed()));
        }
        Ok(Self { at, seconds, track, places, metres: units[0] })
    }
}

/// Whether a column has whole numbers that rise.
fn is_counted(dialect: &Dialect, rows: &[(usize, Vec<&str>)], n: usize) -> bool {
    let values: Vec<Option<f64>> =
        rows.iter().map(|(_, fields)| fields.get(n).and_then(|field| dialect.number(field))).collect();
    let is_whole = values.iter().all(|value| value.is_some_and(|value| value.fract() == 0.0));
    values.len() > 1 && is_whole && values.windows(2).all(|pair| pair[1] > pair[0])
}

/// Whether a column has numbers that are not all the same.
fn varies(dialect: &Dialect, rows: &[(usize, Vec<&str>)], n: usize) -> bool {
    let mut values = rows.iter().filter_map(|(_, fields)| fields.get(n).and_then(|field| dialect.number(field)));
    values.next().is_some_and(|first| values.any(|value| value != first))
}

/// Frame numbers above this are none.
const MAX_FRAMES: f64 = 1e9;

impl Film {
    /// Reads a film.
    ///
    /// # Errors
    /// Names the line of what is no number and of a frame that does not follow, and the columns where it is not known what they hold.
    pub(super) fn read(path: &Path) -> Result<Self, Failure> {
        let file = path.display().to_string();
        let bytes = regular::read_input(path).map_err(|e| Failure::Input(format!("cannot read {file}: {e}")))?;
        let text = String::from_utf8_lossy(&bytes);
        Self::parse(&file, &text).map_err(|why| Failure::Input(format!("{file}: {why}")))
    }

    fn parse(file: &str, text: &str) -> Result<Self, String> {
        let dialect = dialect(text)?;
        // Without a place in any row the columns are those of the frames alone.
        if is_headed(text) && !dialect.columns.iter().any(|column| place(&column.name).is_some()) {
            let is_row = |line: &&str| line.starts_with(|c: char| c.is_ascii_digit());
            let count = text.lines().filter(is_row).count();
            return Err(format!("nothing is tracked in its {count} frames: every place is empty"));
        }
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
        let rows: Vec<(usize, Vec<&str>)> =
            lines.map(|(n, line)| (n + 1, dialect.fields(line).collect::<Vec<_>>())).collect();
        let first = rows.iter().position(|(line, _)| *line > dialect.lines_before).unwrap_or(0);
        // Rows whose flags are signs stand above the first row of numbers too.
        let starts = |row: &(usize, Vec<&str>)| row.1.first().is_some_and(|field| dialect.number(field).is_some());
        let above = rows[..first].iter().rev().take_while(|row| starts(row)).count();
        let rows = &rows[first - above..];
        let columns = FilmColumns::of(&dialect, rows)?;
        let mut tracks: Vec<Track> = Vec::new();
        for (line, fields) in rows {
            let number = |n: usize| -> Result<f64, String> {
                let field = fields.get(n).copied().unwrap_or_default();
                let name = &dialect.columns[n].name;
                let none = || {
                    format!(
                        "line {line}: {name} = {field:?} is not a finite number\n  leave the field empty where nothing is tracked"
                    )
                };
                if field.is_empty() { Ok(f64::NAN) } else { dialect.number(field).ok_or_else(none) }
            };
            let at = number(columns.at)?;
            let what = if columns.seconds.is_some() { "time" } else { "frame" };
            if at.is_nan() {
                return Err(format!("line {line}: the {what} is missing"));
            }
            if columns.seconds.is_none() && (at.fract() != 0.0 || at.abs() > MAX_FRAMES) {
                return Err(format!(
                    "line {line}: the frame number {at} must be a whole number\n  name a column of times with its unit, for example t_s"
                ));
            }
            let at = at * columns.seconds.unwrap_or(1.0);
            let own = columns.track.map(&number).transpose()?;
            for (of_columns, axes) in &columns.places {
                let place = |axis: usize| axes[axis].map(&number).transpose();
                let places = [place(0)?, place(1)?];
                if places.iter().flatten().all(|value| value.is_nan()) {
                    continue;
                }
                let of_row = own.map_or(*of_columns, |own| own as u32);
                let known = tracks.iter().position(|track| track.number == of_row).unwrap_or_else(|| {
                    tracks.push(Track { number: of_row, ..Track::default() });
                    tracks.len() - 1
                });
                let track = &mut tracks[known];
                if let Some(last) = track.at.last().filter(|last| at <= **last) {
                    return Err(format!(
                        "line {line}: the {what} {at} is not later than the one before, {last}\n  sort the rows, and give each film a file of \
                         its own"
                    ));
                }
                track.at.push(at);
                for (values, place) in track.places.iter_mut().zip(places) {
                    values.extend(place);
                }
            }
        }
        if tracks.is_empty() {
            return Err(format!("nothing is tracked in its {} frames: every place is empty", rows.len()));
        }
        Ok(Self { file: file.into(), has_times: columns.seconds.is_some(), metres: columns.metres, tracks })
    }

    /// The only track, or those that are chosen, as one.
    ///
    /// # Errors
    /// Several tracks without a choice, a number that is none of theirs, tracks that overlap.
    pub(super) fn track(&self, chosen: &[u32]) -> Result<Track, Failure> {
        let refuse = |why: String| Failure::Input(format!("{}: {why}", self.file));
        let list = || -> String {
            let ends = |track: &Track| (track.at[0], track.at[track.at.len() - 1]);
            let line = |track: &Track| format!("\n  --track {}: {} to {}", track.number, ends(track).0, ends(track).1);
            self.tracks.iter().take(20).map(line).collect()
        };
        if chosen.is_empty() {
            let [only] = &self.tracks[..] else {
                return Err(refuse(format!(
                    "it has {} tracks: which is the ball? Parts of one ball are given together, as --track 1,2{}",
                    self.tracks.len(),
                    list()
                )));
            };
            return Ok(only.clone());
        }
        let mut parts = Vec::new();
        for number in chosen {
            let part = self.tracks.iter().find(|track| track.number == *number);
            parts.push(part.ok_or_else(|| refuse(format!("there is no track {number}{}", list())))?);
        }
        parts.sort_by(|a, b| a.at[0].total_cmp(&b.at[0]));
        let mut joined = Track { number: parts[0].number, ..Track::default() };
        for part in parts {
            if joined.at.last().is_some_and(|last| part.at[0] <= *last) {
                return Err(refuse(format!("the chosen tracks overlap: they are not parts of one ball{}", list())));
            }
            joined.at.extend(&part.at);
            for (all, own) in joined.places.iter_mut().zip(&part.places) {
                all.extend(own);
            }
        }
        if joined.places.iter().any(|values| !values.is_empty() && values.len() != joined.at.len()) {
            return Err(refuse("the chosen tracks do not have the same columns".into()));
        }
        Ok(joined)
    }
}

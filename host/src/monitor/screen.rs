//! The picture of the terminal view.

use std::collections::VecDeque;

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style, Stylize};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Axis, Block, Chart, Dataset, Gauge, GraphType, Paragraph, Sparkline, Wrap};

use super::message::{Activity, Level};
use super::numbers::Numbers;
use super::terminal::ViewPicture;
use crate::input::shown_in_line;
use crate::report::numbers::{duration, phase_in_degrees};

/// Columns and lines below which curves cannot be read and only text is shown.
const MIN_SIZE: (u16, u16) = (60, 21);

/// Draws the whole picture, or its text alone in a small terminal.
pub(super) fn draw(frame: &mut Frame, picture: &ViewPicture) {
    let area = frame.area();
    if area.width < MIN_SIZE.0 || area.height < MIN_SIZE.1 {
        return text_alone(frame, picture);
    }
    let has_trouble = trouble(picture).is_some();
    let [head, trouble_area, numbers, curves, progress, log, keys] = Layout::vertical([
        Constraint::Length(2),
        Constraint::Length(if has_trouble { 2 } else { 0 }),
        Constraint::Length(6),
        Constraint::Min(6),
        Constraint::Length(1),
        Constraint::Length(3),
        Constraint::Length(1),
    ])
    .areas(area);
    let headline = Line::from(shown_in_line(&picture.snapshot.state.headline).into_owned());
    frame.render_widget(Paragraph::new(vec![status(picture), headline]), head);
    if let Some(line) = trouble(picture) {
        frame.render_widget(Paragraph::new(line).wrap(Wrap { trim: true }), trouble_area);
    }
    values(frame, numbers, picture);
    let [left, right] = Layout::horizontal([Constraint::Fill(1), Constraint::Fill(1)]).areas(curves);
    histories(frame, left, picture);
    response(frame, right, picture);
    if let Some((ratio, label)) = share_done(picture) {
        frame.render_widget(Gauge::default().ratio(ratio).label(label).gauge_style(Color::Blue), progress);
    }
    lines(frame, log, picture);
    frame.render_widget(Paragraph::new(keys_text(picture)).reversed(), keys);
}

/// The state, the keys, what is wrong and the main numbers, in as many lines as there are.
fn text_alone(frame: &mut Frame, picture: &ViewPicture) {
    let state = &picture.snapshot.state;
    let numbers = &state.numbers;
    let mut status = status(picture);
    // Without board and rig.
    status.spans.truncate(3);
    let mut lines = vec![status, Line::from(keys_text(picture)).reversed()];
    lines.extend(trouble(picture));
    lines.push(Line::from(shown_in_line(&state.headline).into_owned()));
    lines.extend(age(picture).map(Line::from));
    lines.push(Line::from(format!("X/Z (lock-in) {}", decimals(numbers.get("x_over_z_lock_in"), 1.0, 2))));
    lines.push(Line::from(format!("f (Hz) {}", decimals(numbers.get("frequency_hz").filter(|hz| *hz > 0.0), 1.0, 3))));
    lines.extend(displacements(numbers).map(|(name, value)| Line::from(format!("{name} {value}"))));
    lines.extend(share_done(picture).map(|(_, label)| Line::from(label)));
    frame.render_widget(Paragraph::new(lines).wrap(Wrap { trim: true }), frame.area());
}

/// Share of the run or replay that is done, and the same in words.
fn share_done(picture: &ViewPicture) -> Option<(f64, String)> {
    let state = &picture.snapshot.state;
    if state.points_planned > 0 {
        let ratio = (state.points_taken as f64 / state.points_planned as f64).clamp(0.0, 1.0);
        let left = state.left.as_ref().map_or(String::new(), |left| format!(", {}", left.text));
        return Some((ratio, format!("{} of {} points{left}", state.points_taken, state.points_planned)));
    }
    let replay = state.replay?;
    let ratio = if replay.end_s > 0.0 { (replay.t_s / replay.end_s).clamp(0.0, 1.0) } else { 1.0 };
    Some((ratio, format!("{} of {}", duration(replay.t_s), duration(replay.end_s))))
}

fn keys_text(picture: &ViewPicture) -> &'static str {
    let state = &picture.snapshot.state;
    match (picture.owns_run, state.activity) {
        (false, _) if state.replay.is_some_and(|replay| replay.paused) => " p play   q end ",
        (false, _) if state.replay.is_some() => " p pause   q end ",
        (false, _) => " q end ",
        (true, Activity::Paused) => " s stop   p resume ",
        (true, Activity::Held) => " s stop   p pause   h release ",
        (true, _) => " s stop   p pause   h hold ",
    }
}

/// What the rig does, and whose rig it is.
fn status(picture: &ViewPicture) -> Line<'static> {
    let snapshot = &picture.snapshot;
    let (word, colour) = match snapshot.state.activity {
        Activity::Running => ("RUNNING", Color::Green),
        Activity::Held => ("HELD", Color::Yellow),
        Activity::Paused => ("PAUSED", Color::Yellow),
        Activity::Waiting => ("WAITING", Color::Yellow),
        Activity::Stopping => ("STOPPING", Color::Yellow),
        Activity::Idle if !snapshot.state.alarms.is_empty() => ("IDLE", Color::Yellow),
        Activity::Idle => ("IDLE", Color::Blue),
        Activity::Faulted => ("FAULT", Color::Red),
        Activity::Lost => ("LINK LOST", Color::Red),
        Activity::Over => ("OVER", Color::Blue),
        Activity::Replay => ("REPLAY", Color::Blue),
    };
    let name = shown_in_line(&snapshot.source.name).into_owned();
    let at = format!("  {} at {}", shown_in_line(&snapshot.source.board), shown_in_line(&snapshot.source.rig));
    Line::from(vec![
        Span::styled(format!(" {word} "), Style::new().bg(colour).fg(Color::Black).add_modifier(Modifier::BOLD)),
        Span::from(" "),
        Span::from(name).bold(),
        Span::from(at).dim(),
    ])
}

/// The question to the person, else the fault, else the alarms.
fn trouble(picture: &ViewPicture) -> Option<Line<'static>> {
    let state = &picture.snapshot.state;
    let fault = state.fault.as_ref().map(|fault| format!("{} {}", fault.what, fault.advice));
    let alarms = (!state.alarms.is_empty()).then(|| state.alarms.join(" "));
    let text = picture.question.clone().or(fault).or(alarms)?;
    let colour = if picture.question.is_some() { Color::Yellow } else { Color::Red };
    Some(Line::from(shown_in_line(&text).into_owned()).style(colour).bold())
}

/// How old the newest sample is, when it is old.
fn age(picture: &ViewPicture) -> Option<String> {
    picture.old_s().map(|age_s| format!("newest sample {} old", duration(age_s.floor())))
}

/// A number; grey when it is old.
fn number(text: String, is_old: bool) -> Span<'static> {
    if is_old { Span::from(text).fg(Color::DarkGray) } else { Span::from(text).bold() }
}

/// Amplitudes of x and z, or their means while nothing is driven.
fn displacements(numbers: &Numbers) -> [(&'static str, String); 2] {
    let one = |names: [&'static str; 2], amplitude: Option<f32>, mean: Option<f32>, digits| match mean {
        Some(_) => (names[1], decimals(mean, 1e3, 3)),
        None => (names[0], decimals(amplitude, 1e3, digits)),
    };
    [
        one(["X (mm)", "x mean (mm)"], numbers.get("x_amplitude_m"), numbers.get("x_mean_m"), 2),
        one(["Z (mm)", "z mean (mm)"], numbers.get("z_amplitude_m"), numbers.get("z_mean_m"), 3),
    ]
}

/// A number times `factor`; a dash without one.
fn decimals(value: Option<f32>, factor: f32, digits: usize) -> String {
    value.map_or_else(|| "–".to_string(), |value| format!("{:.digits$}", value * factor))
}

fn values(frame: &mut Frame, area: Rect, picture: &ViewPicture) {
    let numbers = &picture.snapshot.state.numbers;
    let link = &picture.snapshot.state.link;
    let limit_m = picture.snapshot.state.limits.x_m;
    let margin_m = limit_m.zip(numbers.get("max_abs_x_m")).map(|(limit_m, largest_m)| limit_m as f32 - largest_m);
    let [x, z] = displacements(numbers);
    let cells = [
        [
            ("f (Hz)", decimals(numbers.get("frequency_hz").filter(|hz| *hz > 0.0), 1.0, 3)),
            ("X/Z (lock-in)", decimals(numbers.get("x_over_z_lock_in"), 1.0, 2)),
            x,
            z,
        ],
        [
            ("phase (°)", decimals(numbers.get("x_phase_rad").map(phase_in_degrees), 1.0, 1)),
            ("impacts/cycle", decimals(numbers.get("impacts_in_cycle"), 1.0, 0)),
            ("wall −d (N)", decimals(numbers.get("wall_low_n"), 1.0, 0)),
            ("wall +d (N)", decimals(numbers.get("wall_high_n"), 1.0, 0)),
        ],
        [
            ("spring (N)", decimals(numbers.get("spring_force_n"), 1.0, 2)),
            ("target (N)", decimals(numbers.get("spring_target_n"), 1.0, 2)),
            ("twin (mm)", decimals(numbers.get("twin_residual_m"), 1e3, 3)),
            ("lost rows", link.lost_rows.to_string()),
        ],
        [
            ("left (s)", decimals(numbers.get("stage_left_s").filter(|left_s| *left_s > 0.0), 1.0, 1)),
            ("dwells", decimals(numbers.get("dwells"), 1.0, 0)),
            ("X/Z moves (%)", decimals(numbers.get("x_over_z_spread"), 100.0, 2)),
            ("x margin (mm)", decimals(margin_m, 1e3, 1)),
        ],
    ];
    let age = age(picture);
    let is_old = age.is_some();
    let block = Block::bordered().title(age.unwrap_or_default());
    let inner = block.inner(area);
    frame.render_widget(block.style(if is_old { Color::DarkGray } else { Color::Reset }), area);
    let rows = Layout::vertical([Constraint::Length(1); 4]).split(inner);
    for (row, cells) in rows.iter().zip(cells) {
        let columns = Layout::horizontal([Constraint::Fill(1); 4]).split(*row);
        for (column, (name, text)) in columns.iter().zip(cells) {
            let line = Line::from(vec![Span::from(format!("{name:>13} ")).dim(), number(text, is_old)]);
            frame.render_widget(line, *column);
        }
    }
}

fn histories(frame: &mut Frame, area: Rect, picture: &ViewPicture) {
    let numbers = &picture.snapshot.state.numbers;
    let has_spring =
        numbers.get("spring_target_n").is_some_and(|force| force > 0.0) || picture.spring_n.iter().any(|n| *n > 0.1);
    let second = if has_spring {
        ("spring force", &picture.spring_n, "N", 1.0)
    } else {
        ("twin residual", &picture.residual_m, "mm", 1e3)
    };
    let mut small = vec![("X/Z (lock-in)", &picture.x_over_z_lock_in, "", 1.0), second];
    small.retain(|(_, list, ..)| !list.is_empty());
    let heights = std::iter::once(Constraint::Fill(2)).chain(small.iter().map(|_| Constraint::Fill(1)));
    let rows = Layout::vertical(heights).split(area);
    displacement(frame, rows[0], picture);
    for (row, (name, list, unit, factor)) in rows[1..].iter().zip(small) {
        let most = list.iter().copied().fold(0.0f32, f32::max);
        let block = Block::bordered().title(format!("{name}, up to {:.3} {unit}", most * factor));
        let inner = block.inner(*row);
        frame.render_widget(block, *row);
        let data: Vec<u64> = newest(list, inner.width).map(|value| level(value, most)).collect();
        frame.render_widget(Sparkline::default().data(data).max(1000).style(Color::Green), inner);
    }
}

/// The newest x around zero, one value for each dot of the terminal.
fn displacement(frame: &mut Frame, area: Rect, picture: &ViewPicture) {
    let most_mm = picture.x_m.iter().fold(0.0f32, |most, x| most.max(x.abs())) * 1e3;
    let dots = 2 * area.width;
    let data: Vec<(f64, f64)> =
        newest(&picture.x_m, dots).enumerate().map(|(i, x_m)| (i as f64, f64::from(x_m) * 1e3)).collect();
    let reach = f64::from(most_mm).max(1e-3);
    let zero = [(0.0, 0.0), (f64::from(dots), 0.0)];
    let line =
        |data, colour| Dataset::default().data(data).marker(Marker::Braille).graph_type(GraphType::Line).style(colour);
    let labels = [-reach, 0.0, reach].map(|mm| if mm == 0.0 { "0".to_string() } else { format!("{mm:.2}") });
    let chart = Chart::new(vec![line(&zero, Color::DarkGray), line(&data, Color::Cyan)])
        .block(Block::bordered().title(format!("x, ±{most_mm:.2} mm")))
        .x_axis(Axis::default().bounds([0.0, f64::from(dots)]))
        .y_axis(Axis::default().bounds([-reach, reach]).labels(labels));
    frame.render_widget(chart, area);
}

/// The newest values that fit, one a column.
fn newest(list: &VecDeque<f32>, width: u16) -> impl Iterator<Item = f32> + '_ {
    list.iter().skip(list.len().saturating_sub(usize::from(width))).copied()
}

/// A value from 0 to `most` as one from 0 to 1000.
fn level(value: f32, most: f32) -> u64 {
    if most > 0.0 { (1000.0 * value / most).clamp(0.0, 1000.0) as u64 } else { 0 }
}

fn response(frame: &mut Frame, area: Rect, picture: &ViewPicture) {
    const COLOURS: [Color; 6] =
        [Color::White, Color::Yellow, Color::LightBlue, Color::Blue, Color::Magenta, Color::Red];
    let mut names: Vec<&str> = Vec::new();
    picture.points.iter().for_each(|(name, ..)| {
        if !names.contains(&name.as_str()) {
            names.push(name);
        }
    });
    let curves: Vec<Vec<(f64, f64)>> = names
        .iter()
        .map(|name| {
            let own = picture.points.iter().filter(|(other, ..)| other == name);
            // Logarithmic, as on the page.
            let mut curve: Vec<(f64, f64)> =
                own.map(|(_, frequency_hz, x_over_z)| (*frequency_hz, x_over_z.max(1e-3).log10())).collect();
            curve.sort_by(|a, b| a.0.total_cmp(&b.0));
            curve
        })
        .collect();
    let all = || curves.iter().flatten();
    let range = |values: &mut dyn Iterator<Item = f64>| {
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        if low < high {
            [low, high]
        } else if low.is_finite() {
            [low - 0.5, low + 0.5]
        } else {
            [0.0, 1.0]
        }
    };
    let x = range(&mut all().map(|p| p.0));
    let y = range(&mut all().map(|p| p.1));
    let shown: Vec<String> = names.iter().map(|name| shown_in_line(name).into_owned()).collect();
    let sets = curves.iter().zip(&shown).enumerate().map(|(i, (points, name))| {
        let colour = COLOURS[i % COLOURS.len()];
        Dataset::default()
            .name(name.as_str())
            .data(points)
            .marker(Marker::Braille)
            .graph_type(GraphType::Line)
            .style(colour)
    });
    let labels = |[low, high]: [f64; 2], text: fn(f64) -> String| vec![text(low), text(0.5 * (low + high)), text(high)];
    let chart = Chart::new(sets.collect())
        .block(Block::bordered().title("X/Z (cycle maxima) over frequency (Hz)"))
        .x_axis(Axis::default().bounds(x).labels(labels(x, |f| format!("{f:.2}"))))
        .y_axis(Axis::default().bounds(y).labels(labels(y, |log| format!("{:.1}", 10f64.powf(log)))));
    frame.render_widget(chart, area);
}

fn lines(frame: &mut Frame, area: Rect, picture: &ViewPicture) {
    let count = usize::from(area.height);
    let newest = picture.log.iter().skip(picture.log.len().saturating_sub(count));
    let lines: Vec<Line> = newest
        .map(|log| {
            let colour = match log.level {
                Level::Info => Color::Reset,
                Level::Warning => Color::Yellow,
                Level::Fault => Color::Red,
                Level::Action => Color::Cyan,
            };
            Line::from(vec![
                Span::from(format!("{} ", log.at)).dim(),
                Span::styled(shown_in_line(&log.text).into_owned(), colour),
            ])
        })
        .collect();
    frame.render_widget(Paragraph::new(lines), area);
}

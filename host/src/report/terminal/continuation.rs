//! The result of a continuation as text.

use super::table;
use crate::continuation::FoundBranches;
use crate::report::numbers::significant;

/// Tables of the branches and of their special points.
#[must_use]
pub fn text(found: &FoundBranches) -> String {
    let mut branches = table(&["Branch", "From", "To", "Periods", "Impacts", "Orbits", "Stable", "Ends"]);
    for branch in &found.branches {
        let (Some(first), Some([low, high])) = (branch.orbits.first(), branch.range()) else { continue };
        let stable = branch.orbits.iter().filter(|orbit| orbit.is_stable).count();
        branches.add_row([
            branch.number.to_string(),
            significant(low, 6),
            significant(high, 6),
            branch.periods.to_string(),
            first.impacts.to_string(),
            branch.orbits.len().to_string(),
            stable.to_string(),
            format!("{}, {}", branch.ends[0], branch.ends[1]),
        ]);
    }
    let mut specials = table(&["Branch", &found.parameter, "max |x| (mm)", "Special point", "Meaning"]);
    for column in [3, 4] {
        if let Some(column) = specials.column_mut(column) {
            column.set_cell_alignment(comfy_table::CellAlignment::Left);
        }
    }
    let mut count = 0;
    for branch in &found.branches {
        for special in &branch.special_points {
            count += 1;
            specials.add_row([
                branch.number.to_string(),
                significant(special.parameter, 9),
                significant(special.max_abs_x_m * 1e3, 5),
                special.kind.into(),
                special.meaning.clone(),
            ]);
        }
    }
    let walls = found.walls.as_ref().map_or(String::new(), |walls| format!("; {walls}"));
    let mut text = format!("Periodic orbits of {} over {}{walls}\n{branches}\n", found.case, found.parameter);
    if count == 0 {
        text.push_str("No special points in this range.");
    } else {
        text.push_str(&format!("{specials}"));
    }
    if let Some(second) = &found.second_parameter {
        text.push_str(&format!("\n\nCurves in {} and {second}\n", found.parameter));
        text.push_str(&curves(found).to_string());
    }
    for [from, to] in &found.not_covered {
        let [from, to] = [from, to].map(|end| significant(*end, 6));
        text.push_str(&format!("\nNo orbit was found from {} = {from} to {to}", found.parameter));
    }
    for gap in &found.gaps {
        text.push_str(&format!("\nNo orbit from {} = {}: {}", found.parameter, significant(gap.parameter, 6), gap.why));
    }
    for at in &found.not_started {
        text.push_str(&format!(
            "\nNot looked for orbits from {} = {} on: all `restarts` are used up; a larger number goes on there",
            found.parameter,
            significant(*at, 6)
        ));
    }
    if found.is_cut_short {
        text.push_str("\nNot all branches that leave others are followed: there are many.");
    }
    text
}

fn curves(found: &FoundBranches) -> comfy_table::Table {
    let mut curves = table(&["Branch", "Kind", "Points", "From", "To", "Ends"]);
    for curve in &found.curves {
        let at = |point: Option<&[f64; 3]>| {
            point.map_or_else(String::new, |p| format!("({}, {})", significant(p[0], 6), significant(p[1], 6)))
        };
        curves.add_row([
            curve.branch.to_string(),
            curve.kind.into(),
            curve.points.len().to_string(),
            at(curve.points.first()),
            at(curve.points.last()),
            curve.ends.join(", "),
        ]);
    }
    curves
}

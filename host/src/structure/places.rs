//! The places of a structure: named ones, or positions on a beam.

use damprig_structures::Support;

use super::OnBeam;
use crate::input::Section;
use crate::input::key::KeyedQuantity;
use crate::input::section::Given;
use crate::input::suggest;

/// The places of a structure.
#[derive(Debug)]
pub enum Places {
    /// Names that the file gives, or that floors have.
    Named(Vec<String>),
    /// Positions on a beam, collected as they are named.
    OnBeam(OnBeam),
}

impl Places {
    /// The place that a section names by one of the keys of `quantity`: its name, or its position on a beam. `None` without one, or
    /// after a problem has been reported.
    pub fn named(&mut self, s: &Section, quantity: &KeyedQuantity) -> Option<usize> {
        let (at, given) = s.given(quantity)?;
        let key = quantity.keys[at].name;
        match (self, given) {
            (Self::Named(names), Given::Text(name)) => {
                let place = names.iter().position(|other| *other == name.value);
                if place.is_none() {
                    let near = suggest::near(&name.value, names.iter().map(String::as_str));
                    let help = near.first().map(|near| format!("did you mean {near:?}?"));
                    s.refuse(key, &name.span, format!("the places are {}", quoted(names)), help);
                }
                place
            }
            (Self::OnBeam(OnBeam { length_m, positions_m, .. }), Given::Number(position_m)) => {
                if position_m > *length_m {
                    s.reject(key, format!("must be at most {length_m} m, the length of the beam"), None);
                    return None;
                }
                Some(index_of(positions_m, position_m))
            }
            (Self::OnBeam(_), _) => {
                let name = quantity.keys[1].name;
                s.reject(key, "a beam has positions", Some(format!("write `{name} = …`, from its first support")));
                None
            }
            (Self::Named(names), _) => {
                let name = quantity.keys[0].name;
                let help = format!("write `{name} = …`, one of {}", quoted(names));
                s.reject(key, "is for a beam", Some(help));
                None
            }
        }
    }

    /// The place whose displacement is x unless another is named: the last one, the free end or the middle of a beam.
    pub fn usual(&mut self) -> usize {
        match self {
            Self::Named(names) => names.len().saturating_sub(1),
            Self::OnBeam(OnBeam { support, length_m, positions_m }) => match support {
                Support::Cantilever => index_of(positions_m, *length_m),
                Support::SimplySupported => index_of(positions_m, 0.5 * *length_m),
            },
        }
    }

    /// Where they are on a beam.
    pub fn on_beam(&self) -> Option<OnBeam> {
        if let Self::OnBeam(beam) = self { Some(beam.clone()) } else { None }
    }

    /// Their names.
    pub fn names(&self) -> Vec<String> {
        match self {
            Self::Named(names) => names.clone(),
            Self::OnBeam(beam) => beam.positions_m.iter().map(|position_m| format!("{position_m} m")).collect(),
        }
    }
}

/// The number of a position, which is added if it is a new one.
fn index_of(positions_m: &mut Vec<f64>, position_m: f64) -> usize {
    positions_m.iter().position(|other| *other == position_m).unwrap_or_else(|| {
        positions_m.push(position_m);
        positions_m.len() - 1
    })
}

fn quoted(names: &[String]) -> String {
    names.iter().map(|name| format!("{name:?}")).collect::<Vec<_>>().join(", ")
}

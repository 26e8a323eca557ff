//! What a case cannot have together, and what commands cannot do with a case.

use super::Case;
use super::keys::{case, initial};
use super::read_case::toml_of;
use super::set_values::SetValues;
use crate::failure::Failure;
use crate::input::locate::PathStep::Key;
use crate::input::locate::locate_in;
use crate::input::{Problem, Section, Source};
use crate::motion_record::Record;
use crate::setup::SetUpSpec;

impl Case {
    /// Refuses a case with a many-particle damper, and unless `several_places` one with a structure of several degrees of freedom, for what needs the
    /// equations of one degree of freedom. `name` and `text` are those of its file, `values` what was set from outside.
    ///
    /// # Errors
    /// Says that `what` is not available, where the spheres or the structure are written, and what to do.
    pub fn refuse_other_engines(
        &self,
        (name, text): (&str, &str),
        values: &SetValues,
        what: &str,
        several_places: bool,
    ) -> Result<(), Failure> {
        let spheres = self.many_particles.as_ref().map(|_| case::MANY_PARTICLES.name());
        let (key, allowed, help) = match (spheres, &self.multi_degree) {
            (Some(key), _) => (
                key,
                "spheres have no motion whose every event is found exactly, which it needs",
                "`damprig simulate` and `damprig study` follow spheres; or take a `particle`",
            ),
            (None, Some(several)) if !several_places && several.set_up.force_beside_base.is_some() => {
                (case::FORCE.name(), "it follows a moving base or a force, not both", "leave out one of them")
            }
            (None, Some(several)) if !several_places && self.harvests() => (
                several.key,
                "it does not follow the charge of a piezoelectric wall",
                "`damprig simulate`, `study` (with `bifurcation`) and `optimise` follow it",
            ),
            (None, Some(several)) if !several_places => (
                several.key,
                "it follows a structure of one degree of freedom",
                "`damprig simulate`, `study` (with `bifurcation`) and `optimise` follow a structure with several places; or take a `structure`",
            ),
            _ => return Ok(()),
        };
        let source = Source::new(name, text);
        let set = source.attach(&values.origin, &values.lines);
        let own = toml_of(&source).and_then(|(toml, _)| locate_in(&toml, &[Key(key)]));
        source.report(Problem {
            title: format!("{what} is not available for `{key}`"),
            span: own.or_else(|| locate_in(&set, &[Key(key)])).unwrap_or_default(),
            allowed: allowed.into(),
            help: Some(help.into()),
        });
        source.verdict()
    }
}

/// Refuses what does not go with spheres in a box.
pub(super) fn refuse_beside_spheres(
    spheres: &Section,
    spec: &SetUpSpec,
    record: Option<&Record>,
    initial_section: Option<&Section>,
) {
    let refuse = |title: String, allowed: &str, help: &str| {
        spheres.source().report(Problem {
            title,
            span: spheres.span(),
            allowed: allowed.into(),
            help: Some(help.into()),
        });
    };
    let name = case::MANY_PARTICLES.name();
    if let Some(damper) = spec.damper() {
        let allowed = match damper {
            "friction_damper" => "their motion beside a friction damper has no equations yet",
            _ => "the spheres are the damper",
        };
        refuse(format!("`{name}` and `{damper}` are both given"), allowed, "leave out one of them");
    }
    if record.is_some() {
        let allowed = "spheres in a box need a base or a force in closed form";
        refuse(
            format!("`{name}` and a recorded base motion or noise are both given"),
            allowed,
            "take a sine or a pulse",
        );
    }
    for quantity in [&initial::Y, &initial::U] {
        if let Some(section) = initial_section.filter(|section| section.is_given(quantity)) {
            let help = "leave it out: `seed` places the spheres, at rest in the box";
            section.reject(
                quantity.name(),
                format!("is for a particle or a tuned mass, not for `{name}`"),
                Some(help.into()),
            );
        }
    }
}

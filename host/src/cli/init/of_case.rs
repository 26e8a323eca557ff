//! Studies and optimisations of a case.

use std::path::{Path, PathBuf};

use super::{InitArgs, beside_or_whole, name_of, write};
use crate::failure::{Failure, Outcome};
use crate::file_keys::new_study;
use crate::input::Source;
use crate::optimise::Optimisation;
use crate::simulation::Case;
use crate::study::Study;
use crate::study::bifurcation::SweepAxis;

/// A file to write: its option and usual name, and the command that takes it.
struct New<'a> {
    option: &'static str,
    case: &'a Path,
    file: PathBuf,
    command: &'static str,
}

/// Writes a study of a case.
pub(super) fn study(case: &Path, args: &InitArgs) -> Outcome {
    let file = args.file.clone().unwrap_or_else(|| "study.toml".into());
    let new = New { option: "--study", case, file, command: "damprig study run" };
    new.write(args, |name, named, case| {
        let axes = if args.axis.is_empty() { new_study::usual_axes(case) } else { args.axis.clone() };
        Ok((new_study::study(name, named, case, &axes), |source, path| Study::parse(source, path, None).map(drop)))
    })
}

/// Writes an optimisation of a case.
pub(super) fn optimisation(case: &Path, args: &InitArgs) -> Outcome {
    let file = args.file.clone().unwrap_or_else(|| "optimisation.toml".into());
    let new = New { option: "--optimise", case, file, command: "damprig optimise" };
    new.write(args, |name, named, case| {
        let has_usual = case.set_up.particle.is_some() || case.set_up.friction_damper.is_some();
        if args.variable.is_empty() && !has_usual {
            return Err(Failure::Input(format!(
                "--optimise {}: the case has no particle and no friction damper, whose clearance, restitution and force are usual \
                 variables\n  name what may change: --variable KEY=FROM:TO, for example --variable tmd.frequency_ratio=0.8:1.1",
                new.case.display()
            )));
        }
        let variables = if args.variable.is_empty() { new_study::usual_axes(case) } else { args.variable.clone() };
        let text = new_study::optimisation(name, named, case, &variables);
        Ok((text, |source, path| Optimisation::parse(source, path, None).map(drop)))
    })
}

/// The text of a file, and its parser.
type ReadText = (String, fn(&Source, &Path) -> Result<(), Failure>);

impl New<'_> {
    /// Writes the text that is made from the file's name, the case as the file names it, and the case; a text that is not accepted is not
    /// written.
    fn write(&self, args: &InitArgs, text: impl FnOnce(&str, &str, &Case) -> Result<ReadText, Failure>) -> Outcome {
        args.force.check(&self.file)?;
        let case = Case::read(self.case)?;
        let named = beside_or_whole(self.option, self.case, &self.file)?;
        let (text, parse) = text(&name_of(&self.file), &named, &case)?;
        let source = Source::new(self.file.with_file_name("new file").display().to_string(), text.as_str());
        parse(&source, &self.file).map_err(|refusal| Failure::Input(format!("{refusal}\n  nothing was written")))?;
        write(&self.file, &text, args.force)?;
        let shown = self.file.display();
        say!("Written to {shown}. Next: {} {shown} --dry-run", self.command);
        Ok(())
    }
}

/// A variable and its range, as an axis from end to end.
pub(super) fn variable(text: &str) -> Result<SweepAxis, String> {
    let is_range = text.split_once('=').is_some_and(|(_, range)| range.split(':').count() == 2);
    if !is_range {
        return Err("write KEY=FROM:TO, for example particle.clearance_ratio=4:24".into());
    }
    format!("{text}:2").parse()
}

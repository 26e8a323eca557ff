//! `damprig simulate`: a case, from the file to the figures.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::Args as ClapArgs;

use super::{Failure, Outcome};
use crate::simulation::{Case, simulate};

/// Simulates a case exactly: every impact, stick and slip at its instant.
#[derive(Debug, ClapArgs)]
pub struct Args {
    /// Case file (TOML or JSON)
    #[arg(value_name = "CASE")]
    case: PathBuf,

    /// Print the whole answer as one JSON object
    #[arg(long)]
    json: bool,
}

/// Runs the subcommand.
///
/// # Errors
/// Bad input, an unwritable file or an interrupted run.
pub fn run(args: &Args) -> Outcome {
    let case = Case::read(&args.case).map_err(|e| Failure::Input(e.to_string()))?;
    let stop = AtomicBool::new(false);
    let answer = simulate(&case, &mut (), &stop).map_err(|e| Failure::Input(e.to_string()))?;
    if args.json {
        println!("{}", serde_json::to_string(&answer).map_err(|e| Failure::Failed(e.to_string()))?);
        return Ok(());
    }
    let summary = &answer.summary;
    println!("{}: {} s simulated", case.name, summary.simulated_s);
    println!("  largest |x|      {:.6} mm", summary.max_abs_x_m * 1e3);
    println!("  largest |x − z|  {:.6} mm", summary.max_abs_x_minus_z_m * 1e3);
    println!("  RMS of x         {:.6} mm", summary.rms_x_m * 1e3);
    println!("  impacts          {}", summary.impact_count);
    if let Some(mean) = summary.steady_mean_cycle_max_abs_x_m {
        println!("  steady mean of the cycles' largest |x|  {:.6} mm", mean * 1e3);
    }
    if let Some(force) = summary.peak_contact_force_n {
        println!("  largest contact force  {force:.4} N");
    }
    Ok(())
}

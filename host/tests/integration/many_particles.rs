//! Spheres in a box as the damper of a case: results, studies, refusals.

use crate::common::{damprig, folder, read_parquet, refused, simulated as answer};
use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;

const STRUCTURE: &str = "structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }\n";
const SINE: &str = "base = { kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.5 }\n";
const RUN: &str = "run = { duration_s = 4, cycle_s = 0.4, steady_from_cycle = 5 }\n";
const SPHERES: &str = "\
[many_particles]
count = 12
diameter_m = 0.01
mass_ratio = 0.1
restitution = 0.5
friction_coefficient = 0.2
contact_time_s = 0.002
clearance_m = 0.02
width_m = 0.02
height_m = 0.02
";

fn case(spheres: &str) -> String {
    format!("{STRUCTURE}{SINE}{RUN}{spheres}")
}

#[test]
fn spheres_lose_energy_whose_book_closes_and_a_run_repeats_to_the_bit() {
    let first = answer(&case(SPHERES), &[]);
    let number = |place: &str| first["many_particles"][place].as_f64().unwrap_or_else(|| panic!("{place}"));
    let lost_j = number("lost_in_impacts_j") + number("lost_in_friction_j");
    assert!(number("lost_in_impacts_j") > 0.0 && number("lost_in_friction_j") > 0.0);
    assert!(number("energy_error_j").abs() < 0.02 * lost_j, "{}", first["many_particles"]);
    let cycles = first["many_particles"]["cycles"].as_array().unwrap();
    assert_eq!(cycles.len(), 10);
    let sum_j: f64 = cycles.iter().map(|cycle| cycle["lost_in_contacts_j"].as_f64().unwrap()).sum();
    assert!((sum_j / lost_j - 1.0).abs() < 1e-3, "{sum_j} of {lost_j}");
    for cycle in cycles {
        let share = cycle["collective_motion"].as_f64().unwrap();
        assert!((0.0..=1.0).contains(&share), "{cycle}");
    }
    assert!(first["summary"]["impact_count"].as_u64().unwrap() > 20);
    assert_eq!(first, answer(&case(SPHERES), &[]), "two runs differ");
    assert_ne!(first["summary"], answer(&case(SPHERES), &["--set", "many_particles.seed=2"])["summary"]);
}

#[test]
fn the_clearance_is_half_the_free_travel_of_the_packed_spheres() {
    let stated = answer(&case(SPHERES), &[]);
    // 12 spheres in layers of 2 × 2 take three diameters.
    let length_m = stated["case"]["many_particles"]["length_m"].as_f64().unwrap();
    assert!((length_m - 0.07).abs() < 1e-12, "{length_m}");
    let by_length = answer(&case(SPHERES), &["--set", &format!("many_particles.length_m={length_m:?}")]);
    assert_eq!(stated["summary"], by_length["summary"]);
}

#[test]
fn a_study_has_the_numbers_of_single_simulations() {
    let study = "case = \"case.toml\"\n\
                 metrics = [\"mean_cycle_max_m\", \"impacts_per_cycle\", \"loss_factor\", \"collective_motion\"]\n\
                 [[axis]]\nkey = \"many_particles.restitution\"\nvalues = [0.2, 0.8]\n";
    let folder = folder(&[("case.toml", &case(SPHERES)), ("study.toml", study)]);
    let output = damprig(&folder).args(["study", "run", "study.toml", "--out", "made"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let table = read_parquet(folder.path().join("made/table.parquet"));
    let column = |name: &str, row: usize| {
        let batch = &table[0];
        batch.column_by_name(name).unwrap().as_primitive::<Float64Type>().value(row)
    };
    for (row, restitution) in ["0.2", "0.8"].into_iter().enumerate() {
        let single = answer(&case(SPHERES), &["--set", &format!("many_particles.restitution={restitution}")]);
        let mean_m = single["summary"]["steady_mean_cycle_max_abs_x_m"].as_f64().unwrap();
        assert!((column("mean_cycle_max_m", row) / mean_m - 1.0).abs() < 1e-9);
        let steady = &single["many_particles"]["cycles"].as_array().unwrap()[5..];
        let factors: Vec<f64> = steady.iter().map(|cycle| cycle["loss_factor"].as_f64().unwrap()).collect();
        let (low, high) =
            (factors.iter().copied().fold(f64::MAX, f64::min), factors.iter().copied().fold(0.0, f64::max));
        let found = column("loss_factor", row);
        assert!((low..=high).contains(&found), "{found} of {factors:?}");
        assert!((0.0..=1.0).contains(&column("collective_motion", row)));
        assert!(column("impacts_per_cycle", row) > 1.0);
    }
}

#[test]
fn what_spheres_do_not_go_with_is_refused_with_a_reason() {
    let simulate = ["simulate", "case.toml"];
    let beside = |more: &str, words: &[&str]| {
        refused(&[("case.toml", &format!("{STRUCTURE}{SINE}{RUN}{more}{SPHERES}"))], &simulate, words);
    };
    let particle =
        "particle = { mass_ratio = 0.1, clearance_m = 0.01, wall = { kind = \"restitution\", coefficient = 0.5 } }\n";
    beside(particle, &["`many_particles` and `particle` are both given", "leave out one"]);
    beside("friction_damper = { force_n = 1 }\n", &["`friction_damper`", "no equations"]);
    beside("tmd = { mass_ratio = 0.1, tuning = \"den_hartog\" }\n", &["`tmd`"]);
    beside("initial = { y_m = 0.01 }\n", &["initial.y_m", "`seed` places the spheres"]);
    let crowded =
        case(&SPHERES.replace("count = 12", "count = 12000").replace("clearance_m = 0.02", "length_m = 0.05"));
    refused(&[("case.toml", &crowded)], &simulate, &["many_particles.count", "at most 20", "12000"]);
    let narrow = case(&SPHERES.replace("width_m = 0.02", "width_m = 0.009"));
    refused(&[("case.toml", &narrow)], &simulate, &["many_particles.width_m", "diameter"]);
    let e = case(&SPHERES.replace("restitution = 0.5", "restitution = 0"));
    refused(&[("case.toml", &e)], &simulate, &["many_particles.restitution", "0.01"]);
    let hertz = |modulus: &str| SPHERES.replace("contact_time_s = 0.002", &format!("youngs_modulus_pa = {modulus}"));
    let soft = case(&hertz("1e4"));
    refused(&[("case.toml", &soft)], &simulate, &["many_particles.youngs_modulus_pa", "must be at least", "Pa"]);
    let of_a_spring = case(&format!("{SPHERES}poisson_ratio = 0.3\n"));
    refused(&[("case.toml", &of_a_spring)], &simulate, &["poisson_ratio", "youngs_modulus_pa"]);
    let noise =
        "base = { kind = \"record\", target_peak_m = 0.003, noise = { from_hz = 1, to_hz = 4, duration_s = 8 } }\n";
    let on_noise = format!("{STRUCTURE}{noise}{RUN}{SPHERES}");
    refused(&[("case.toml", &on_noise)], &simulate, &["recorded base motion or noise", "a sine or a pulse"]);
}

#[test]
fn spheres_of_a_material_have_hertz_contacts() {
    let spheres = SPHERES.replace("contact_time_s = 0.002", "youngs_modulus_pa = 1e7\npoisson_ratio = 0.4");
    let found = answer(&case(&spheres), &[]);
    let stated = &found["case"]["many_particles"];
    assert_eq!((stated["youngs_modulus_pa"].as_f64(), stated["poisson_ratio"].as_f64()), (Some(1e7), Some(0.4)));
    let number = |place: &str| found["many_particles"][place].as_f64().unwrap_or_else(|| panic!("{place}"));
    let lost_j = number("lost_in_impacts_j") + number("lost_in_friction_j");
    assert!(number("lost_in_impacts_j") > 0.0 && number("lost_in_friction_j") > 0.0);
    assert!(number("energy_error_j").abs() < 0.02 * lost_j, "{}", found["many_particles"]);
}

#[test]
fn commands_that_need_exact_events_refuse_spheres() {
    let spheres = case(SPHERES);
    let spheres = ("case.toml", spheres.as_str());
    // The table is in line 4 of the case.
    let at = ["case.toml:4", "[many_particles]", "not available for `many_particles`", "damprig study"];
    let needs_events = |files: &[(&str, &str)], arguments: &[&str], what: &str| {
        refused(files, arguments, &[&at[..], &[what]].concat());
    };
    needs_events(&[spheres], &["simulate", "case.toml", "--analyse"], "--analyse");
    let bifurcation = ["study", "bifurcation", "case.toml", "--axis", "many_particles.restitution=0.2:0.8:5"];
    needs_events(&[spheres], &bifurcation, "a bifurcation diagram");
    let continuation = "case = \"case.toml\"\nparameter = \"base.frequency_hz\"\nfrom = 2\nto = 3\n";
    needs_events(&[spheres, ("c.toml", continuation)], &["continue", "c.toml"], "a continuation");
    let optimisation = "case = \"case.toml\"\nobjective = \"x_over_z\"\nevaluations = 100\n\
                        [[variable]]\nkey = \"many_particles.restitution\"\nfrom = 0.2\nto = 0.8\n";
    needs_events(&[spheres, ("o.toml", optimisation)], &["optimise", "o.toml"], "an optimisation");
    let table = SPHERES.trim_start_matches("[many_particles]\n").trim().replace('\n', ", ");
    let set = format!("many_particles={{ {table} }}");
    let bare = format!("{STRUCTURE}{SINE}{RUN}");
    let analyse = ["simulate", "case.toml", "--analyse", "--set", &set];
    refused(&[("case.toml", &bare)], &analyse, &["--set:1", "not available for `many_particles`"]);
    let metric = |name: &str| {
        format!("case = \"case.toml\"\nmetrics = [{name:?}]\n[[axis]]\nkey = \"base.frequency_hz\"\nvalues = [2, 3]\n")
    };
    let study = ["study", "run", "study.toml"];
    refused(&[spheres, ("study.toml", &metric("period_cycles"))], &study, &["period_cycles", "spheres"]);
    refused(
        &[("case.toml", &bare), ("study.toml", &metric("loss_factor"))],
        &study,
        &["loss_factor", "many_particles"],
    );
}

#[test]
fn a_campaign_refuses_spheres_and_names_what_to_write() {
    let campaign = format!(
        "{STRUCTURE}[[set_up]]\nname = \"spheres\"\nbase_amplitude_m = 0.003\nmany_particles = {{ count = 12 }}\n\
         [[stepped_sine]]\nset_ups = [\"spheres\"]\nfrequencies_hz = [2.5]\n"
    );
    let words = ["many_particles", "damper = \"unmodelled\""];
    refused(&[("campaign.toml", &campaign)], &["run", "campaign.toml", "--dry-run"], &words);
}

#[test]
fn values_that_make_no_sense_are_refused_with_what_is_allowed() {
    let simulate = |old: &str, new: &str, words: &[&str]| {
        let changed = case(&SPHERES.replace(old, new));
        assert_ne!(changed, case(SPHERES));
        refused(&[("case.toml", &changed)], &["simulate", "case.toml"], &[&["case.toml:", new], words].concat());
    };
    simulate("diameter_m = 0.01", "diameter_m = 1e-9", &["many_particles.diameter_m", "from 0.00001 to 1 m", "stick"]);
    simulate(
        "count = 12",
        "count = 1000000",
        &["many_particles.count", "from 1 to 100000", "fewer and larger spheres"],
    );
    simulate("width_m = 0.02", "width_m = 1e5", &["many_particles.width_m", "at most 100 m"]);
    simulate("clearance_m = 0.02", "clearance_m = 1e5", &["many_particles.clearance_m", "at most 100 m"]);
    // A tenth of 0.4 s; 0.5·m·(π/0.04 s)² with spheres of 0.16 kg/12.
    let soft = ["a tenth of the period of structure or drive"];
    simulate("contact_time_s = 0.002", "contact_time_s = 10", &["at most 0.04 s", soft[0], "make it shorter"]);
    let stiffness = ["at least 41.2 N/m", soft[0], "make it larger"];
    simulate("contact_time_s = 0.002", "stiffness_n_per_m = 1", &stiffness);
    let fast = case(SPHERES).replace("frequency_hz = 2.5 }\nrun", "frequency_hz = 100 }\nrun");
    refused(&[("case.toml", &fast)], &["simulate", "case.toml"], &["contact_time_s", "at most 0.001 s"]);
}

#[test]
fn the_softest_contacts_that_are_allowed_have_an_energy_book_that_closes() {
    let book = |contact: &str| {
        let run = answer(&case(SPHERES), &["--set", contact]);
        let number = |place: &str| run["many_particles"][place].as_f64().unwrap_or_else(|| panic!("{place}"));
        let lost_j = number("lost_in_impacts_j") + number("lost_in_friction_j");
        (number("energy_error_j") / lost_j, number("step_s"))
    };
    let (error, step_s) = book("many_particles.contact_time_s=0.04");
    assert!(step_s < 0.4 / 249.0, "{step_s}");
    // The scheme is of second order: (π/25)² with 25 steps per contact.
    assert!(error.abs() < 0.016, "{error}");
}

#[test]
fn small_spheres_in_a_large_box_start_at_once() {
    let wide = SPHERES
        .replace("count = 12", "count = 2000")
        .replace("diameter_m = 0.01", "diameter_m = 1e-5")
        .replace("clearance_m = 0.02", "length_m = 100")
        .replace("_m = 0.02", "_m = 100");
    let run = answer(&format!("{STRUCTURE}{SINE}run = {{ duration_s = 0.001 }}\n{wide}"), &[]);
    assert_eq!(run["summary"]["simulated_s"], 0.001);
}

//! Checks the flash and RAM use of the images against `firmware/budgets.toml`.

use damprig_tests::support::emulator::run_counting;
use damprig_tests::support::images::{find, project, size};

fn budget(image: &str, what: &str) -> u64 {
    let path = project().join("firmware/budgets.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let budgets: toml::Table = text.parse().unwrap();
    let value = budgets[image][what].as_integer().unwrap_or_else(|| panic!("[{image}] {what} is not a whole number"));
    u64::try_from(value).unwrap()
}

fn check(image: &str, what: &str, measured: u64) {
    let most = budget(image, what);
    println!("{image}: {what} {measured} of {most}");
    assert!(measured > 0, "{image}: {what} was not measured");
    assert!(measured <= most, "{image}: {what} is {measured}, the budget is {most} (firmware/budgets.toml)");
}

fn printed_number(printed: &str, name: &str) -> u64 {
    let line = printed.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(" = "));
    line.unwrap_or_else(|| panic!("the image printed no {name}")).trim().parse().unwrap()
}

#[test]
fn the_controller_image_keeps_its_flash_budget() {
    let Some(image) = find("nucleo-g474re") else { return };
    check("nucleo-g474re", "flash_bytes", size(&image).flash_bytes);
}

#[test]
fn a_control_tick_and_the_memory_keep_their_budgets() {
    let Some(image) = find("mps2-an386-count") else { return };
    let printed = run_counting("mps2-an386", &image);
    let count = |name| printed_number(&printed, name);
    for what in ["instructions_per_tick_worst", "instructions_per_idle_request_worst"] {
        check("mps2-an386", what, count(what));
    }
    let others = [
        "instructions_per_tick_mean",
        "instructions_per_simulated_tick_mean",
        "stack_of_a_tick",
        "stack_of_receiving",
        "stack_of_sending",
    ];
    others.iter().for_each(|name| println!("mps2-an386: {name} {}", count(name)));
    let Some(image) = find("nucleo-g474re") else { return };
    let (still, deep) = (size(&image).static_ram_bytes, count("stack_bytes_worst"));
    let interrupts = budget("nucleo-g474re", "interrupts_bytes");
    println!("nucleo-g474re: static RAM {still}, stack {deep}, interrupts {interrupts}");
    check("nucleo-g474re", "ram_bytes", still + deep + interrupts);
}

#[test]
fn a_step_in_fixed_point_keeps_its_budgets_without_floating_point() {
    let Some(image) = find("mps2-an385") else { return };
    check("mps2-an385", "flash_bytes", size(&image).flash_bytes);
    let printed = run_counting("mps2-an385", &image);
    for what in ["instructions_per_step_mean", "instructions_per_step_worst"] {
        check("mps2-an385", what, printed_number(&printed, what));
    }
}

//! Runs the fixed-point sampled integrator on a controller without floating point. Prints the bits of every state of
//! the core's reference runs and the cost of the steps, and exits.
//!
//! The host executes the same runs with the same function and compares the bits (`tests/fixed_point.rs`).

use cortex_m_semihosting::hio::{self, HostStream};
use cortex_m_semihosting::hprintln;
use damprig_core::fixed_point::Fixed;
use damprig_core::fixed_point::reference::{CASES, ReferenceMotion, STEPS};

use crate::boards::instructions::InstructionCounter;
use crate::boards::mps2_an385::exit;

/// Length of the line of a state, bytes: four numbers of 16 hexadecimal digits, each followed by a space or the end
/// of the line.
const LINE: usize = 4 * 17;

/// Executes the runs. Prints `case NAME` before the states of each run and, at the end, `name = number` lines with
/// the names of `budgets.toml`. Ends the emulator.
pub fn run(counter: &InstructionCounter) -> ! {
    counter.check();
    let (mut sum, mut worst) = (0, 0);
    let mut output = hio::hstdout().expect("the emulator runs with semihosting");
    for case in &CASES {
        hprintln!("case {}", case.name);
        let mut motion = ReferenceMotion::<Fixed>::new(case).expect("the case is physical");
        for step in 0..STEPS {
            let base_counts = case.base_counts(step);
            let ((), instructions) = counter.count(|| motion.step(base_counts, &mut ()));
            sum += u64::from(instructions);
            worst = worst.max(instructions);
            print(&motion, &mut output);
        }
    }
    hprintln!("instructions_per_step_mean = {}", sum / (u64::from(STEPS) * CASES.len() as u64));
    hprintln!("instructions_per_step_worst = {}", worst);
    exit(true)
}

/// Prints the bits of a state as one line. One semihosting call per number would take longer than the runs.
fn print(motion: &ReferenceMotion<Fixed>, output: &mut HostStream) {
    let state = motion.state();
    let mut line = [b' '; LINE];
    let numbers = [state.x, state.v, state.offset, state.slide];
    for (place, number) in line.chunks_exact_mut(17).zip(numbers) {
        for (digit, byte) in place.iter_mut().take(16).zip((0..16).rev()) {
            *digit = b"0123456789abcdef"[(number.to_bits() >> (4 * byte)) as usize & 15];
        }
    }
    line[LINE - 1] = b'\n';
    output.write_all(&line).expect("the emulator takes the line");
}

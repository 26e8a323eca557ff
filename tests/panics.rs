//! Lists the panics that remain in the controller image, each with the reason why no input reaches it.
//!
//! A panic on the board is recorded and ends in a reset: relay open, motor off. It must not be reachable from bytes on
//! the line or from sensor values; `fuzz/` and the tests of damaged frames search for such inputs on the host, with the
//! same code.

use damprig_tests::support::images::find;
use object::{Object, ObjectSymbol, SymbolKind};

/// Part of the symbol's name, and why it may remain. Functions with equal bodies are merged under the name of either.
const JUSTIFIED: [(&[&str], &str); 8] = [
    (&["rust_begin_unwind"], "the handler itself: records the place and resets"),
    (&["panic_fmt"], "what the others call"),
    (&["panicking5panic"], "what the others call"),
    (&["panic_bounds_check"], "indices are counted within their arrays; positions of rings and lists are taken modulo"),
    (&["slice_index_fail"], "lengths are cut to the slice first: blocks, frames, rings"),
    (
        &["unwrap_failed"],
        "taking the peripherals and spawning the tasks, once, at the start; the flash driver's words, cut to their size",
    ),
    (&["panic_already_borrowed"], "embassy's queues: borrowed within a critical section only"),
    (&["__defmt_default_panic"], "what the logger calls when it is entered twice, which its lock prevents"),
];

fn may_end_it(name: &str) -> bool {
    ["panic", "unwrap_failed", "expect_failed", "_fail", "rust_begin_unwind"].iter().any(|part| name.contains(part))
}

#[test]
fn every_panic_left_in_the_controller_image_is_known() {
    let Some(image) = find("nucleo-g474re") else { return };
    let bytes = std::fs::read(image).unwrap();
    let file = object::File::parse(&*bytes).unwrap();
    let code = file.symbols().filter(|symbol| symbol.kind() == SymbolKind::Text);
    let left: Vec<_> = code.filter_map(|symbol| symbol.name().ok()).filter(|name| may_end_it(name)).collect();
    assert!(left.len() > 3, "too few symbols to be an image's: {left:?}");
    for name in &left {
        let known = JUSTIFIED.iter().find(|(parts, _)| parts.iter().any(|part| name.contains(part)));
        let (_, why) = known.unwrap_or_else(|| panic!("{name} is new in the image: can any input lead to it?"));
        println!("{name}: {why}");
    }
    for (parts, _) in JUSTIFIED {
        let is_left = parts.iter().any(|part| left.iter().any(|name| name.contains(part)));
        assert!(is_left, "{parts:?} is no longer in the image: remove it from the list");
    }
}

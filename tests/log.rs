//! Contents of the images' log lines that can be checked without a probe: the board's time, and the texts that
//! `damprig log` finds in the image.

use damprig_tests::support::images::find;
use object::{Object, ObjectSymbol};

/// The defmt format strings of an image, stored as JSON symbol names.
fn formats(image: &str) -> Option<Vec<String>> {
    let bytes = std::fs::read(find(image)?).unwrap();
    let file = object::File::parse(&*bytes).unwrap();
    let names = file.symbols().filter_map(|symbol| symbol.name().ok().map(String::from));
    Some(names.filter(|name| name.contains("\"tag\":\"defmt_")).collect())
}

#[test]
fn every_log_line_carries_the_boards_time_in_milliseconds() {
    for image in ["nucleo-g474re", "mps2-an386"] {
        let Some(formats) = formats(image) else { continue };
        let stamps: Vec<&String> = formats.iter().filter(|f| f.contains("\"tag\":\"defmt_timestamp\"")).collect();
        assert_eq!(stamps.len(), 1, "{image}: {formats:?}");
        assert!(stamps[0].contains("{=u32:tms}"), "{image}: {}", stamps[0]);
        println!("{image}: {}", stamps[0]);
    }
}

#[test]
fn the_controllers_line_can_be_looked_up_in_its_image() {
    let Some(formats) = formats("nucleo-g474re") else { return };
    let line = "damprig {} on {}";
    assert!(formats.iter().any(|format| format.contains(line)), "{line:?} is not in {formats:?}");
}

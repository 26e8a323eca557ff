//! Any bytes into a host's reader, as they are and as frames with a right checksum: it must not panic, and a clean
//! frame after them must be read.
#![no_main]

use damprig_protocol::frame::{self, LONGEST, Reader};
use damprig_protocol::FromDevice;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let mut reader = Reader::default();
    let mut buffer = [0; LONGEST];
    let wrapped = frame::wrap(data, &mut buffer).unwrap_or(0);
    for &byte in data.iter().chain(&[0]).chain(&buffer[..wrapped]) {
        let _ = reader.push::<FromDevice>(byte);
    }
    let message = FromDevice::Clock { tick: 7 };
    let length = frame::encode(&message, &mut buffer).expect("fits");
    let read = buffer[..length].iter().filter_map(|&byte| reader.push(byte)).next();
    assert_eq!(read, Some(Ok(message)));
});

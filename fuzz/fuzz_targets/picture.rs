//! Picture files: any bytes give a picture with as many pixels as it says, or an error that names the file.
#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use relumine_radiometry::files::{MAX_PIXELS, Picture, decode_picture};

/// libFuzzer's own hook aborts at any panic, but those of B44 are expected and caught (exr_read.rs). Others leave the
/// target, which aborts.
fn let_b44_panic() {
    std::panic::set_hook(Box::new(|panic| {
        if !panic.location().is_some_and(|place| place.file().contains("b44")) {
            eprintln!("{panic}");
        }
    }));
}

/// A picture of up to 2²⁸ pixels is believed and takes seconds, whatever is in it; the time is better spent on small ones.
/// (PNG, TIFF and JPEG fail before they take any.)
fn announces_much(bytes: &[u8]) -> bool {
    const MUCH: u64 = 1 << 22;
    if bytes.starts_with(b"#?") {
        let words = bytes.split(|byte| byte.is_ascii_whitespace() || *byte == b'+' || *byte == b'-');
        let mut numbers = words.filter_map(|word| std::str::from_utf8(word).ok()?.parse::<u64>().ok());
        return numbers.any(|number| number > 1 << 14);
    }
    // OpenEXR windows: the smallest and the largest column and row.
    let box_type = b"box2i\0\x10\0\0\0";
    bytes.windows(box_type.len() + 16).filter(|bytes| bytes.starts_with(box_type)).any(|bytes| {
        let number = |index: usize| {
            let at = box_type.len() + 4 * index;
            i64::from(i32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]))
        };
        let side = |from: usize, to: usize| (number(to) - number(from)).unsigned_abs() + 1;
        side(0, 2).saturating_mul(side(1, 3)) > MUCH
    })
}

fuzz_target!(init: let_b44_panic(), |bytes: &[u8]| {
    if announces_much(bytes) {
        return;
    }
    match decode_picture(Path::new("picture"), bytes) {
        Ok(picture) => {
            let (width, height) = picture.size();
            assert!((1..=MAX_PIXELS).contains(&(width * height)));
            match picture {
                Picture::Float(image) => assert!(image.pixels().as_flattened().iter().all(|sample| sample.is_finite())),
                Picture::Integer { image, bits } => {
                    assert!(bits == 8 || bits == 16);
                    assert!(bits == 16 || image.pixels().as_flattened().iter().all(|sample| *sample < 256));
                }
            }
        }
        Err(error) => assert!(error.to_string().starts_with("picture:"), "{error}"),
    }
});

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

fuzz_target!(init: let_b44_panic(), |bytes: &[u8]| {
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

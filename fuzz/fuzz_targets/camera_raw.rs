//! Camera RAW: any bytes give a photograph, or an error that names the file, and claims beyond the bytes are refused. Panics
//! of the decoder are expected and caught (camera_raw/decode.rs).
#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use relumine_radiometry::files::{MAX_PIXELS, Photograph, RawKind, decode_photograph};

/// libFuzzer's own hook aborts at any panic. Those of rawler are caught; others leave the target, which aborts.
fn let_rawler_panic() {
    std::panic::set_hook(Box::new(|panic| {
        if !panic.location().is_some_and(|place| place.file().contains("rawler")) {
            eprintln!("{panic}");
        }
    }));
}

fuzz_target!(init: let_rawler_panic(), |bytes: &[u8]| {
    if RawKind::of(bytes).is_none() {
        return;
    }
    match decode_photograph(Path::new("photograph"), bytes) {
        Ok(Photograph::Raw(raw)) => {
            let (width, height) = raw.image.size();
            assert!((1..=MAX_PIXELS).contains(&(width * height)));
            assert!(raw.levels.black < raw.levels.white);
            assert!(raw.image.pixels().as_flattened().iter().all(|count| *count <= raw.levels.white));
        }
        Ok(Photograph::Picture(picture)) => panic!("a RAW file came back as a {}", picture.describe()),
        Err(error) => assert!(error.to_string().starts_with("photograph: "), "{error}"),
    }
});

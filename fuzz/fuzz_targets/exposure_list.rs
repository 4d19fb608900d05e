//! Lists of exposures. The first byte chooses seconds, or `r` and 1/seconds.
#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use relumine::ExposureList;

fuzz_target!(|text: &str| {
    let (kind, text) = text.split_at_checked(1).unwrap_or_default();
    match ExposureList::parse(Path::new("set/list.txt"), text, kind == "r") {
        Ok(list) => {
            for (file, exposure) in &list.photographs {
                assert!(!file.as_os_str().is_empty() && *exposure > 0.0 && exposure.is_finite(), "{file:?} {exposure}");
            }
        }
        Err(error) => assert!(error.to_string().starts_with("set/list.txt:"), "{error}"),
    }
});

//! A list of grey levels: any text gives levels that rise, or an error that names file and line.
#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use relumine_radiometry::projector::RampEntry;

fuzz_target!(|text: &str| {
    match RampEntry::parse_list(Path::new("ramp.txt"), text) {
        Ok(entries) => {
            assert!(entries.len() >= 2);
            assert!(entries.is_sorted_by(|a, b| a.level < b.level));
            assert!(entries.iter().all(|entry| entry.level >= 0.0 && entry.level.is_finite()));
            assert!(entries.iter().all(|entry| entry.file.components().next().is_some()));
        }
        Err(error) => assert!(error.to_string().starts_with("ramp.txt:"), "{error}"),
    }
});

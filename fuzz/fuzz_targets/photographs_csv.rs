//! `photographs.csv`: any bytes give rows that can be used, or an error that names file and line.
#![no_main]

use std::path::{Component, Path};

use libfuzzer_sys::fuzz_target;
use relumine_capture::Photographs;

fuzz_target!(|bytes: &[u8]| {
    match Photographs::parse(Path::new("photographs.csv"), bytes) {
        Ok(photographs) => {
            for ((_, pattern), rows) in &photographs.rows {
                assert_eq!(pattern.to_string().parse(), Ok(*pattern));
                assert!(!rows.is_empty());
                for row in rows {
                    assert!(row.exposure.relative() > 0.0 && row.exposure.relative().is_finite());
                    assert!(row.file.components().all(|part| matches!(part, Component::Normal(_))));
                }
                assert!(rows.is_sorted_by(|a, b| a.exposure.relative() <= b.exposure.relative()));
            }
        }
        Err(error) => assert!(error.to_string().starts_with("photographs.csv:"), "{error}"),
    }
});

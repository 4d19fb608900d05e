//! TOML descriptions that people write by hand, read strictly: an unknown key is an error that names the nearest known one.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

/// What is wrong with a TOML description: where, and what was expected.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DescriptionError {
    /// The file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The text is not the description it should be.
    #[error("{}:{line}: {reason}", path.display())]
    Text {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What was expected and what came.
        reason: String,
    },
}

/// No description that a person writes is longer; more is refused before it is read.
const MAX_BYTES: u64 = 64 << 20;

/// Reads the text of a description file.
///
/// # Errors
/// If it cannot be read, is no regular file, is not UTF-8 or is larger than 64 MiB.
pub fn read_text(path: &Path) -> Result<String, DescriptionError> {
    read_bounded(path, MAX_BYTES).map_err(|source| DescriptionError::Read { path: path.to_path_buf(), source })
}

/// Reads a regular file of at most `most` bytes of UTF-8 text. What a device or a pipe says of its length is not believed.
///
/// # Errors
/// If it cannot be read, is no regular file, is not UTF-8 or is longer.
pub fn read_bounded(path: &Path, most: u64) -> io::Result<String> {
    // Looked at before it is opened: opening a pipe would wait for its writer.
    if !fs::metadata(path)?.is_file() {
        return Err(io::Error::other("not a regular file"));
    }
    let mut text = String::new();
    File::open(path)?.take(most + 1).read_to_string(&mut text)?;
    if text.len() as u64 > most {
        return Err(io::Error::other(format!("longer than the {most} bytes that such a file may have")));
    }
    Ok(text)
}

/// Reads `text` as a `T` whose unknown keys are errors (`#[serde(deny_unknown_fields)]`); `path` is for messages.
///
/// # Errors
/// With the line, and the nearest known key where one is unknown.
pub fn parse_toml<T: DeserializeOwned>(path: &Path, text: &str) -> Result<T, DescriptionError> {
    toml::from_str(text).map_err(|error| {
        let offset = error.span().map_or(0, |span| span.start).min(text.len());
        let line = text.as_bytes()[..offset].iter().filter(|byte| **byte == b'\n').count() + 1;
        DescriptionError::Text { path: path.to_path_buf(), line, reason: with_nearest_key(error.message()) }
    })
}

/// serde says "unknown field `x`, expected one of `a`, `b`"; this adds which of them is nearest to x.
fn with_nearest_key(message: &str) -> String {
    let message = message.trim().replace('\n', " ");
    let Some(rest) = message.strip_prefix("unknown field ") else { return message };
    let mut quoted = rest.split('`').skip(1).step_by(2);
    let Some(unknown) = quoted.next() else { return message };
    let known: Vec<&str> = quoted.collect();
    match nearest(unknown, &known) {
        Some(near) => format!("unknown key `{unknown}`: did you mean `{near}`? (known here: {})", known.join(", ")),
        None => format!("unknown key `{unknown}` (known here: {})", known.join(", ")),
    }
}

/// The word of `known` with the smallest edit distance from `word`, if it is near at all: at most half the letters change.
pub fn nearest<'a>(word: &str, known: &[&'a str]) -> Option<&'a str> {
    known
        .iter()
        .map(|candidate| (edit_distance(word, candidate), *candidate))
        .min()
        .filter(|(distance, candidate)| 2 * distance <= candidate.chars().count().max(2))
        .map(|(_, candidate)| candidate)
}

fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().take(256).collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, from) in a.chars().take(256).enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, to) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(from != *to);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Description {
        radius_m: f64,
        tilts: Option<u32>,
    }

    #[test]
    fn an_unknown_key_names_the_line_and_the_nearest_known_key() {
        let error = parse_toml::<Description>(Path::new("a.toml"), "radius_m = 1\n\nradus = 2\n").unwrap_err();
        assert_eq!(
            error.to_string(),
            "a.toml:3: unknown key `radus`: did you mean `radius_m`? (known here: radius_m, tilts)"
        );
        let error = parse_toml::<Description>(Path::new("a.toml"), "radius_m = 1\nqqqqqqqqq = 2\n").unwrap_err();
        assert!(!error.to_string().contains("did you mean"), "{error}");
    }
}

//! A list of photographs and their exposures: `name seconds` a line, as hdrgen and the lists of Debevec have it.

use std::path::{Path, PathBuf};

use relumine_radiometry::read_text;

use crate::Error;

/// Photographs with the exposure of each.
#[derive(Clone, Debug, PartialEq)]
pub struct ExposureList {
    /// The list it was read from.
    pub path: PathBuf,
    /// Picture files, their names relative to the list, and exposures above 0.
    pub photographs: Vec<(PathBuf, f64)>,
}

impl ExposureList {
    /// Reads a list: on each line a name (in double quotes if there is a space in it) and seconds, or 1/seconds if
    /// `reciprocal`; further columns are not looked at, `#` begins a comment, and a first line may have the number of
    /// photographs.
    ///
    /// # Errors
    /// If it cannot be read, or a line is wrong.
    pub fn read(path: &Path, reciprocal: bool) -> Result<Self, Error> {
        let text = read_text(path).map_err(|error| Error::ExposureList {
            path: path.to_path_buf(),
            line: 1,
            reason: error.to_string(),
        })?;
        Self::parse(path, &text, reciprocal)
    }

    /// Reads the text of a list; names are taken relative to `path`, which is not opened.
    ///
    /// # Errors
    /// If a line is wrong.
    pub fn parse(path: &Path, text: &str, reciprocal: bool) -> Result<Self, Error> {
        let fail = |line: usize, reason: String| Error::ExposureList { path: path.to_path_buf(), line, reason };
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut announced = None;
        let mut photographs: Vec<(PathBuf, f64)> = Vec::new();
        let mut last_line = 1;
        for (index, line) in text.lines().enumerate() {
            let line = line.trim_start_matches('\u{feff}').trim();
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            last_line = index + 1;
            let (name, rest) = name_and_rest(line).map_err(|reason| fail(index + 1, reason))?;
            let Some(number) = rest.split_whitespace().next().filter(|word| !word.starts_with('#')) else {
                match name.parse::<usize>() {
                    Ok(count) if announced.is_none() && photographs.is_empty() => announced = Some(count),
                    _ => return Err(fail(index + 1, format!("expected a name and an exposure, found \"{line}\""))),
                }
                continue;
            };
            let unit = if reciprocal { "1/seconds" } else { "seconds" };
            let value = number.parse::<f64>().ok().filter(|value| *value > 0.0 && value.is_finite());
            let value = value.ok_or_else(|| {
                fail(index + 1, format!("expected an exposure above 0 in {unit} after the name, found \"{number}\""))
            })?;
            let exposure = if reciprocal { 1.0 / value } else { value };
            if !(exposure > 0.0 && exposure.is_finite()) {
                return Err(fail(index + 1, format!("{number} {unit} is no exposure")));
            }
            let file = folder.join(name);
            if photographs.iter().any(|(listed, _)| *listed == file) {
                return Err(fail(index + 1, format!("{name} is listed twice")));
            }
            photographs.push((file, exposure));
            if photographs.len() > super::MOST_PHOTOGRAPHS {
                return Err(fail(index + 1, format!("more than {} photographs", super::MOST_PHOTOGRAPHS)));
            }
        }
        if announced.is_some_and(|count| count != photographs.len()) {
            let (announced, found) = (announced.unwrap_or_default(), photographs.len());
            return Err(fail(last_line, format!("{announced} photographs are announced, {found} are listed")));
        }
        Ok(Self { path: path.to_path_buf(), photographs })
    }
}

/// The first word, or what stands in double quotes, and what follows it.
fn name_and_rest(line: &str) -> Result<(&str, &str), String> {
    let (name, rest) = match line.strip_prefix('"') {
        Some(quoted) => quoted.split_once('"').ok_or("a quote is not closed")?,
        None => line.split_once(char::is_whitespace).unwrap_or((line, "")),
    };
    if name.is_empty() { Err("a photograph without a name".into()) } else { Ok((name, rest)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str, reciprocal: bool) -> Result<Vec<(String, f64)>, String> {
        let list =
            ExposureList::parse(Path::new("set/list.txt"), text, reciprocal).map_err(|error| error.to_string())?;
        Ok(list.photographs.iter().map(|(file, exposure)| (file.display().to_string(), *exposure)).collect())
    }

    #[test]
    fn names_are_relative_to_the_list_and_further_columns_are_left() {
        let debevec =
            "# Number of Images\n2\n# Filename  1/shutter_speed f/stop\na.png 0.03125 8 0 0\nb.png 64    8 0 0\n";
        let expected = vec![("set/a.png".to_string(), 32.0), ("set/b.png".to_string(), 1.0 / 64.0)];
        assert_eq!(parse(debevec, true), Ok(expected));
        let quoted = parse("\"a b.jpg\"\t0.5 # half\r\nc.jpg 2\r\n", false);
        assert_eq!(quoted, Ok(vec![("set/a b.jpg".to_string(), 0.5), ("set/c.jpg".to_string(), 2.0)]));
    }

    #[test]
    fn what_cannot_be_says_in_which_line() {
        for (text, reason) in [
            ("a.png 1\nb.png x\n", "set/list.txt:2: expected an exposure above 0 in seconds"),
            ("a.png 0\n", ":1: expected an exposure above 0"),
            ("a.png 1\nb.png\n", ":2: expected a name and an exposure"),
            ("3\na.png 1\nb.png 2\n", "3 photographs are announced, 2 are listed"),
            ("a.png 1\na.png 2\n", ":2: a.png is listed twice"),
            ("\"a.png 1\n", "not closed"),
            ("a.png 1e-320\n", "is no exposure"),
        ] {
            let error = parse(text, text.contains("e-320")).unwrap_err();
            assert!(error.contains(reason), "{text:?}: {error}");
        }
    }
}

//! Tables of reference values, CGATS.17 text as ArgyllCMS and chart makers write it (`.cie`, `.ti2`, `.ti3`, `.txt`): what
//! is measured, patch by patch, as XYZ or L\*a\*b\*.

use std::collections::BTreeMap;
use std::path::Path;

use super::ColourError;
use super::chart::patch_name;
use crate::{DescriptionError, read_bounded};

/// A chart with more patches is no chart.
pub(super) const MOST_PATCHES: usize = 10_000;
/// A longer file is no chart's.
const MOST_BYTES: u64 = 4 << 20;
/// Tristimulus values and L\*a\*b\* beyond it are of nothing that reflects.
const LARGEST: f64 = 1e4;

/// What the three numbers of a patch are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Space {
    /// CIE XYZ, 0 … 100.
    Xyz,
    /// CIE L*a*b*.
    Lab,
}

impl Space {
    pub(super) fn of_name(name: &str) -> Result<Self, String> {
        match name {
            "XYZ" => Ok(Self::Xyz),
            "LAB" => Ok(Self::Lab),
            _ => Err(format!("expected XYZ or LAB, found {name}")),
        }
    }
}

/// Values as a file has them, by the names of patches.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Table {
    pub(super) space: Space,
    pub(super) values: BTreeMap<String, [f64; 3]>,
}

impl Table {
    pub(super) fn new(space: Space) -> Self {
        Self { space, values: BTreeMap::new() }
    }

    pub(super) fn insert(&mut self, name: &str, values: [f64; 3]) -> Result<(), String> {
        let name = patch_name(name);
        if values.iter().any(|value| value.abs() > LARGEST) {
            return Err(format!("{name}: expected values up to {LARGEST}, found {values:?}"));
        }
        if self.values.contains_key(&name) {
            return Err(format!("{name} comes twice"));
        }
        self.values.insert(name, values);
        Ok(())
    }

    /// Reads the first table of a CGATS text; `path` is for messages. Patches are named by the field `SAMPLE_LOC`, or else `SAMPLE_ID` or
    /// `SAMPLE_NAME`; of XYZ and L\*a\*b\* the former is taken where both are given.
    ///
    /// # Errors
    /// If the text has no table with these fields, a row has too few or bad values, or a patch comes twice.
    pub(super) fn parse(path: &Path, text: &str) -> Result<Self, ColourError> {
        let mut fields: Vec<String> = Vec::new();
        let mut reading: Option<(usize, Space, [usize; 3], Self)> = None;
        let mut in_format = false;
        for (index, line) in text.lines().enumerate() {
            let fail = |reason: String| ColourError::line(path, index + 1, reason);
            let words = words(line);
            let Some(first) = words.first() else { continue };
            match (first.as_str(), &mut reading) {
                ("BEGIN_DATA_FORMAT", None) => in_format = true,
                ("END_DATA_FORMAT", None) => in_format = false,
                ("BEGIN_DATA", None) => {
                    let (name, space, values) = columns(&fields).map_err(fail)?;
                    reading = Some((name, space, values, Self::new(space)));
                }
                ("END_DATA", Some((.., table))) => {
                    if table.values.is_empty() {
                        return Err(fail("no rows between BEGIN_DATA and END_DATA".into()));
                    }
                    return Ok(table.clone());
                }
                (_, None) if in_format => {
                    fields.extend(words);
                    if fields.len() > 1000 {
                        return Err(fail("more than 1000 fields".into()));
                    }
                }
                (_, None) => {}
                (_, Some((name, _, values, table))) => {
                    if words.len() != fields.len() {
                        return Err(fail(format!("expected {} values, found {}", fields.len(), words.len())));
                    }
                    if table.values.len() == MOST_PATCHES {
                        return Err(fail(format!("more than {MOST_PATCHES} patches")));
                    }
                    let row: Vec<&str> = values.iter().map(|column| words[*column].as_str()).collect();
                    table.insert(&words[*name], numbers::<3>(&row).map_err(fail)?).map_err(fail)?;
                }
            }
        }
        Err(ColourError::content(
            path,
            match reading {
                Some(_) => "the table does not end: expected END_DATA",
                None => "no table: expected BEGIN_DATA_FORMAT … END_DATA_FORMAT and BEGIN_DATA … END_DATA",
            },
        ))
    }
}

/// Where the name and the three values are.
fn columns(fields: &[String]) -> Result<(usize, Space, [usize; 3]), String> {
    let place = |name: &str| fields.iter().position(|field| field == name);
    let name = ["SAMPLE_LOC", "SAMPLE_ID", "SAMPLE_NAME"].into_iter().find_map(place);
    let name =
        name.ok_or_else(|| "the table does not name its patches: expected SAMPLE_LOC or SAMPLE_ID".to_string())?;
    for (space, [x, y, z]) in [(Space::Xyz, ["XYZ_X", "XYZ_Y", "XYZ_Z"]), (Space::Lab, ["LAB_L", "LAB_A", "LAB_B"])] {
        if let (Some(x), Some(y), Some(z)) = (place(x), place(y), place(z)) {
            return Ok((name, space, [x, y, z]));
        }
    }
    let found = fields.iter().take(20).map(String::as_str).collect::<Vec<_>>().join(" ");
    Err(format!("expected the fields XYZ_X XYZ_Y XYZ_Z or LAB_L LAB_A LAB_B, found {found}"))
}

/// The words of a line; one in quotes may have blanks in it, and `#` begins a comment.
fn words(line: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let (mut quoted, mut inside) = (false, false);
    for letter in line.chars() {
        match letter {
            '"' => {
                if !quoted && !inside {
                    words.push(String::new());
                }
                quoted = !quoted;
                inside = true;
            }
            '#' if !quoted => break,
            blank if blank.is_whitespace() && !quoted => inside = false,
            letter => {
                if !inside {
                    words.push(String::new());
                    inside = true;
                }
                if let Some(word) = words.last_mut() {
                    word.push(letter);
                }
            }
        }
    }
    words
}

/// Exactly N finite numbers.
pub(super) fn numbers<const N: usize>(words: &[&str]) -> Result<[f64; N], String> {
    let fail = || {
        let found: String = words.join(" ").chars().take(80).collect();
        format!("expected {N} numbers, found \"{found}\"")
    };
    let numbers: Vec<f64> = words
        .iter()
        .map(|word| word.parse::<f64>().ok().filter(|number| number.abs() < 1e9))
        .collect::<Option<_>>()
        .ok_or_else(fail)?;
    numbers.try_into().map_err(|_| fail())
}

/// The text of a table or chart file.
pub(super) fn read_table_text(path: &Path) -> Result<String, ColourError> {
    let failed = |source| DescriptionError::Read { path: path.to_path_buf(), source };
    Ok(read_bounded(path, MOST_BYTES).map_err(failed)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: &str = "CTI2\n\nORIGINATOR \"some one\"\n# a comment\nNUMBER_OF_FIELDS 5\nBEGIN_DATA_FORMAT\nSAMPLE_ID SAMPLE_LOC \
        XYZ_X XYZ_Y XYZ_Z\nEND_DATA_FORMAT\nNUMBER_OF_SETS 2\nBEGIN_DATA\n1 \"A01\" 1 2 3\n2\t\"A 2\"\t4 5.5 6e0 # last\nEND_DATA\n\
        CTI2\nBEGIN_DATA\n";

    fn parse(text: &str) -> Result<Table, String> {
        Table::parse(Path::new("t.cie"), text).map_err(|error| error.to_string())
    }

    #[test]
    fn the_first_table_is_read_by_location() {
        let table = parse(SMALL).unwrap();
        assert_eq!(table.space, Space::Xyz);
        assert_eq!(table.values.len(), 2);
        assert_eq!((table.values["A1"], table.values["A 2"]), ([1.0, 2.0, 3.0], [4.0, 5.5, 6.0]));
        let lab =
            SMALL.replace("XYZ_X XYZ_Y XYZ_Z", "LAB_L LAB_A LAB_B").replace("SAMPLE_ID SAMPLE_LOC", "SAMPLE_ID Q");
        let lab = parse(&lab).unwrap();
        assert_eq!((lab.space, lab.values["2"]), (Space::Lab, [4.0, 5.5, 6.0]));
    }

    #[test]
    fn what_cannot_be_says_where() {
        for (from, to, reason) in [
            (
                "XYZ_Z",
                "SPEC_400",
                "t.cie:10: expected the fields XYZ_X XYZ_Y XYZ_Z or LAB_L LAB_A LAB_B, found SAMPLE_ID",
            ),
            ("SAMPLE", "S", "t.cie:10: the table does not name its patches"),
            ("4 5.5 6e0", "4 5.5", "t.cie:12: expected 5 values, found 4"),
            ("4 5.5 6e0", "4 5.5 inf", "t.cie:12: expected 3 numbers"),
            ("4 5.5 6e0", "4 5.5 20000", "t.cie:12: A 2: expected values up to"),
            ("A 2", "A1", "t.cie:12: A1 comes twice"),
            ("END_DATA\nCTI2\nBEGIN_DATA\n", "", "t.cie: the table does not end"),
            ("BEGIN_DATA\n", "", "t.cie: no table"),
        ] {
            assert!(SMALL.contains(from), "{from}");
            let error = parse(&SMALL.replace(from, to)).unwrap_err();
            assert!(error.starts_with(reason), "{from} → {to}: {error}");
        }
    }
}

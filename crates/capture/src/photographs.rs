//! `photographs.csv`: what was taken, one row a photograph, read while it grows (FORMAT.md §1).

use std::collections::hash_map::Entry;
use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Component, Path, PathBuf};

use relumine_radiometry::{ExposureSettings, Gain};

use crate::{CaptureError, ShownPattern};

/// One photograph as the table lists it.
#[derive(Clone, Debug, PartialEq)]
pub struct PhotographRow {
    /// Shutter, sensitivity, aperture.
    pub exposure: ExposureSettings,
    /// The picture, relative to the capture directory.
    pub file: PathBuf,
    /// SHA-256 of the picture file, if listed.
    pub sha256: Option<[u8; 32]>,
    /// Line in the table, from 1.
    pub line: u64,
}

/// All photographs of a capture by position and pattern; those of one pattern are its exposures, shortest first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Photographs {
    /// The photographs.
    pub rows: BTreeMap<(usize, ShownPattern), Vec<PhotographRow>>,
    /// Lines replaced by a later one with the same position, pattern and exposure: `(line, by line)`.
    pub replaced: Vec<(u64, u64)>,
    /// The last line, if the file ends inside it: a photograph not taken yet.
    pub torn_line: Option<u64>,
}

/// Where each exposure of a pattern stands among its exposures, while the table is read.
type Places = HashMap<(usize, ShownPattern, u64), usize>;

/// Longer lines are refused, so that a file without newlines does not fill the memory.
const LONGEST_LINE: u64 = 64 << 10;

const COLUMNS: [&str; 7] = ["position", "pattern", "exposure_s", "iso", "f_number", "file", "sha256"];

/// The header line of `photographs.csv`, with its newline.
pub fn csv_header() -> String {
    COLUMNS.join(",") + "\n"
}

impl PhotographRow {
    /// The line of the table that says this of a photograph, with its newline: what [`Photographs::parse`] reads back.
    /// `line` is where it will stand and is not said. A name with a line break cannot be said.
    pub fn csv_line(&self, position: usize, pattern: ShownPattern) -> String {
        let Self { exposure, file, sha256, .. } = self;
        let number = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
        let (iso, f_number) = (exposure.gain.map(|gain| gain.iso), exposure.gain.map(|gain| gain.f_number));
        // On every system with the separator that every system reads.
        let file: Vec<_> = file.iter().map(|part| part.to_string_lossy()).collect();
        let mut file = file.join("/");
        if file.contains([',', '"']) {
            file = format!("\"{}\"", file.replace('"', "\"\""));
        }
        let sha256: String = sha256.iter().flatten().map(|byte| format!("{byte:02x}")).collect();
        format!("{position},{pattern},{},{},{},{file},{sha256}\n", exposure.exposure_s, number(iso), number(f_number))
    }
}

impl Photographs {
    /// Reads the table.
    ///
    /// # Errors
    /// If it cannot be read or a row other than a torn last one is wrong, with its line.
    pub fn read(path: &Path) -> Result<Self, CaptureError> {
        let fail = |source| CaptureError::Read { path: path.to_path_buf(), source };
        let file = File::open(path).map_err(fail)?;
        let length = file.metadata().map_err(fail)?.len();
        // Rows that are appended after this moment are left for the next reading.
        Self::from_lines(path, BufReader::new(file.take(length)))
    }

    /// Reads the table's text; `path` is for messages.
    ///
    /// # Errors
    /// As [`Photographs::read`].
    pub fn parse(path: &Path, text: &[u8]) -> Result<Self, CaptureError> {
        Self::from_lines(path, text)
    }

    fn from_lines(path: &Path, mut text: impl BufRead) -> Result<Self, CaptureError> {
        let fail = |line: u64, reason: String| CaptureError::Row { path: path.to_path_buf(), line, reason };
        let mut table = Self::default();
        let mut places = Places::new();
        let mut header_seen = false;
        let mut gains = None;
        let mut any_sha256 = false;
        let mut bytes = Vec::new();
        for line in 1.. {
            bytes.clear();
            text.by_ref()
                .take(LONGEST_LINE)
                .read_until(b'\n', &mut bytes)
                .map_err(|source| CaptureError::Read { path: path.to_path_buf(), source })?;
            if bytes.is_empty() {
                break;
            }
            let whole = bytes.ends_with(b"\n");
            if !whole && bytes.len() as u64 == LONGEST_LINE {
                return Err(fail(line, format!("a line of more than {LONGEST_LINE} bytes is no photograph")));
            }
            if bytes.trim_ascii().is_empty() {
                continue;
            }
            let fields =
                std::str::from_utf8(&bytes).map_err(|_| "expected UTF-8 text".to_string()).and_then(csv_fields);
            if !header_seen {
                let header = fields.unwrap_or_default();
                if header != COLUMNS {
                    let (expected, found) = (COLUMNS.join(","), header.join(","));
                    return Err(fail(line, format!("expected the header \"{expected}\", found \"{found}\"")));
                }
                header_seen = true;
                continue;
            }
            let row = fields.and_then(|fields| parse_row(&fields, line));
            // Without its newline the last line is taken only if it says all that the others say.
            if !whole && !row.as_ref().is_ok_and(|(_, _, row)| row.sha256.is_some() || !any_sha256) {
                table.torn_line = Some(line);
                break;
            }
            let (position, pattern, row) = row.map_err(|reason| fail(line, reason))?;
            if *gains.get_or_insert(row.exposure.gain.is_some()) != row.exposure.gain.is_some() {
                return Err(fail(line, "iso and f_number must be given in every row or in none".into()));
            }
            any_sha256 |= row.sha256.is_some();
            table.insert(&mut places, position, pattern, row);
        }
        if !header_seen {
            return Err(fail(1, format!("expected the header \"{}\", found nothing", COLUMNS.join(","))));
        }
        for exposures in table.rows.values_mut() {
            exposures.sort_by(|a, b| a.exposure.relative().total_cmp(&b.exposure.relative()));
        }
        Ok(table)
    }

    fn insert(&mut self, places: &mut Places, position: usize, pattern: ShownPattern, row: PhotographRow) {
        let exposures = self.rows.entry((position, pattern)).or_default();
        match places.entry((position, pattern, row.exposure.relative().to_bits())) {
            Entry::Occupied(place) => {
                let earlier = &mut exposures[*place.get()];
                self.replaced.push((earlier.line, row.line));
                *earlier = row;
            }
            Entry::Vacant(place) => {
                place.insert(exposures.len());
                exposures.push(row);
            }
        }
    }

    /// Number of photographs, all exposures counted.
    pub fn len(&self) -> usize {
        self.rows.values().map(Vec::len).sum()
    }

    /// Whether nothing has been photographed.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }
}

/// The fields of one line of CSV; a field may stand in double quotes, a quote inside it doubled.
///
/// # Errors
/// If a quote is not closed.
pub fn csv_fields(line: &str) -> Result<Vec<String>, String> {
    let mut fields = vec![String::new()];
    let mut quoted = false;
    let mut letters = line.trim_end_matches(['\r', '\n']).trim_start_matches('\u{feff}').chars().peekable();
    while let Some(letter) = letters.next() {
        let field = fields.last_mut().expect("there is always a field under way");
        match letter {
            '"' if quoted && letters.next_if_eq(&'"').is_some() => field.push('"'),
            '"' if quoted => quoted = false,
            '"' if field.trim().is_empty() => quoted = true,
            ',' if !quoted => fields.push(String::new()),
            _ => field.push(letter),
        }
    }
    if quoted {
        Err("a quote is not closed".into())
    } else {
        Ok(fields.iter().map(|field| field.trim().into()).collect())
    }
}

fn parse_row(fields: &[String], line: u64) -> Result<(usize, ShownPattern, PhotographRow), String> {
    if fields.len() != COLUMNS.len() {
        return Err(format!("expected {} fields ({}), found {}", COLUMNS.len(), COLUMNS.join(","), fields.len()));
    }
    let field = |index: usize| fields[index].as_str();
    let positive = |index: usize| {
        field(index)
            .parse::<f64>()
            .ok()
            .filter(|value| *value > 0.0 && value.is_finite())
            .ok_or_else(|| format!("{} must be a number above 0, found \"{}\"", COLUMNS[index], field(index)))
    };
    let position =
        field(0).parse().map_err(|_| format!("position must be a whole number from 0, found \"{}\"", field(0)))?;
    let gain = match (field(3).is_empty(), field(4).is_empty()) {
        (true, true) => None,
        (false, false) => Some(Gain { iso: positive(3)?, f_number: positive(4)? }),
        _ => return Err("iso and f_number must both be given or both be empty".into()),
    };
    let exposure = ExposureSettings { exposure_s: positive(2)?, gain };
    if !(exposure.relative() > 0.0 && exposure.relative().is_finite()) {
        return Err(format!("exposure_s · iso/100 / f_number² comes to {}", exposure.relative()));
    }
    let file = PathBuf::from(field(5));
    if file.components().next().is_none() || !file.components().all(|part| matches!(part, Component::Normal(_))) {
        return Err(format!("file must be a path inside the capture directory, found \"{}\"", field(5)));
    }
    let sha256 = match field(6) {
        "" => None,
        text => Some(parse_sha256(text).ok_or_else(|| format!("sha256 must be 64 hex digits, found \"{text}\""))?),
    };
    Ok((position, field(1).parse()?, PhotographRow { exposure, file, sha256, line }))
}

fn parse_sha256(text: &str) -> Option<[u8; 32]> {
    if text.len() != 64 || !text.bytes().all(|byte| byte.is_ascii_hexdigit()) {
        return None;
    }
    let mut digest = [0; 32];
    for (byte, pair) in digest.iter_mut().zip(text.as_bytes().chunks_exact(2)) {
        *byte = u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok()?;
    }
    Some(digest)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "position,pattern,exposure_s,iso,f_number,file,sha256\n";

    fn parse(rows: &str) -> Result<Photographs, String> {
        Photographs::parse(Path::new("p.csv"), format!("{HEADER}{rows}").as_bytes()).map_err(|error| error.to_string())
    }

    #[test]
    fn every_row_goes_there_and_back() {
        let gain = Some(Gain { iso: 12800.0, f_number: 5.6 });
        let sha256 = Some(std::array::from_fn(|index| index as u8 * 8));
        let files = ["photographs/p000/black_e0.png", "a, b/\"c\".png", "weiß.exr"];
        for (exposure_s, gain, sha256, file) in [
            (0.0333, gain, sha256, files[0]),
            (1.0 / 3.0, None, None, files[1]),
            (1e-9, None, sha256, files[2]),
            (3600.0, gain, None, files[0]),
        ] {
            let exposure = ExposureSettings { exposure_s, gain };
            let row = PhotographRow { exposure, file: file.into(), sha256, line: 2 };
            let pattern = ShownPattern::Row { v: 3, k: 1 };
            let text = csv_header() + &row.csv_line(7, pattern);
            let read = Photographs::parse(Path::new("p.csv"), text.as_bytes()).unwrap();
            assert_eq!(read.rows[&(7, pattern)], [row], "{text}");
        }
        assert_eq!(csv_header(), HEADER);
    }

    #[test]
    fn exposure_is_time_times_iso_over_aperture_squared() {
        let table = parse("0,black,0.5,200,8,photographs/a.png,\n").unwrap();
        let row = &table.rows[&(0, ShownPattern::Black)][0];
        assert_eq!(row.exposure.relative(), 0.5 * 2.0 / 64.0);
        assert_eq!(row.sha256, None);
    }

    #[test]
    fn the_later_of_two_equal_rows_wins_and_is_reported() {
        let table = parse("0,black,1,,,a.png,\n0,white,1,,,w.png,\n0,black,1,,,b.png,\n").unwrap();
        assert_eq!(table.rows[&(0, ShownPattern::Black)][0].file, Path::new("b.png"));
        assert_eq!(table.replaced, [(2, 4)]);
        assert_eq!(table.len(), 2);
    }

    #[test]
    fn a_last_line_torn_anywhere_is_a_photograph_not_taken_yet() {
        let sha = "72a4fd0078310155fa0d8baaf620da26cfcac6587cffed189d07b99421525ccf";
        let first = format!("0,black,0.5,,,p/black.png,{sha}\n");
        let last = format!("0,white,0.5,,,p/whïte.png,{sha}");
        for cut in 1..last.len() {
            let bytes = [HEADER.as_bytes(), first.as_bytes(), &last.as_bytes()[..cut]].concat();
            let table = Photographs::parse(Path::new("p.csv"), &bytes).unwrap();
            assert_eq!((table.len(), table.torn_line), (1, Some(3)), "cut at {cut}");
        }
        let whole = parse(&format!("{first}{last}")).unwrap();
        assert_eq!((whole.len(), whole.torn_line), (2, None));
    }

    #[test]
    fn a_torn_line_in_the_middle_is_an_error_with_its_number() {
        let error = parse("0,black,0.5\n0,white,0.5,,,a.png,\n").unwrap_err();
        assert!(error.starts_with("p.csv:2: expected 7 fields"), "{error}");
    }

    #[test]
    fn what_cannot_be_says_where_and_why() {
        for (row, reason) in [
            ("x,black,1,,,a.png,", "position must be a whole number"),
            ("0,grey,1,,,a.png,", "found \"grey\""),
            ("0,black,0,,,a.png,", "exposure_s must be a number above 0"),
            ("0,black,nan,,,a.png,", "exposure_s must be a number above 0"),
            ("0,black,1,100,,a.png,", "both be given"),
            ("0,black,1,,,../a.png,", "inside the capture directory"),
            ("0,black,1,,,/etc/a.png,", "inside the capture directory"),
            ("0,black,1,,,,", "inside the capture directory"),
            ("0,black,1,,,a.png,12", "64 hex digits"),
            ("0,black,1,,,\"a.png,", "not closed"),
        ] {
            let error = parse(&format!("{row}\n")).unwrap_err();
            assert!(error.starts_with("p.csv:2: ") && error.contains(reason), "{row}: {error}");
        }
        assert!(parse("0,black,1,,,a.png,\n0,white,1,100,8,b.png,\n").unwrap_err().contains("in every row or in none"));
        let quoted = parse("0,black,1,,,\"a,b.png\",\n").unwrap();
        assert_eq!(quoted.rows[&(0, ShownPattern::Black)][0].file, Path::new("a,b.png"));
    }
}

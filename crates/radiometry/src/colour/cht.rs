//! `.cht`: the geometry of a chart as ArgyllCMS writes it (its manual, "Chart recognition file format", `cht_format.html`):
//! lines of boxes, the fiducial marks, and expected values.

use std::path::Path;

use super::ColourError;
use super::chart::{Chart, MARGIN, Patch, patch_name};
use super::table::{MOST_PATCHES, Space, Table, numbers, read_table_text};

impl Chart {
    /// Reads a `.cht` file.
    ///
    /// # Errors
    /// If it cannot be read, or as [`Chart::parse_cht`].
    pub fn read_cht(path: &Path) -> Result<Self, ColourError> {
        Self::parse_cht(path, &read_table_text(path)?)
    }

    /// Reads the text of a `.cht` file; `path` is for messages. Of the boxes those of kind `X` and `Y` are patches, `F` holds
    /// the fiducial marks; without it the chart is placed by the corners of the rectangle around all patches. Expected values
    /// may be XYZ (0 … 100) or L\*a\*b\*.
    ///
    /// # Errors
    /// If a line of these cannot be, there are no patches, more than 10,000, or two of one name.
    pub fn parse_cht(path: &Path, text: &str) -> Result<Self, ColourError> {
        let (mut patches, mut marks, mut grid, mut shrink) = (Vec::new(), None, None, 0.0);
        let mut expected: Option<Table> = None;
        let (mut arrays, mut remaining) = (0, 0usize);
        for (index, line) in text.lines().enumerate() {
            let fail = |reason: String| ColourError::line(path, index + 1, reason);
            let words: Vec<&str> = line.split_whitespace().collect();
            match words.as_slice() {
                [] => {}
                ["F", _, _, rest @ ..] => {
                    let [a, b, c, d, e, f, g, h] = numbers::<8>(rest).map_err(fail)?;
                    marks = Some([[a, b], [c, d], [e, f], [g, h]]);
                }
                [kind @ ("X" | "Y"), x0, x1, y0, y1, rest @ ..] => {
                    let names = [labels(x0, x1).map_err(fail)?, labels(y0, y1).map_err(fail)?];
                    let regular = add_boxes(&mut patches, *kind == "X", &names, rest).map_err(fail)?;
                    grid = regular.then_some([names[0].len(), names[1].len()]);
                    arrays += 1;
                }
                ["BOX_SHRINK", number] => [shrink] = numbers::<1>(&[number]).map_err(fail)?,
                ["EXPECTED", kind, count] => {
                    let announced = count.parse().ok().filter(|count| *count <= MOST_PATCHES);
                    remaining = announced.ok_or_else(|| {
                        fail(format!("expected how many values follow, at most {MOST_PATCHES}, found {count}"))
                    })?;
                    let space = Space::of_name(kind).map_err(fail)?;
                    expected = Some(Table::new(space));
                }
                [name, rest @ ..] if remaining > 0 => {
                    if let Some(table) = &mut expected {
                        table.insert(name, numbers::<3>(rest).map_err(fail)?).map_err(fail)?;
                    }
                    remaining -= 1;
                }
                // D, XLIST, YLIST, REF_ROTATION and what they count are for Argyll's own search.
                _ => {}
            }
        }
        if remaining > 0 || expected.as_ref().is_some_and(|table| table.values.is_empty()) {
            let reason = format!("expected {remaining} more values after EXPECTED, found the end of the file");
            return Err(ColourError::content(path, reason));
        }
        finish(path, patches, marks, shrink, grid.filter(|_| arrays == 1), expected)
    }
}

fn finish(
    path: &Path,
    mut patches: Vec<Patch>,
    marks: Option<[[f64; 2]; 4]>,
    shrink: f64,
    grid: Option<[usize; 2]>,
    expected: Option<Table>,
) -> Result<Chart, ColourError> {
    if patches.is_empty() {
        return Err(ColourError::content(path, "no patches: expected BOXES with lines that begin with X or Y"));
    }
    let mut names: Vec<&str> = patches.iter().map(|patch| patch.name.as_str()).collect();
    names.sort_unstable();
    if let Some(pair) = names.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(ColourError::content(path, format!("two patches are called {}", pair[0])));
    }
    for patch in &mut patches {
        let [left, top, right, bottom] = patch.rectangle;
        patch.margin = (shrink / (right - left).min(bottom - top)).clamp(MARGIN, 0.45);
    }
    let around = patches
        .iter()
        .map(|patch| patch.rectangle)
        .reduce(|a, b| [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])]);
    let [left, top, right, bottom] = around.unwrap_or_default();
    Ok(Chart {
        name: path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default(),
        patches,
        corners: marks.unwrap_or([[left, top], [right, top], [right, bottom], [left, bottom]]),
        grid,
        fiducials: marks.is_some(),
        expected,
    })
}

/// The labels from one to another: letters (`A` to `N`, `Z` is followed by `AA`), numbers (`1` to `10`), one word twice, or `_` for
/// none.
fn labels(first: &str, last: &str) -> Result<Vec<String>, String> {
    let fail = || format!("expected labels such as A to N or 1 to 10, found {first} to {last}");
    if first == last {
        return Ok(vec![if first == "_" { String::new() } else { first.to_string() }]);
    }
    let (from, to, letters) = match (first.parse::<usize>(), last.parse::<usize>()) {
        (Ok(from), Ok(to)) => (from, to, false),
        _ => (letters_value(first).ok_or_else(fail)?, letters_value(last).ok_or_else(fail)?, true),
    };
    if from > to || to - from >= MOST_PATCHES {
        return Err(fail());
    }
    Ok((from..=to).map(|value| if letters { letters_of(value) } else { value.to_string() }).collect())
}

/// A = 1 … Z = 26, AA = 27; at most three letters.
fn letters_value(text: &str) -> Option<usize> {
    let letters = (1..=3).contains(&text.len()) && text.bytes().all(|byte| byte.is_ascii_uppercase());
    letters.then(|| text.bytes().fold(0, |value, byte| 26 * value + usize::from(byte - b'A') + 1))
}

fn letters_of(mut value: usize) -> String {
    let mut letters = String::new();
    while value > 0 {
        value -= 1;
        letters.insert(0, char::from(b'A' + (value % 26) as u8));
        value /= 26;
    }
    letters
}

/// Adds an array of boxes; tells whether they go to the right and down, row by row. Names are the x label and then the y label for
/// `X` arrays, the other way round for `Y`.
fn add_boxes(patches: &mut Vec<Patch>, x_first: bool, names: &[Vec<String>; 2], rest: &[&str]) -> Result<bool, String> {
    let [width, height, left, top, step_x, step_y] = numbers::<6>(rest)?;
    if !(width > 0.0 && height > 0.0) {
        return Err(format!("expected boxes of a width and a height above 0, found {width} × {height}"));
    }
    let [columns, rows] = names;
    if columns.len() * rows.len() + patches.len() > MOST_PATCHES {
        return Err(format!("more than {MOST_PATCHES} patches"));
    }
    for (row, y_name) in rows.iter().enumerate() {
        for (column, x_name) in columns.iter().enumerate() {
            let (x, y) = (left + column as f64 * step_x, top + row as f64 * step_y);
            let name = if x_first { format!("{x_name}{y_name}") } else { format!("{y_name}{x_name}") };
            let rectangle = [x, y, x + width, y + height];
            // Far out a small width is lost in the digits of its place.
            if !(x < x + width && y < y + height) {
                return Err(format!("a box of {width} × {height} at ({x}, {y}) is too small to be one"));
            }
            patches.push(Patch { name: patch_name(&name), rectangle, margin: MARGIN });
        }
    }
    Ok(columns.len() > 1 && rows.len() > 1 && step_x >= width && step_y >= height)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: &str = "\n\nBOXES 7\n  F _ _ 0 0 40 0 40 30 0 30\n  D ALL ALL _ _ 40 30 0 0 0 0\n  X A C 01 02 8 9 2 3 12 14\n\n\
        BOX_SHRINK 3\n\nXLIST 1\n  2.0 1.0 1.0\n\nEXPECTED LAB 1\n  B02 50 1 -2\n";

    fn parse(text: &str) -> Result<Chart, String> {
        Chart::parse_cht(Path::new("small.cht"), text).map_err(|error| error.to_string())
    }

    #[test]
    fn boxes_marks_and_expected_values_are_read() {
        let chart = parse(SMALL).unwrap();
        assert_eq!((chart.name(), chart.grid()), ("small", Some([3, 2])));
        assert_eq!(chart.corners()[2], [40.0, 30.0]);
        assert_eq!(chart.corners_in_words(), "the fiducial marks");
        let names: Vec<&str> = chart.patches().iter().map(|patch| patch.name.as_str()).collect();
        assert_eq!(names, ["A1", "B1", "C1", "A2", "B2", "C2"]);
        assert_eq!(chart.patches()[4].rectangle, [14.0, 17.0, 22.0, 26.0]);
        assert_eq!(chart.patches()[4].margin, 3.0 / 8.0);
    }

    #[test]
    fn y_arrays_put_the_row_first_and_charts_without_marks_have_their_outer_corners() {
        let chart = parse("BOXES 24\nY 1 6 A D 46 46 12 11.5 52.5 52.5\n").unwrap();
        assert_eq!((chart.patches()[0].name.as_str(), chart.patches()[7].name.as_str()), ("A1", "B2"));
        assert_eq!((chart.corners()[0], chart.corners()[2]), ([12.0, 11.5], [320.5, 215.0]));
        assert_eq!(chart.corners_in_words(), "the outer corners of the four corner patches");
    }

    #[test]
    fn labels_count_on_in_letters_and_numbers() {
        assert_eq!(labels("Y", "AB").unwrap(), ["Y", "Z", "AA", "AB"]);
        assert_eq!(labels("09", "11").unwrap(), ["9", "10", "11"]);
        assert_eq!(labels("_", "_").unwrap(), [""]);
        assert!(labels("C", "A").is_err() && labels("1", "99999999").is_err() && labels("A", "7").is_err());
    }

    #[test]
    fn what_cannot_be_says_where() {
        for (text, reason) in [
            ("", "small.cht: no patches"),
            ("X A C 1 2 8 9 2 3 12\n", "small.cht:1: expected 6 numbers"),
            ("\nX A C 1 2 -8 9 2 3 12 14\n", "small.cht:2: expected boxes"),
            ("X A B 1 2 8 9 2 3 12 nan\n", "small.cht:1: expected 6 numbers"),
            ("F _ _ 1 2 3\n", "small.cht:1: expected 8 numbers"),
            ("X A ZZZ 1 99 8 9 2 3 12 14\n", "small.cht:1:"),
            ("X A B 1 2 8 9 2 3 12 14\nX A B 1 2 8 9 2 3 12 14\n", "two patches are called A1"),
            ("X A B 1 2 8 9 2 3 12 14\nEXPECTED RGB 3\n", "small.cht:2: expected XYZ or LAB"),
            ("X A B 1 2 8 9 2 3 12 14\nEXPECTED XYZ 2\nA1 1 2 3\nA1 1 2 3\n", "small.cht:4: A1 comes twice"),
            ("X A B 1 2 8 9 2 3 12 14\nEXPECTED XYZ 2\nA1 1 2 3\n", "small.cht: expected 1 more values after EXPECTED"),
            ("X A B 1 2 1e-160 9 2 3 12 14\n", "small.cht:1: a box of"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.contains(reason), "{text:?}: {error}");
        }
    }
}

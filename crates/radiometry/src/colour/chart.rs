//! Charts: which patches they have, where these lie, and between which four corners.
//!
//! Built in are the layouts of the ColorChecker 24 (6 × 4), Digital SG (14 × 10) and DC (20 × 12), as plain grids; other
//! charts, and finer geometry, come from a `.cht` file of ArgyllCMS ([`Chart::read`]).

use super::table::Table;

/// One patch of a chart.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// Letters and a number without leading zeros: `A1`, `SAT3`.
    pub name: String,
    /// Left, top, right and bottom in the chart's own coordinates, x to the right, y down.
    pub rectangle: [f64; 4],
    /// The share of width and height on each side that is not looked at, below ½.
    pub margin: f64,
}

/// A chart: its patches and the four corners it is placed by.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    pub(super) name: String,
    pub(super) patches: Vec<Patch>,
    pub(super) corners: [[f64; 2]; 4],
    pub(super) grid: Option<[usize; 2]>,
    pub(super) fiducials: bool,
    pub(super) expected: Option<Table>,
}

/// Of a patch's width and height, what is left out on each side of those of the built-in charts, and at least of those of others.
pub(super) const MARGIN: f64 = 0.22;

impl Chart {
    /// ColorChecker (24 patches): rows A to D of six, A1 dark skin, D1 white, D6 black. A patch is 0.885 of their distance.
    pub fn colorchecker_24() -> Self {
        let name = |column: usize, row: usize| format!("{}{}", letter(row), column + 1);
        Self::of_grid("ColorChecker 24", [6, 4], 0.885, name)
    }

    /// ColorChecker Digital SG (140 patches): columns A to N, rows 1 to 10. A patch is 0.77 of their distance, as
    /// photographs show it.
    pub fn colorchecker_sg() -> Self {
        let name = |column: usize, row: usize| format!("{}{}", letter(column), row + 1);
        Self::of_grid("ColorChecker SG", [14, 10], 0.77, name)
    }

    /// ColorChecker DC (240 patches, the paper's chart): columns A to T, rows 1 to 12. A patch is 0.835 of their distance.
    pub fn colorchecker_dc() -> Self {
        let name = |column: usize, row: usize| format!("{}{}", letter(column), row + 1);
        Self::of_grid("ColorChecker DC", [20, 12], 0.835, name)
    }

    fn of_grid(name: &str, [columns, rows]: [usize; 2], filled: f64, patch: impl Fn(usize, usize) -> String) -> Self {
        let half = 0.5 * filled;
        let patches = (0..columns * rows)
            .map(|index| {
                let (column, row) = (index % columns, index / columns);
                let (x, y) = (column as f64 + 0.5, row as f64 + 0.5);
                let rectangle = [x - half, y - half, x + half, y + half];
                Patch { name: patch(column, row), rectangle, margin: MARGIN }
            })
            .collect();
        let (left, right, bottom) = (0.5 - half, columns as f64 - 0.5 + half, rows as f64 - 0.5 + half);
        Self {
            name: name.into(),
            patches,
            corners: [[left, left], [right, left], [right, bottom], [left, bottom]],
            grid: Some([columns, rows]),
            fiducials: false,
            expected: None,
        }
    }

    /// What the chart is called.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its patches; those of a grid row by row.
    pub fn patches(&self) -> &[Patch] {
        &self.patches
    }

    /// The four points the chart is placed by, in its own coordinates: top left, top right, bottom right, bottom left, as the chart
    /// stands when its names can be read.
    pub fn corners(&self) -> [[f64; 2]; 4] {
        self.corners
    }

    /// What these four points are: the fiducial marks of a `.cht` file, or else the outer corners of the four outermost patches.
    pub fn corners_in_words(&self) -> &'static str {
        if self.fiducials { "the fiducial marks" } else { "the outer corners of the four corner patches" }
    }

    /// Columns and rows, if the chart is one regular grid; only such charts can be found without corners.
    pub fn grid(&self) -> Option<[usize; 2]> {
        self.grid
    }
}

/// A, B, C …
fn letter(index: usize) -> char {
    char::from(b'A' + index as u8)
}

/// The name of a patch as charts and tables agree on it: letters in capitals, the number without leading zeros. Argyll writes
/// `A01` in one file and `A1` in another.
pub(super) fn patch_name(text: &str) -> String {
    let digits = text.len() - text.trim_start_matches(|letter: char| !letter.is_ascii_digit()).len();
    let (letters, number) = text.split_at(digits);
    let trimmed = number.trim_start_matches('0');
    let number = if trimmed.is_empty() && !number.is_empty() { "0" } else { trimmed };
    letters.to_uppercase() + number
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_agree_whatever_their_zeros() {
        for (written, name) in
            [("A01", "A1"), ("a1", "A1"), ("A10", "A10"), ("SAT08", "SAT8"), ("B00", "B0"), ("1", "1")]
        {
            assert_eq!(patch_name(written), name);
        }
        assert_eq!(patch_name(""), "");
        assert_eq!(patch_name("weiß"), "WEISS");
    }

    #[test]
    fn the_built_in_charts_have_the_patches_that_are_printed_on_them() {
        for (chart, count, last) in [
            (Chart::colorchecker_24(), 24, "D6"),
            (Chart::colorchecker_sg(), 140, "N10"),
            (Chart::colorchecker_dc(), 240, "T12"),
        ] {
            assert_eq!((chart.patches.len(), chart.patches[0].name.as_str()), (count, "A1"));
            assert_eq!(chart.patches[count - 1].name, last);
            let [left, top, ..] = chart.patches[0].rectangle;
            let [.., right, bottom] = chart.patches[count - 1].rectangle;
            assert_eq!((chart.corners[0], chart.corners[2]), ([left, top], [right, bottom]));
        }
    }
}

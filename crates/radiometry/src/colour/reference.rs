//! Reference values: which colour each patch has.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;
use std::str::FromStr;

use super::ColourError;
use super::chart::Chart;
use super::space::{
    A, C, D50, D65, Lab, Xyz, adaptation, chroma, lab_from_xyz, rec709_from_xyz, transform, xyz_from_lab,
};
use super::table::{Space, Table, read_table_text};

/// The light that reference values are for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Illuminant {
    /// D50, what chart makers and ICC profiles use.
    #[default]
    D50,
    /// D65.
    D65,
    /// C.
    C,
    /// A.
    A,
    /// The colour of the lightest patch is taken for the light's: for tables measured under another light that they do not name.
    LightestPatch,
}

impl Illuminant {
    const NAMES: [(&'static str, Self); 5] = [
        ("D50", Self::D50),
        ("D65", Self::D65),
        ("C", Self::C),
        ("A", Self::A),
        ("lightest-patch", Self::LightestPatch),
    ];
}

impl fmt::Display for Illuminant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Self::NAMES.iter().find(|(_, illuminant)| illuminant == self).map_or("", |(name, _)| name);
        f.write_str(name)
    }
}

impl FromStr for Illuminant {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::NAMES.iter().find(|(name, _)| name.eq_ignore_ascii_case(text));
        let known = || Self::NAMES.map(|(name, _)| name).join(", ");
        found.map(|(_, illuminant)| *illuminant).ok_or_else(|| format!("expected one of {}, found \"{text}\"", known()))
    }
}

/// The colours of a chart's patches, adapted to D50 (Bradford).
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    name: String,
    values: BTreeMap<String, Xyz>,
}

impl Reference {
    /// ColorChecker 24 as its maker publishes it for charts made before November 2014: L\*a\*b\*, D50, 2° (X-Rite, "Colorimetric values
    /// for ColorChecker family of targets").
    pub fn colorchecker_24() -> Self {
        #[rustfmt::skip]
        const VALUES: [[f64; 3]; 24] = [
            [37.986, 13.555, 14.059], [65.711, 18.130, 17.810], [49.927, -4.880, -21.925],
            [43.139, -13.095, 21.905], [55.112, 8.844, -25.399], [70.719, -33.397, -0.199],
            [62.661, 36.067, 57.096], [40.020, 10.410, -45.964], [51.124, 48.239, 16.248],
            [30.325, 22.976, -21.587], [72.532, -23.709, 57.255], [71.941, 19.363, 67.857],
            [28.778, 14.179, -50.297], [55.261, -38.342, 31.370], [42.101, 53.378, 28.190],
            [81.733, 4.039, 79.819], [51.935, 49.986, -14.574], [51.038, -28.631, -28.638],
            [96.539, -0.425, 1.186], [81.257, -0.638, -0.335], [66.766, -0.734, -0.504],
            [50.867, -0.153, -0.270], [35.656, -0.421, -1.231], [20.461, -0.079, -0.973],
        ];
        let chart = Chart::colorchecker_24();
        let named = chart.patches().iter().zip(VALUES).map(|(patch, lab)| (patch.name.clone(), xyz_from_lab(lab, D50)));
        Self { name: "ColorChecker 24, before November 2014 (X-Rite)".into(), values: named.collect() }
    }

    /// Reads a table (CGATS: `.cie`, `.ti2`, `.ti3`), or the values that a `.cht` file expects.
    ///
    /// # Errors
    /// If the file cannot be read, or as [`Reference::parse`].
    pub fn read(path: &Path, illuminant: Illuminant) -> Result<Self, ColourError> {
        Self::parse(path, &read_table_text(path)?, illuminant)
    }

    /// Reads the text of such a file; `path` is for messages.
    ///
    /// # Errors
    /// If it is neither a table with XYZ or L\*a\*b\* nor a chart with expected values, or its lightest patch cannot be white.
    pub fn parse(path: &Path, text: &str, illuminant: Illuminant) -> Result<Self, ColourError> {
        let is_chart = text.lines().any(|line| matches!(line.split_whitespace().next(), Some("BOXES" | "EXPECTED")));
        let table = if is_chart {
            let chart = Chart::parse_cht(path, text)?;
            chart
                .expected
                .ok_or_else(|| ColourError::content(path, "this chart has no values: expected a line EXPECTED"))?
        } else {
            Table::parse(path, text)?
        };
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        Self::of_table(name, &table, illuminant).map_err(|reason| ColourError::content(path, reason))
    }

    /// The values that a chart's own file expects, if it has any.
    ///
    /// # Errors
    /// If its lightest patch is to be white and cannot be.
    pub fn of_chart(chart: &Chart, illuminant: Illuminant) -> Result<Option<Self>, ColourError> {
        let Some(table) = &chart.expected else { return Ok(None) };
        let name = format!("expected values of {}", chart.name());
        Self::of_table(name, table, illuminant).map(Some).map_err(ColourError::Patches)
    }

    fn of_table(name: String, table: &Table, illuminant: Illuminant) -> Result<Self, String> {
        let white = match illuminant {
            Illuminant::D50 => D50,
            Illuminant::D65 => D65,
            Illuminant::C => C,
            Illuminant::A => A,
            Illuminant::LightestPatch => lightest(table)?,
        };
        let to_d50 = adaptation(white, D50);
        let xyz = |values: [f64; 3]| match table.space {
            Space::Xyz => values.map(|value| value / 100.0),
            Space::Lab => xyz_from_lab(values, white),
        };
        let values =
            table.values.iter().map(|(name, values)| (name.clone(), transform(&to_d50, xyz(*values)))).collect();
        Ok(Self { name, values })
    }

    /// Where the values are from.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// How many patches have a value.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Whether no patch has one.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// XYZ of a patch under D50, Y = 1 for the perfect diffuser.
    pub fn xyz(&self, patch: &str) -> Option<Xyz> {
        self.values.get(patch).copied()
    }

    /// L\*a\*b\* of a patch, D50.
    pub fn lab(&self, patch: &str) -> Option<Lab> {
        self.xyz(patch).map(|xyz| lab_from_xyz(xyz, D50))
    }

    /// Linear Rec. 709 of a patch, adapted to D65.
    pub fn rec709(&self, patch: &str) -> Option<[f64; 3]> {
        self.xyz(patch).map(rec709_of_d50)
    }

    /// The lightest patch and its chroma C*: far from 0 if the values are for another light than was said.
    pub fn lightest(&self) -> Option<(&str, f64)> {
        let lightest = self.values.iter().max_by(|a, b| a.1[1].total_cmp(&b.1[1]));
        lightest.map(|(name, xyz)| (name.as_str(), chroma(lab_from_xyz(*xyz, D50))))
    }
}

/// The chromaticity of the patch with the largest Y, at Y = 1.
fn lightest(table: &Table) -> Result<Xyz, String> {
    if table.space == Space::Lab {
        return Err("L*a*b* is relative to a white already: name the illuminant instead of the lightest patch".into());
    }
    let lightest = table.values.values().copied().max_by(|a, b| a[1].total_cmp(&b[1])).unwrap_or_default();
    // Bradford's cones must be positive for it to be a light.
    let white = lightest.map(|value| value / lightest[1]);
    let cones = adaptation(white, white);
    if lightest.iter().all(|value| *value > 0.0) && cones.iter().flatten().all(|value| value.is_finite()) {
        Ok(white)
    } else {
        Err(format!("the lightest patch has XYZ {lightest:?} and cannot be white"))
    }
}

/// Linear Rec. 709 (D65) of XYZ under D50.
pub(super) fn rec709_of_d50(xyz: Xyz) -> [f64; 3] {
    rec709_from_xyz(transform(&adaptation(D50, D65), xyz))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_values_are_those_of_well_known_patches() {
        let reference = Reference::colorchecker_24();
        assert_eq!(reference.len(), 24);
        let lab = reference.lab("D6").unwrap();
        assert!((lab[0] - 20.461).abs() < 1e-9 && (lab[2] + 0.973).abs() < 1e-9);
        // Neutral 5 reflects 19.2 %, and blue is the only patch out of the gamut of Rec. 709 by its red, cyan another.
        assert!((reference.xyz("D4").unwrap()[1] - 0.1915).abs() < 1e-3);
        assert!(reference.rec709("C6").unwrap()[0] < 0.0);
        assert!(reference.lightest().unwrap().0 == "D1" && reference.lightest().unwrap().1 < 2.0);
    }

    #[test]
    fn values_for_another_light_are_adapted() {
        let table = "BEGIN_DATA_FORMAT\nSAMPLE_ID XYZ_X XYZ_Y XYZ_Z\nEND_DATA_FORMAT\nBEGIN_DATA\nA1 85.5 90 98\nA2 19 20 21.78\nEND_DATA\n";
        let parse = |illuminant| Reference::parse(Path::new("t.cie"), table, illuminant).unwrap();
        assert!(parse(Illuminant::D50).lightest().unwrap().1 > 15.0);
        assert!(parse(Illuminant::D65).lightest().unwrap().1 < 1.0);
        assert!(parse(Illuminant::LightestPatch).lightest().unwrap().1 < 1e-9);
        let black = table.replace("85.5 90 98", "0 0 0").replace("19 20 21.78", "-1 0 0");
        let error = Reference::parse(Path::new("t.cie"), &black, Illuminant::LightestPatch).unwrap_err();
        assert!(error.to_string().contains("cannot be white"), "{error}");
    }

    #[test]
    fn illuminants_go_by_name() {
        for (name, illuminant) in Illuminant::NAMES {
            assert_eq!(name.parse::<Illuminant>().unwrap(), illuminant);
            assert_eq!(illuminant.to_string(), name);
        }
        assert!("D55".parse::<Illuminant>().unwrap_err().contains("D65"));
    }
}

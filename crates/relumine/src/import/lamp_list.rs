//! Lists of photographs with the direction of the lamp of each: RTI `.lp`, `DiLiGenT` folders, CSV.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use relumine_basis::Position;
use relumine_capture::csv_fields;
use relumine_radiometry::read_text;

use crate::Error;

/// A photograph under one distant lamp.
#[derive(Clone, Debug, PartialEq)]
pub struct LampPhotograph {
    /// The picture file.
    pub file: PathBuf,
    /// Where the lamp stands.
    pub position: Position,
    /// Irradiance Eᵢ of the lamp, RGB, W·m⁻²; 1 if unknown.
    pub irradiance: [f64; 3],
}

/// All photographs of one object.
#[derive(Clone, Debug, PartialEq)]
pub struct LampList {
    /// The list or folder it was read from.
    pub path: PathBuf,
    /// The name of the folder.
    pub title: Option<String>,
    /// The photographs, in the order of the list.
    pub lamps: Vec<LampPhotograph>,
    /// What a person should know.
    pub remarks: Vec<String>,
}

/// Lamps this far below the horizon are lifted to it: the directions of hand-measured sets are not better.
const LIFTED_DEG: f64 = 3.0;
const MAX_LAMPS: usize = 4096;

impl LampList {
    /// Reads an RTI `.lp` file; a `.csv` with the header `file,x,y,z` or `file,azimuth_deg,tilt_deg`, each with or without
    /// a last column `irradiance`; a folder with `light_directions.txt` and `filenames.txt` (`DiLiGenT`), optionally
    /// `light_intensities.txt`; or a folder with one `.lp` file.
    ///
    /// # Errors
    /// If it cannot be read, or a line is wrong.
    pub fn read(source: &Path) -> Result<Self, Error> {
        if source.is_dir() {
            return Self::read_folder(source);
        }
        let text = read(source)?;
        if source.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv")) {
            Self::parse_csv(source, &text)
        } else {
            Self::parse_lp(source, &text)
        }
    }

    fn read_folder(folder: &Path) -> Result<Self, Error> {
        let directions = folder.join("light_directions.txt");
        if directions.exists() {
            let names = read(&folder.join("filenames.txt"))?;
            let intensities = folder.join("light_intensities.txt");
            let intensities = if intensities.exists() { Some(read(&intensities)?) } else { None };
            return Self::parse_diligent(folder, &read(&directions)?, &names, intensities.as_deref());
        }
        let wrong = |reason: String| Error::LampList { path: folder.to_path_buf(), reason };
        let mut lists: Vec<PathBuf> = std::fs::read_dir(folder)
            .map_err(|error| wrong(error.to_string()))?
            .filter_map(|entry| entry.ok().map(|entry| entry.path()))
            .filter(|path| path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("lp")))
            .collect();
        lists.sort();
        match lists.as_slice() {
            [list] => Self::parse_lp(list, &read(list)?),
            [] => Err(wrong("expected light_directions.txt and filenames.txt, or one .lp file in the folder".into())),
            many => Err(wrong(format!("{} .lp files in the folder: name one of them", many.len()))),
        }
    }

    /// An RTI light position file: the number of photographs, then `name x y z` a line.
    ///
    /// # Errors
    /// With the line that is wrong.
    pub fn parse_lp(path: &Path, text: &str) -> Result<Self, Error> {
        let mut list = Building::new(path);
        let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
        let announced = lines.next().map(|(_, line)| line.trim().trim_start_matches('\u{feff}')).unwrap_or_default();
        let announced: usize = announced
            .parse()
            .map_err(|_| list.error(1, format!("expected the number of photographs, found \"{announced}\"")))?;
        for (index, line) in lines {
            // Names may have blanks in them: the direction is the last three words.
            let mut name = line.trim();
            let mut word = || -> Option<&str> {
                let (rest, word) = name.rsplit_once(char::is_whitespace)?;
                name = rest.trim_end();
                Some(word)
            };
            let [Some(z), Some(y), Some(x)] = [word(), word(), word()] else {
                return Err(list.error(index + 1, format!("expected \"name x y z\", found \"{}\"", line.trim())));
            };
            let direction = list.numbers(index + 1, &[x, y, z])?;
            list.push(index + 1, name, [direction[0], direction[1], direction[2]], [1.0; 3])?;
        }
        if list.lamps.len() != announced {
            let found = list.lamps.len();
            return Err(list.error(1, format!("{announced} photographs are announced, but {found} are listed")));
        }
        list.finish()
    }

    /// A CSV table of photographs and directions; see [`LampList::read`].
    ///
    /// # Errors
    /// With the line that is wrong.
    pub fn parse_csv(path: &Path, text: &str) -> Result<Self, Error> {
        let mut list = Building::new(path);
        let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
        let header = lines.next().map(|(_, line)| csv_fields(line).unwrap_or_default()).unwrap_or_default();
        let names: Vec<&str> = header.iter().map(String::as_str).collect();
        let (angles, irradiance) = match names.as_slice() {
            ["file", "x", "y", "z"] => (false, false),
            ["file", "x", "y", "z", "irradiance"] => (false, true),
            ["file", "azimuth_deg", "tilt_deg"] => (true, false),
            ["file", "azimuth_deg", "tilt_deg", "irradiance"] => (true, true),
            other => {
                let expected = "file,x,y,z or file,azimuth_deg,tilt_deg, each with or without ,irradiance";
                return Err(list.error(1, format!("expected the header {expected}; found \"{}\"", other.join(","))));
            }
        };
        for (index, line) in lines {
            let fields = csv_fields(line).map_err(|reason| list.error(index + 1, reason))?;
            let fields: Vec<&str> = fields.iter().map(String::as_str).collect();
            if fields.len() != header.len() {
                let reason = format!("expected {} fields, found {}", header.len(), fields.len());
                return Err(list.error(index + 1, reason));
            }
            let numbers = list.numbers(index + 1, &fields[1..])?;
            let direction = if angles {
                Position::from_degrees(numbers[0], numbers[1]).direction().to_array()
            } else {
                [numbers[0], numbers[1], numbers[2]]
            };
            let irradiance = if irradiance { numbers[numbers.len() - 1] } else { 1.0 };
            list.push(index + 1, fields[0], direction, [irradiance; 3])?;
        }
        list.finish()
    }

    /// A `DiLiGenT` folder: directions `x y z` and names line by line, and perhaps intensities `r g b`.
    ///
    /// # Errors
    /// With the line that is wrong.
    pub fn parse_diligent(
        folder: &Path,
        directions: &str,
        names: &str,
        intensities: Option<&str>,
    ) -> Result<Self, Error> {
        let mut list = Building::new(&folder.join("light_directions.txt"));
        let lines = |text: &str| -> Vec<String> {
            text.lines().map(|line| line.trim().to_string()).filter(|line| !line.is_empty()).collect()
        };
        let (directions, names) = (lines(directions), lines(names));
        let intensities = intensities.map(lines);
        for (other, count) in
            [("filenames.txt", Some(names.len())), ("light_intensities.txt", intensities.as_ref().map(Vec::len))]
        {
            if let Some(count) = count.filter(|count| *count != directions.len()) {
                let found = directions.len();
                return Err(
                    list.error(found.min(count) + 1, format!("{found} directions, but {count} lines in {other}"))
                );
            }
        }
        for (index, (direction, name)) in directions.iter().zip(&names).enumerate() {
            let triple = |text: &str| -> Result<[f64; 3], Error> {
                let words: Vec<&str> = text.split_whitespace().collect();
                let numbers = list.numbers(index + 1, &words)?;
                numbers
                    .try_into()
                    .map_err(|_| list.error(index + 1, format!("expected three numbers, found \"{text}\"")))
            };
            let irradiance = match &intensities {
                Some(intensities) => triple(&intensities[index])?,
                None => [1.0; 3],
            };
            let direction = triple(direction)?;
            list.push(index + 1, name, direction, irradiance)?;
        }
        list.finish()
    }
}

fn read(path: &Path) -> Result<String, Error> {
    read_text(path).map_err(|error| Error::LampList { path: path.to_path_buf(), reason: error.to_string() })
}

/// A list under construction.
struct Building {
    path: PathBuf,
    folder: PathBuf,
    lamps: Vec<LampPhotograph>,
    lifted: usize,
    lines: HashMap<[i64; 3], usize>,
}

impl Building {
    fn new(path: &Path) -> Self {
        let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
        Self { path: path.to_path_buf(), folder, lamps: Vec::new(), lifted: 0, lines: HashMap::new() }
    }

    fn error(&self, line: usize, reason: String) -> Error {
        Error::LampList { path: self.path.clone(), reason: format!("line {line}: {reason}") }
    }

    fn numbers(&self, line: usize, words: &[&str]) -> Result<Vec<f64>, Error> {
        words
            .iter()
            .map(|word| match word.parse::<f64>() {
                Ok(number) if number.is_finite() => Ok(number),
                _ => Err(self.error(line, format!("expected a number, found \"{word}\""))),
            })
            .collect()
    }

    fn push(&mut self, line: usize, name: &str, direction: [f64; 3], irradiance: [f64; 3]) -> Result<(), Error> {
        if self.lamps.len() == MAX_LAMPS {
            return Err(self.error(line, format!("more than {MAX_LAMPS} lamps")));
        }
        let [x, y, z] = direction;
        let length = x.hypot(y).hypot(z);
        if !(length > 1e-6 && length.is_finite()) {
            return Err(self.error(line, format!("a direction of length {length} points nowhere")));
        }
        if irradiance.iter().any(|component| component.is_nan() || *component <= 0.0) {
            return Err(self.error(line, format!("irradiance must be above 0, found {irradiance:?}")));
        }
        // Two lamps at one place share nothing but the place: which photograph should it be?
        let key = direction.map(|component| (component / length * 1e6).round() as i64);
        if let Some(other) = self.lines.insert(key, line) {
            return Err(self.error(line, format!("the same direction as line {other}")));
        }
        let below_deg = -(z / length).asin().to_degrees();
        if below_deg > LIFTED_DEG {
            return Err(self.error(line, format!("the lamp stands {below_deg:.1}° below the horizon (z must be ≥ 0)")));
        }
        let mut position = Position::from_direction(direction.into());
        if below_deg > 0.0 {
            position.tilt = std::f64::consts::FRAC_PI_2;
            self.lifted += 1;
        }
        self.lamps.push(LampPhotograph { file: self.folder.join(name), position, irradiance });
        Ok(())
    }

    fn finish(self) -> Result<LampList, Error> {
        if self.lamps.is_empty() {
            return Err(self.error(1, "no photograph is listed".into()));
        }
        let mut remarks = Vec::new();
        if self.lifted > 0 {
            remarks.push(format!("{} lamps a little below the horizon were lifted to it", self.lifted));
        }
        let title = self.folder.file_name().map(|name| name.to_string_lossy().into_owned());
        Ok(LampList { path: self.path, title, lamps: self.lamps, remarks })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lp(text: &str) -> Result<LampList, String> {
        LampList::parse_lp(Path::new("dome/dirs.lp"), text).map_err(|error| error.to_string())
    }

    #[test]
    fn names_are_relative_to_the_list_and_directions_need_not_be_unit() {
        let list = lp("2\njpg/a b.jpg  0\t0  0.8\njpg/c.jpg 0.5 0.5 0.1\n").unwrap();
        assert_eq!(list.lamps[0].file, Path::new("dome/jpg/a b.jpg"));
        assert_eq!(list.lamps[0].position.tilt, 0.0);
        assert!((list.lamps[1].position.azimuth.to_degrees() - 45.0).abs() < 1e-9);
    }

    #[test]
    fn a_wrong_line_is_named() {
        for (text, reason) in [
            ("", "line 1: expected the number of photographs"),
            ("x\n", "line 1: expected the number of photographs"),
            ("2\na.jpg 0 0 1\n", "2 photographs are announced, but 1 are listed"),
            ("1\na.jpg 0 0\n", "line 2: expected \"name x y z\""),
            ("1\na.jpg 0 0 nan\n", "line 2: expected a number, found \"nan\""),
            ("1\na.jpg 0 0 0\n", "points nowhere"),
            ("1\na.jpg 0 1 -1\n", "45.0° below the horizon"),
            ("2\na.jpg 0 0 1\nb.jpg 0 0 2\n", "line 3: the same direction as line 2"),
            ("99999999999999999999\n", "expected the number"),
        ] {
            let error = lp(text).unwrap_err();
            assert!(error.contains(reason), "{text:?}: {error}");
        }
    }

    #[test]
    fn the_three_kinds_of_list_say_the_same() {
        let from_lp = lp("2\na.jpg 1 0 1\nb.jpg 0 1 1\n").unwrap().lamps;
        let path = Path::new("dome/dirs.csv");
        let xyz = LampList::parse_csv(path, "file,x,y,z\n\"a.jpg\",1,0,1\nb.jpg,0,1,1\n").unwrap().lamps;
        assert_eq!(xyz, from_lp);
        let angles = "file,azimuth_deg,tilt_deg,irradiance\na.jpg,0,45,2\nb.jpg,90,45,2\n";
        let angles = LampList::parse_csv(path, angles).unwrap().lamps;
        let folder = Path::new("dome");
        let diligent =
            LampList::parse_diligent(folder, "1 0 1\n0 1 1\n", "a.jpg\nb.jpg\n", Some("2 2 2\n2 2 2\n")).unwrap().lamps;
        for (a, b) in angles.iter().zip(&diligent) {
            assert_eq!((&a.file, a.irradiance), (&b.file, b.irradiance));
            assert!(a.position.direction().distance(b.position.direction()) < 1e-12);
        }
        assert!(LampList::parse_diligent(folder, "1 0 1\n", "a\nb\n", None).is_err());
    }
}

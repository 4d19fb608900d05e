//! The projector's response: how much light it gives for a grey level, from photographs of a ramp of levels.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::ProjectorError;

/// One line of a list of levels.
#[derive(Clone, Debug, PartialEq)]
pub struct RampEntry {
    /// The photograph, as the list says it.
    pub file: PathBuf,
    /// The grey level that was shown.
    pub level: f64,
}

impl RampEntry {
    /// Longer lists are refused.
    const MOST_LEVELS: usize = 65_536;

    /// Reads a list with a line `file level` for each photograph; the last word of a line is the level, `#` begins a comment.
    ///
    /// # Errors
    /// If a line has no level that is a number from 0, a level comes twice, or there are fewer than two.
    pub fn parse_list(path: &Path, text: &str) -> Result<Vec<Self>, ProjectorError> {
        let fail =
            |line: usize, reason: String| ProjectorError::List { path: path.display().to_string(), line, reason };
        let mut entries: Vec<Self> = Vec::new();
        let mut levels = BTreeSet::new();
        for (index, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
            let said = line.split('#').next().unwrap_or_default().trim();
            if said.is_empty() {
                continue;
            }
            let wrong = || fail(index + 1, format!("expected a photograph and its level, found \"{said}\""));
            let (file, level) = said.rsplit_once(char::is_whitespace).ok_or_else(wrong)?;
            let level = level.parse::<f64>().ok().filter(|level| (0.0..=1e9).contains(level)).ok_or_else(wrong)?;
            // Minus zero is zero.
            if !levels.insert((level + 0.0).to_bits()) {
                return Err(fail(index + 1, format!("level {level} comes twice")));
            }
            if entries.len() == Self::MOST_LEVELS {
                return Err(fail(index + 1, format!("expected at most {} levels", Self::MOST_LEVELS)));
            }
            entries.push(Self { file: file.trim().into(), level });
        }
        if entries.len() < 2 {
            return Err(fail(1, format!("expected at least two levels, found {}", entries.len())));
        }
        entries.sort_by(|a, b| a.level.total_cmp(&b.level));
        Ok(entries)
    }
}

/// What the projector makes of grey levels.
#[derive(Clone, Debug, PartialEq)]
pub struct LevelRamp {
    /// Level over the highest level, and light over the highest level's, per channel; level by level.
    pub rows: Vec<(f64, [f64; 3])>,
    /// Light of the highest level over that of the lowest, per channel: the contrast, if the lowest is black.
    pub contrast: [f64; 3],
    /// Levels at which a channel gives less light than at the level before.
    pub falls: Vec<f64>,
}

impl LevelRamp {
    /// The header of [`LevelRamp::csv`].
    pub const HEADER: &'static str = "level,red,green,blue";

    /// From levels, rising, and the mean radiance that was photographed under each.
    ///
    /// # Errors
    /// If there are fewer than two, levels do not rise, or the highest or the lowest level gives no light.
    pub fn from_means(means: &[(f64, [f64; 3])]) -> Result<Self, ProjectorError> {
        let fail = |reason: &str| Err(ProjectorError::Photograph(reason.into()));
        let [first, .., last] = means else { return fail("a ramp needs at least two levels") };
        if !means.is_sorted_by(|a, b| a.0 < b.0) || last.0 <= 0.0 {
            return fail("the levels of a ramp must rise");
        }
        if last.1.iter().chain(&first.1).any(|light| *light <= 0.0) {
            return fail("the highest or the lowest level shows no light: expose longer");
        }
        let relative = |light: [f64; 3]| [0, 1, 2].map(|channel| light[channel] / last.1[channel]);
        let falls = means.windows(2).filter(|pair| (0..3).any(|channel| pair[1].1[channel] < pair[0].1[channel]));
        Ok(Self {
            rows: means.iter().map(|(level, light)| (level / last.0, relative(*light))).collect(),
            contrast: [0, 1, 2].map(|channel| last.1[channel] / first.1[channel]),
            falls: falls.map(|pair| pair[1].0).collect(),
        })
    }

    /// The table as text: a header, then a line for each level.
    pub fn csv(&self) -> String {
        let line = |(level, [r, g, b]): &(f64, [f64; 3])| format!("{level:.6},{r:.6},{g:.6},{b:.6}\n");
        format!("{}\n{}", Self::HEADER, self.rows.iter().map(line).collect::<String>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_gives_back_the_gamma_and_the_contrast() {
        // A projector of gamma 2.2 whose black is 1/400 of its white.
        let light = |level: f64| 1.0 / 400.0 + (1.0 - 1.0 / 400.0) * (level / 255.0).powf(2.2);
        let means: Vec<(f64, [f64; 3])> = [0.0, 32.0, 64.0, 128.0, 192.0, 255.0]
            .map(|level| (level, [0.3, 0.5, 0.2].map(|colour| colour * light(level))))
            .into();
        let ramp = LevelRamp::from_means(&means).unwrap();
        assert!(ramp.contrast.iter().all(|contrast| (contrast - 400.0).abs() < 1e-6), "{ramp:?}");
        for ((level, found), (shown, _)) in ramp.rows.iter().zip(&means) {
            assert!((level - shown / 255.0).abs() < 1e-12);
            assert!(found.iter().all(|found| (found - light(*shown)).abs() < 1e-12));
        }
        assert!(ramp.falls.is_empty() && ramp.csv().lines().count() == 7);
        let mut falling = means.clone();
        falling[3].1 = [0.0001; 3];
        assert_eq!(LevelRamp::from_means(&falling).unwrap().falls, [128.0]);
        assert!(LevelRamp::from_means(&means[..1]).is_err());
        assert!(LevelRamp::from_means(&[(0.0, [0.0; 3]), (1.0, [1.0; 3])]).is_err());
    }

    #[test]
    fn a_list_says_what_it_says_or_where_it_is_wrong() {
        let parse = |text: &str| RampEntry::parse_list(Path::new("ramp.txt"), text);
        let list = parse("# levels\nb c.png 255\n\na.png\t0 # black\n").unwrap();
        assert_eq!(list[0], RampEntry { file: "a.png".into(), level: 0.0 });
        assert_eq!(list[1], RampEntry { file: "b c.png".into(), level: 255.0 });
        for (text, reason) in [
            ("a.png\n", "ramp.txt:1: expected a photograph and its level"),
            ("a.png 1\nb.png x\n", "ramp.txt:2: expected a photograph and its level"),
            ("a.png 1\nb.png nan\n", "ramp.txt:2"),
            ("a.png 1\nb.png -1\n", "ramp.txt:2"),
            ("a.png 1\nb.png 1\n", "ramp.txt:2: level 1 comes twice"),
            ("a.png 1\n", "at least two levels"),
            ("", "at least two levels"),
        ] {
            let error = parse(text).unwrap_err().to_string();
            assert!(error.contains(reason), "{text}: {error}");
        }
    }
}

//! The order of photographs: position by position, pattern by pattern, shortest exposure first.

use relumine_capture::ShownPattern;
use relumine_radiometry::ExposureSettings;

use crate::Rig;

/// All photographs of a capture in the order in which they are taken. None is held in memory: each follows from its number.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    positions: usize,
    patterns: Vec<ShownPattern>,
    exposures: Vec<ExposureSettings>,
}

/// One photograph that is to be taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Planned {
    /// Where the projector stands.
    pub position: usize,
    /// What it shows.
    pub pattern: ShownPattern,
    /// Which of the exposures, 0 the shortest.
    pub exposure_index: usize,
    /// Shutter, sensitivity, aperture.
    pub exposure: ExposureSettings,
}

impl Plan {
    /// The plan of a rig: at each position black, white if it is wanted, and the patterns of the scheme.
    pub fn of(rig: &Rig) -> Self {
        let cells = rig.setup().cells();
        let mut patterns = vec![ShownPattern::Black];
        patterns.extend(rig.white().then_some(ShownPattern::White));
        patterns.extend(rig.setup().scheme().lighting(cells.squares()));
        Self { positions: cells.positions(), patterns, exposures: rig.exposures().to_vec() }
    }

    /// Number of positions.
    pub fn positions(&self) -> usize {
        self.positions
    }

    /// What is shown at each position, in order.
    pub fn patterns(&self) -> &[ShownPattern] {
        &self.patterns
    }

    /// The exposures of each pattern, shortest first.
    pub fn exposures(&self) -> &[ExposureSettings] {
        &self.exposures
    }

    /// Photographs of one position.
    pub fn per_position(&self) -> usize {
        self.patterns.len() * self.exposures.len()
    }

    /// Photographs in all.
    pub fn len(&self) -> usize {
        self.positions * self.per_position()
    }

    /// Never: there is always a position, and always black.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// The photograph of this number, from 0.
    ///
    /// # Panics
    /// If there are not so many.
    pub fn photograph(&self, number: usize) -> Planned {
        assert!(number < self.len(), "photograph {number} of {}", self.len());
        let exposures = self.exposures.len();
        let exposure_index = number % exposures;
        Planned {
            position: number / self.per_position(),
            pattern: self.patterns[number / exposures % self.patterns.len()],
            exposure_index,
            exposure: self.exposures[exposure_index],
        }
    }

    /// All photographs in order.
    pub fn photographs(&self) -> impl Iterator<Item = Planned> + '_ {
        (0..self.len()).map(|number| self.photograph(number))
    }
}

impl Planned {
    /// The picture's file in the capture directory, without extension: `photographs/p003/row-2-1_e0`.
    pub fn stem(&self) -> String {
        format!("photographs/p{:03}/{}_e{}", self.position, self.pattern, self.exposure_index)
    }
}

//! What a judge finds: which photographs, what was measured, what was expected.

use std::fmt;
use std::path::PathBuf;

use crate::ShownPattern;

/// What is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FindingKind {
    /// More of a pattern is clipped in all its exposures than highlights are. Measured: share of pixels.
    OverExposed,
    /// No exposure of the brightest pattern fills the camera's range. Measured: relative exposure that 1 % of pixels exceed.
    UnderExposed,
    /// The black frame is brighter or darker than the other photographs say. Measured: share of white.
    BlackFrame,
    /// Two photographs stand in each other's place. Measured: share of the contradiction that exchanging them removes.
    Swapped,
    /// A photograph shows no more than the black frame, though the others say that its squares light something. Measured: what it
    /// shows as a share of what they say.
    Blank,
    /// The exposures of one pattern do not show the same. Measured: relative L1 difference.
    Exposures,
    /// Photographs contradict each other, and nothing simpler explains it. Measured: relative L2 contradiction.
    Contradiction,
    /// The camera or the object moved. Measured: pixels.
    CameraMoved,
    /// The lamp became brighter or darker while one position was photographed. Measured: relative change.
    LampDrift,
}

impl FindingKind {
    /// The name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::OverExposed => "over-exposed",
            Self::UnderExposed => "under-exposed",
            Self::BlackFrame => "black-frame",
            Self::Swapped => "swapped",
            Self::Blank => "blank",
            Self::Exposures => "exposures",
            Self::Contradiction => "contradiction",
            Self::CameraMoved => "camera-moved",
            Self::LampDrift => "lamp-drift",
        }
    }

    /// What `measured` and `expected` count.
    pub fn unit(self) -> &'static str {
        match self {
            Self::CameraMoved => "pixels",
            Self::OverExposed => "share of pixels",
            Self::UnderExposed => "share of the camera's range",
            Self::BlackFrame => "share of white",
            Self::Swapped | Self::Blank | Self::Exposures | Self::Contradiction | Self::LampDrift => "1",
        }
    }
}

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// What is developed is less good than it could be.
    Warning,
    /// What is developed is wrong: light lands in the wrong squares, or where there was none.
    Fault,
}

impl Severity {
    /// The name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Warning => "warning",
            Self::Fault => "fault",
        }
    }
}

/// Something wrong with the photographs of one position.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// What.
    pub kind: FindingKind,
    /// How bad.
    pub severity: Severity,
    /// Where the projector stood.
    pub position: usize,
    /// The patterns concerned.
    pub patterns: Vec<ShownPattern>,
    /// The photographs concerned, relative to the capture.
    pub files: Vec<PathBuf>,
    /// What was measured, in the unit of the kind.
    pub measured: f64,
    /// What was expected: the limit, or what the other photographs say.
    pub expected: f64,
    /// All of it in words, without position and files.
    pub text: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "position {}, {}: {}", self.position, self.kind.name(), self.text)?;
        for (index, file) in self.files.iter().enumerate() {
            write!(f, "{}{}", if index == 0 { " (" } else { ", " }, file.display())?;
        }
        if self.files.is_empty() { Ok(()) } else { write!(f, ")") }
    }
}

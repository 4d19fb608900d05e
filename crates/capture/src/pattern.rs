//! What the projector shows: black, white, combs of squares, single squares (§5).

use std::fmt;
use std::str::FromStr;

/// One pattern as `photographs.csv` names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ShownPattern {
    /// Nothing lit: the projector's black still shines.
    Black,
    /// All squares lit.
    White,
    /// `row-V-K`: squares (u, V) for u ≡ K mod spacing.
    Row {
        /// The row.
        v: usize,
        /// The phase of the comb.
        k: usize,
    },
    /// `column-U-K`: squares (U, v) for v ≡ K mod spacing.
    Column {
        /// The column.
        u: usize,
        /// The phase of the comb.
        k: usize,
    },
    /// `square-U-V`: one square.
    Square {
        /// The column.
        u: usize,
        /// The row.
        v: usize,
    },
}

impl fmt::Display for ShownPattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Black => write!(f, "black"),
            Self::White => write!(f, "white"),
            Self::Row { v, k } => write!(f, "row-{v}-{k}"),
            Self::Column { u, k } => write!(f, "column-{u}-{k}"),
            Self::Square { u, v } => write!(f, "square-{u}-{v}"),
        }
    }
}

impl FromStr for ShownPattern {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let fail = || format!("expected black, white, row-V-K, column-U-K or square-U-V as pattern, found \"{text}\"");
        let mut parts = text.split('-');
        let name = parts.next().unwrap_or_default();
        let number = |part: &str| part.bytes().all(|byte| byte.is_ascii_digit()).then(|| part.parse().ok())?;
        let numbers: Vec<usize> = parts.map(number).collect::<Option<_>>().ok_or_else(fail)?;
        match (name, numbers.as_slice()) {
            ("black", []) => Ok(Self::Black),
            ("white", []) => Ok(Self::White),
            ("row", &[v, k]) => Ok(Self::Row { v, k }),
            ("column", &[u, k]) => Ok(Self::Column { u, k }),
            ("square", &[u, v]) => Ok(Self::Square { u, v }),
            _ => Err(fail()),
        }
    }
}

impl ShownPattern {
    /// The squares (u, v) it lights out of M × M, in row-major order; none beyond M.
    pub fn lit(self, squares: usize, spacing: usize) -> Vec<(usize, usize)> {
        let comb = |k: usize| (k..squares).step_by(spacing.max(1));
        match self {
            Self::Black => Vec::new(),
            Self::White => (0..squares).flat_map(|v| (0..squares).map(move |u| (u, v))).collect(),
            Self::Row { v, k } => comb(k).map(|u| (u, v)).collect(),
            Self::Column { u, k } => comb(k).map(|v| (u, v)).collect(),
            Self::Square { u, v } => vec![(u, v)],
        }
    }
}

/// The set of patterns a position is photographed under.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scheme {
    /// Row and column combs, every `spacing`-th square lit (§5 of the paper): 2·M·spacing photographs.
    Combs {
        /// Distance of the lit squares, in squares.
        spacing: usize,
    },
    /// Each square alone: M² photographs.
    Squares,
}

impl Scheme {
    /// The name in capture.toml.
    pub fn name(self) -> &'static str {
        match self {
            Self::Combs { .. } => "combs",
            Self::Squares => "squares",
        }
    }

    /// The patterns that light squares, for M × M squares: every square is lit by one of each family.
    pub fn lighting(self, squares: usize) -> Vec<ShownPattern> {
        match self {
            Self::Combs { spacing } => {
                let phases = spacing.min(squares);
                let rows = (0..squares).flat_map(|v| (0..phases).map(move |k| ShownPattern::Row { v, k }));
                let columns = (0..squares).flat_map(|u| (0..phases).map(move |k| ShownPattern::Column { u, k }));
                rows.chain(columns).collect()
            }
            Self::Squares => {
                (0..squares).flat_map(|v| (0..squares).map(move |u| ShownPattern::Square { u, v })).collect()
            }
        }
    }

    /// Whether `pattern` belongs to this scheme with M × M squares.
    pub fn contains(self, pattern: ShownPattern, squares: usize) -> bool {
        match (self, pattern) {
            (_, ShownPattern::Black | ShownPattern::White) => true,
            (Self::Combs { spacing }, ShownPattern::Row { v: line, k } | ShownPattern::Column { u: line, k }) => {
                line < squares && k < spacing.min(squares)
            }
            (Self::Squares, ShownPattern::Square { u, v }) => u < squares && v < squares,
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_goes_there_and_back() {
        for scheme in [Scheme::Combs { spacing: 3 }, Scheme::Squares] {
            for pattern in scheme.lighting(8).into_iter().chain([ShownPattern::Black, ShownPattern::White]) {
                assert_eq!(pattern.to_string().parse(), Ok(pattern));
                assert!(scheme.contains(pattern, 8));
            }
        }
        for wrong in ["", "grey", "row-1", "row-1-2-3", "row--1-2", "row-+1-2", "square-a-1", "Black"] {
            assert!(wrong.parse::<ShownPattern>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn rows_and_columns_each_light_every_square_once() {
        let (m, spacing) = (7, 3);
        let mut rows = vec![0; m * m];
        let mut columns = vec![0; m * m];
        for pattern in (Scheme::Combs { spacing }).lighting(m) {
            let family = if matches!(pattern, ShownPattern::Row { .. }) { &mut rows } else { &mut columns };
            for (u, v) in pattern.lit(m, spacing) {
                family[v * m + u] += 1;
            }
        }
        assert!(rows.iter().chain(&columns).all(|times| *times == 1));
        // The paper's pattern count: 16 squares, spacing 3.
        assert_eq!((Scheme::Combs { spacing: 3 }).lighting(16).len(), 96);
    }
}

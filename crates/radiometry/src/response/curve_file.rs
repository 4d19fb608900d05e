//! Response files: our own CSV, polynomials of hdrgen (`.rsp`), and arrays of exposures as OpenCV and colour-hdri give them.
//!
//! The content decides which it is, never the name; FORMAT.md says what is recognised. [`ResponseCurve::parse`] is the one
//! reader, wherever a response file is named.

use std::fmt::Write;
use std::path::Path;

use super::{ResponseCurve, ResponseError};

/// Polynomials of a higher degree are refused; hdrgen writes at most 5.
const HIGHEST_DEGREE: usize = 32;
/// Codes that an array of exposures has at least: fewer are no camera.
const FEWEST_CODES: usize = 16;
/// Codes that an array has at most: 16 bits.
const MOST_CODES: usize = 65536;
/// Rows that a polynomial is tabulated with.
const POLYNOMIAL_ROWS: usize = 1024;
/// Where the exposures of a polynomial or an array fall from code to code, they are levelled out if that moves none by more
/// than this share of the exposure at clipping.
const LEVELLED: f64 = 0.02;

/// What is wrong with a line, counted from 1.
type Fault = (usize, String);

impl ResponseCurve {
    /// The header of a response file of our own.
    pub const HEADER: &'static str = "relative_exposure,red,green,blue";

    /// Reads the text of a response file; `path` is for messages. FORMAT.md says which files are recognised, by content:
    /// rows of relative exposure and code fractions under [`ResponseCurve::HEADER`]; three `.rsp` polynomials; an
    /// array of exposures or log exposures for every code, N × 3 or 3 × N.
    ///
    /// # Errors
    /// If it is none of these, a number is not finite, exposures do not grow, or a channel falls.
    pub fn parse(path: &Path, text: &str) -> Result<Self, ResponseError> {
        let text = text.trim_start_matches('\u{feff}');
        let starts_with_number = text
            .lines()
            .map(str::trim)
            .find(|line| !line.is_empty() && !line.starts_with('#'))
            .and_then(|line| split(line).next())
            .is_some_and(|field| field.parse::<f64>().is_ok());
        let read = if starts_with_number { parse_numbers(text) } else { parse_rows(text) };
        read.map_err(|(line, reason)| ResponseError { path: path.display().to_string(), line, reason })
    }

    /// The curve of rows `[relative exposure, red, green, blue]`.
    ///
    /// # Errors
    /// If a number is not finite, exposures do not grow, a channel falls, or the rows tell nothing; with the index of the row.
    pub fn from_rows(rows: &[[f64; 4]]) -> Result<Self, (usize, &'static str)> {
        let mut curve = Self { exposures: Vec::with_capacity(rows.len()), fractions: Default::default() };
        for (index, row) in rows.iter().enumerate() {
            curve.push(row).map_err(|reason| (index, reason))?;
        }
        curve.check_rising()?;
        Ok(curve)
    }

    /// The rows `[relative exposure, red, green, blue]`.
    pub fn rows(&self) -> Vec<[f64; 4]> {
        let [red, green, blue] = &self.fractions;
        self.exposures.iter().zip(red).zip(green).zip(blue).map(|(((x, r), g), b)| [*x, *r, *g, *b]).collect()
    }

    /// The text of a response file of our own; [`ResponseCurve::parse`] gives the same curve, to the bit.
    pub fn to_csv(&self) -> String {
        let mut text = format!("{}\n", Self::HEADER);
        for [exposure, red, green, blue] in self.rows() {
            // Writing to a string does not fail.
            let _ = writeln!(text, "{exposure},{red},{green},{blue}");
        }
        text
    }

    fn push(&mut self, row: &[f64; 4]) -> Result<(), &'static str> {
        let [exposure, fractions @ ..] = row;
        if row.iter().any(|number| !number.is_finite()) {
            return Err("expected four finite numbers");
        }
        if self.exposures.last().is_some_and(|last| last >= exposure) {
            return Err("relative_exposure must grow from row to row");
        }
        for (channel, fraction) in self.fractions.iter_mut().zip(fractions) {
            if channel.last().is_some_and(|last| last > fraction) {
                return Err("a response must not fall as the exposure grows");
            }
            channel.push(*fraction);
        }
        self.exposures.push(*exposure);
        Ok(())
    }

    fn check_rising(&self) -> Result<(), (usize, &'static str)> {
        if self.exposures.len() < 2 {
            return Err((0, "a response needs at least two rows"));
        }
        if self.fractions.iter().any(|channel| channel.first() == channel.last()) {
            return Err((1, "a response that does not rise tells nothing about exposure"));
        }
        Ok(())
    }
}

/// Rows under our own header.
fn parse_rows(text: &str) -> Result<ResponseCurve, Fault> {
    let mut lines = text.lines().enumerate();
    let header = lines.next().map(|(_, line)| line.trim()).unwrap_or_default();
    if header != ResponseCurve::HEADER {
        let shown: String = header.chars().take(80).collect();
        return Err((1, format!("expected the header \"{}\" or numbers, found \"{shown}\"", ResponseCurve::HEADER)));
    }
    let mut curve = ResponseCurve { exposures: Vec::new(), fractions: Default::default() };
    for (index, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
        let numbers = numbers(line, index + 1, "four numbers")?;
        let row = <[f64; 4]>::try_from(numbers.as_slice())
            .map_err(|_| (index + 1, format!("expected four numbers, found {}", numbers.len())))?;
        curve.push(&row).map_err(|reason| (index + 1, reason.to_owned()))?;
    }
    curve.check_rising().map_err(|(row, reason)| (row + 1, reason.to_owned()))?;
    Ok(curve)
}

fn split(line: &str) -> impl Iterator<Item = &str> {
    let by_comma = line.contains(',');
    line.split(move |c: char| if by_comma { c == ',' } else { c.is_whitespace() })
        .map(str::trim)
        .filter(move |field| by_comma || !field.is_empty())
}

fn numbers(line: &str, number: usize, expected: &str) -> Result<Vec<f64>, Fault> {
    split(line)
        .map(|field| field.parse::<f64>().ok().filter(|number| number.is_finite()))
        .collect::<Option<_>>()
        .ok_or_else(|| {
            let shown: String = line.chars().take(80).collect();
            (number, format!("expected {expected}, found \"{shown}\""))
        })
}

/// Numbers without a header: polynomials, or an array of exposures.
fn parse_numbers(text: &str) -> Result<ResponseCurve, Fault> {
    let lines = text.lines().enumerate().map(|(index, line)| (index + 1, line.trim()));
    let mut rows: Vec<(usize, Vec<f64>)> = Vec::new();
    for (number, line) in lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#')) {
        if rows.len() == MOST_CODES {
            return Err((number, format!("expected at most {MOST_CODES} rows of exposures")));
        }
        rows.push((number, numbers(line, number, "numbers")?));
    }
    let first = rows[0].0;
    let commas = text.contains(',');
    if !commas && rows.len() == 3 && rows.iter().all(|(_, row)| is_polynomial(row)) {
        return polynomials(&rows);
    }
    let columns = rows[0].1.len();
    if let Some((number, row)) = rows.iter().find(|(_, row)| row.len() != columns) {
        return Err((*number, format!("expected {columns} numbers as in the first row, found {}", row.len())));
    }
    let wide = rows.len() == 3 && (FEWEST_CODES..=MOST_CODES).contains(&columns);
    let tall = columns == 3 && rows.len() >= FEWEST_CODES;
    if !(wide || tall) {
        return Err((
            first,
            format!(
                "expected three lines of degree and coefficients (.rsp), or exposures of at least {FEWEST_CODES} codes as N × 3 \
                 or 3 × N numbers; found {} rows of {columns}",
                rows.len()
            ),
        ));
    }
    let channels: [Vec<f64>; 3] = std::array::from_fn(|channel| {
        if wide { rows[channel].1.clone() } else { rows.iter().map(|(_, row)| row[channel]).collect() }
    });
    let line = |code: usize, channel: usize| if wide { rows[channel].0 } else { rows[code].0 };
    let largest = channels.iter().flatten().fold(f64::NEG_INFINITY, |largest, value| largest.max(*value));
    let smallest = channels.iter().flatten().fold(f64::INFINITY, |smallest, value| smallest.min(*value));
    // An exposure is not negative, but what was extrapolated may be a little.
    let logs = smallest < -0.1 * largest.max(0.0);
    let codes = channels[0].len();
    let fractions: Vec<f64> = (0..codes).map(|code| code as f64 / (codes - 1) as f64).collect();
    from_exposures(channels.map(|channel| if logs { exp(&channel) } else { channel }), &fractions)
        .map_err(|(code, channel, reason)| (line(code, channel), reason))
}

/// Exposures of logarithms, relative to the last.
fn exp(logs: &[f64]) -> Vec<f64> {
    let last = logs.last().copied().unwrap_or(0.0);
    logs.iter().map(|log| (log - last).exp()).collect()
}

/// Whether numbers are a degree and that many coefficients and one.
fn is_polynomial(row: &[f64]) -> bool {
    row.len() >= 2 && row.len() <= HIGHEST_DEGREE + 2 && row[0] == (row.len() - 2) as f64 && row[0] >= 1.0
}

fn polynomials(rows: &[(usize, Vec<f64>)]) -> Result<ResponseCurve, Fault> {
    let fractions: Vec<f64> = (0..=POLYNOMIAL_ROWS).map(|row| row as f64 / POLYNOMIAL_ROWS as f64).collect();
    let exposures = std::array::from_fn(|channel| {
        let coefficients = &rows[channel].1[1..];
        let value = |fraction: &f64| coefficients.iter().fold(0.0, |sum, coefficient| sum * fraction + coefficient);
        fractions.iter().map(value).collect()
    });
    from_exposures(exposures, &fractions).map_err(|(_, channel, reason)| (rows[channel].0, reason))
}

/// The curve of exposures at code fractions from 0 to 1, scaled so that 1 is clipping; faults by code and channel.
fn from_exposures(exposures: [Vec<f64>; 3], fractions: &[f64]) -> Result<ResponseCurve, (usize, usize, String)> {
    let mut channels: [(Vec<f64>, Vec<f64>); 3] = Default::default();
    for (channel, (exposures, rising)) in exposures.into_iter().zip(&mut channels).enumerate() {
        let last = exposures.len() - 1;
        let clipping = exposures[last];
        if !(clipping > 0.0 && exposures.iter().all(|exposure| (exposure / clipping).is_finite())) {
            let reason = format!("the exposure of the highest code must be above 0 and not tiny, but is {clipping}");
            return Err((last, channel, reason));
        }
        let relative: Vec<f64> = exposures.iter().map(|exposure| exposure / clipping).collect();
        *rising = levelled(&relative, fractions).map_err(|code| {
            let reason = format!(
                "exposures must rise from code to code, but those of channel {} fall by more than {} % of the largest at code {code}",
                channel + 1,
                100.0 * LEVELLED
            );
            (code, channel, reason)
        })?;
    }
    ResponseCurve::from_channels(&channels).map_err(|reason| (0, 0, reason.to_owned()))
}

/// Strictly rising exposures and their fractions, after the pool-adjacent-violators rule: codes whose exposures fall share
/// their mean, at their middle fraction. `Err` with a code that would be moved too far.
fn levelled(exposures: &[f64], fractions: &[f64]) -> Result<(Vec<f64>, Vec<f64>), usize> {
    /// Neighbouring codes of one exposure.
    struct Pool {
        sum: f64,
        codes: std::ops::Range<usize>,
    }
    impl Pool {
        fn mean(&self) -> f64 {
            self.sum / self.codes.len() as f64
        }
    }
    let mut pools: Vec<Pool> = Vec::new();
    for (code, exposure) in exposures.iter().enumerate() {
        let mut pool = Pool { sum: *exposure, codes: code..code + 1 };
        while let Some(below) = pools.pop_if(|below| below.mean() >= pool.mean()) {
            pool = Pool { sum: below.sum + pool.sum, codes: below.codes.start..pool.codes.end };
        }
        pools.push(pool);
    }
    let (mut rising, mut at) = (Vec::with_capacity(pools.len()), Vec::with_capacity(pools.len()));
    for pool in &pools {
        let mean = pool.mean();
        if let Some(code) = pool.codes.clone().find(|code| (exposures[*code] - mean).abs() > LEVELLED) {
            return Err(code);
        }
        rising.push(mean);
        at.push(0.5 * (fractions[pool.codes.start] + fractions[pool.codes.end - 1]));
    }
    // The ends of the range stay what they are: black is 0, clipping 1.
    if let [first, .., last] = at.as_mut_slice() {
        (*first, *last) = (0.0, 1.0);
    }
    Ok((rising, at))
}

//! One basis image as bytes: the noise filter, the eight bits of a value, and the runs.

use std::fmt;
use std::str::FromStr;

/// A basis image in scan order, its dark pixels left out.
#[derive(Default)]
pub(crate) struct Picture {
    /// Which pixels are listed: all that have a sample of at least some floor, ascending.
    pub(crate) pixels: Vec<u32>,
    /// Their values, transfers.
    pub(crate) values: Vec<[f32; 3]>,
    /// The largest sample.
    pub(crate) peak: f32,
}

/// How a value becomes bytes. A picture is a few planes of bytes, one after the other, each in scan order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Coding {
    /// Three mantissas of eight bits and the exponent they share, as Ward's RGBE, rounded instead of cut off: planes R, G, B, E.
    /// A pixel is dark if its largest sample is below the threshold.
    Rgbe,
    /// `levels` · √(value / largest value of the picture), rounded: planes R, G, B. A sample is dark if it is below the
    /// threshold. The largest value is kept beside the bytes as a half.
    Root {
        /// The byte of the largest value.
        levels: u8,
    },
}

impl Coding {
    /// All that are tried: the fewer levels, the more often the same byte.
    pub(crate) const ALL: [Self; 6] = [
        Self::Rgbe,
        Self::Root { levels: 255 },
        Self::Root { levels: 127 },
        Self::Root { levels: 63 },
        Self::Root { levels: 55 },
        Self::Root { levels: 31 },
    ];

    /// Bytes of a pixel.
    pub(crate) fn planes(self) -> usize {
        match self {
            Self::Rgbe => 4,
            Self::Root { .. } => 3,
        }
    }

    /// Bytes of a picture that has light, beside its planes.
    pub(crate) fn bytes_beside(self) -> u64 {
        match self {
            Self::Rgbe => 0,
            Self::Root { .. } => size_of::<half::f16>() as u64,
        }
    }
}

impl fmt::Display for Coding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Rgbe => write!(f, "rgbe"),
            Self::Root { levels } => write!(f, "root{levels}"),
        }
    }
}

impl FromStr for Coding {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "rgbe" {
            return Ok(Self::Rgbe);
        }
        let levels = text.strip_prefix("root").and_then(|levels| levels.parse().ok()).filter(|levels| *levels > 0);
        Ok(Self::Root { levels: levels.ok_or_else(|| format!("no coding \"{text}\": rgbe, root1 … root255"))? })
    }
}

/// The room for one picture after the noise filter.
#[derive(Default)]
pub(crate) struct Coded {
    /// Bytes other than zero, by their place in the planes, ascending.
    pub(crate) bytes: Vec<(usize, u8)>,
    /// What a decoder makes of them: by channel, pixel and value.
    pub(crate) shown: [Vec<(u32, f32)>; 3],
}

impl Coded {
    /// Filters and codes a picture of `pixels` pixels: what is below `threshold` is dark.
    pub(crate) fn make(&mut self, coding: Coding, threshold: f32, picture: &Picture, pixels: usize) {
        self.bytes.clear();
        self.shown.iter_mut().for_each(Vec::clear);
        if picture.peak < threshold {
            return;
        }
        match coding {
            Coding::Rgbe => self.make_rgbe(threshold, picture, pixels),
            Coding::Root { levels } => self.make_root(levels, threshold, picture, pixels),
        }
    }

    fn make_rgbe(&mut self, threshold: f32, picture: &Picture, pixels: usize) {
        let lit = || {
            let all = picture.pixels.iter().zip(&picture.values);
            all.filter(|(_, value)| largest(value) >= threshold).map(|(pixel, value)| (*pixel, value))
        };
        for channel in 0..3 {
            for (pixel, value) in lit() {
                let exponent = exponent(largest(value));
                let mantissa = (value[channel] * power_of_two(8 - exponent)).round().clamp(0.0, 255.0);
                if mantissa > 0.0 {
                    self.bytes.push((channel * pixels + pixel as usize, mantissa as u8));
                    self.shown[channel].push((pixel, mantissa * power_of_two(exponent - 8)));
                }
            }
        }
        for (pixel, value) in lit() {
            self.bytes.push((3 * pixels + pixel as usize, (exponent(largest(value)) + 128) as u8));
        }
    }

    fn make_root(&mut self, levels: u8, threshold: f32, picture: &Picture, pixels: usize) {
        let scale = f32::from(levels) / picture.peak.sqrt();
        let mut shown = [0.0; 256];
        for (level, shown) in shown.iter_mut().enumerate() {
            *shown = picture.peak * (level as f32 / f32::from(levels)).powi(2);
        }
        for channel in 0..3 {
            for (pixel, value) in picture.pixels.iter().zip(&picture.values) {
                if value[channel] >= threshold {
                    let level = (value[channel].sqrt() * scale).round() as u8;
                    if level > 0 {
                        self.bytes.push((channel * pixels + *pixel as usize, level));
                        self.shown[channel].push((*pixel, shown[usize::from(level)]));
                    }
                }
            }
        }
    }
}

fn largest(value: &[f32; 3]) -> f32 {
    value[0].max(value[1]).max(value[2])
}

/// e of value = m · 2ᵉ with m in [½, 1); transfers are far from where this needs its bounds.
fn exponent(value: f32) -> i32 {
    ((value.to_bits() >> 23) as i32 - 126).clamp(-100, 100)
}

/// 2ᵉ of a normal number.
fn power_of_two(exponent: i32) -> f32 {
    f32::from_bits(((exponent + 127) as u32) << 23)
}

/// The run-length code, one token after the other:
///
/// | First byte t | What it stands for |
/// |---|---|
/// | 0 … 95 | the t + 1 bytes that follow |
/// | 96 … 127 | the byte that follows, t − 92 times |
/// | 128 … 252 | t − 127 zeros |
/// | 253 | 126 + the byte that follows zeros |
/// | 254 | as many zeros as the two bytes that follow say, the lower first |
/// | 255 | zeros to the end of the picture |
#[derive(Default)]
pub(crate) struct RunLength {
    literal: Vec<u8>,
}

const MOST_LITERALS: usize = 96;
const REPEAT: usize = 96;
const FEWEST_REPEATS: usize = 4;
const MOST_REPEATS: usize = FEWEST_REPEATS + 31;
const ZEROS: usize = 128;
const MOST_SHORT_ZEROS: usize = 125;
const ZEROS_BYTE: u8 = 253;
const ZEROS_TWO_BYTES: u8 = 254;
const REST: u8 = 255;
/// Fewer zeros than these are cheaper among the literals.
const FEWEST_ZEROS: usize = 3;

impl RunLength {
    /// Appends the code of the planes of one picture, `length` bytes in all, given by the `bytes` that are not zero.
    pub(crate) fn encode(&mut self, bytes: &[(usize, u8)], length: usize, out: &mut Vec<u8>) {
        let mut next = 0;
        for (place, byte) in bytes {
            let zeros = place - next;
            if zeros < FEWEST_ZEROS {
                self.literal.resize(self.literal.len() + zeros, 0);
            } else {
                self.flush(out);
                push_zeros(zeros, out);
            }
            self.literal.push(*byte);
            next = place + 1;
        }
        self.flush(out);
        if next < length {
            out.push(REST);
        }
    }

    /// Writes what is not a run of zeros: repeated bytes and literals.
    fn flush(&mut self, out: &mut Vec<u8>) {
        let mut rest = self.literal.as_slice();
        let mut literals = 0;
        while literals < rest.len() {
            let repeats = rest[literals..].iter().take_while(|byte| **byte == rest[literals]).count();
            if repeats < FEWEST_REPEATS {
                literals += repeats;
                continue;
            }
            push_literals(&rest[..literals], out);
            let repeats = repeats.min(MOST_REPEATS);
            out.extend([(REPEAT + repeats - FEWEST_REPEATS) as u8, rest[literals]]);
            rest = &rest[literals + repeats..];
            literals = 0;
        }
        push_literals(rest, out);
        self.literal.clear();
    }
}

fn push_literals(bytes: &[u8], out: &mut Vec<u8>) {
    for part in bytes.chunks(MOST_LITERALS) {
        out.push((part.len() - 1) as u8);
        out.extend(part);
    }
}

fn push_zeros(mut zeros: usize, out: &mut Vec<u8>) {
    while zeros > 0 {
        let run = zeros.min(usize::from(u16::MAX));
        if run <= MOST_SHORT_ZEROS {
            out.push((ZEROS + run - 1) as u8);
        } else if let Ok(more) = u8::try_from(run - MOST_SHORT_ZEROS - 1) {
            out.extend([ZEROS_BYTE, more]);
        } else {
            out.push(ZEROS_TWO_BYTES);
            out.extend((run as u16).to_le_bytes());
        }
        zeros -= run;
    }
}

/// The planes of the picture that `code` begins with, `length` bytes, and what follows it. `None` if it is no such code.
pub(crate) fn decode(code: &[u8], length: usize) -> Option<(Vec<u8>, &[u8])> {
    let mut planes = Vec::with_capacity(length);
    let mut rest = code.iter();
    while planes.len() < length {
        let token = *rest.next()?;
        let t = usize::from(token);
        if t < REPEAT {
            let (literals, after) = rest.as_slice().split_at_checked(t + 1)?;
            planes.extend(literals);
            rest = after.iter();
        } else if t < ZEROS {
            let byte = *rest.next()?;
            planes.resize(planes.len() + t - REPEAT + FEWEST_REPEATS, byte);
        } else {
            let zeros = match token {
                REST => length - planes.len(),
                ZEROS_TWO_BYTES => usize::from(u16::from_le_bytes([*rest.next()?, *rest.next()?])),
                ZEROS_BYTE => MOST_SHORT_ZEROS + 1 + usize::from(*rest.next()?),
                _ => t - ZEROS + 1,
            };
            planes.resize(planes.len() + zeros, 0);
        }
    }
    (planes.len() == length).then_some((planes, rest.as_slice()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn back_and_forth(planes: &[u8]) -> Vec<u8> {
        let bytes: Vec<(usize, u8)> = planes.iter().copied().enumerate().filter(|(_, byte)| *byte != 0).collect();
        let mut code = Vec::new();
        RunLength::default().encode(&bytes, planes.len(), &mut code);
        let length = code.len();
        code.push(77);
        let (decoded, rest) = decode(&code, planes.len()).unwrap();
        assert_eq!(decoded, planes);
        assert_eq!(rest, [77]);
        code.truncate(length);
        code
    }

    #[test]
    fn runs_of_every_length_come_back() {
        for zeros in (0..400).chain([65_534, 65_535, 65_536, 65_537, 200_000]) {
            for between in [1, 2, 3, 4, 5, 34, 35, 36, 37, 95, 96, 97, 98, 300] {
                let mut planes = vec![0; zeros];
                planes.extend((0..between).map(|i| 1 + (i % 250) as u8));
                planes.resize(planes.len() + zeros, 0);
                planes.resize(planes.len() + between, 9);
                back_and_forth(&planes);
                planes.resize(planes.len() + zeros, 0);
                back_and_forth(&planes);
            }
        }
    }

    #[test]
    fn the_code_is_as_short_as_it_says() {
        assert_eq!(back_and_forth(&[0; 5000]), [REST]);
        assert_eq!(back_and_forth(&[1, 0, 0, 2]), [3, 1, 0, 0, 2]);
        assert_eq!(back_and_forth(&[1, 0, 0, 0, 2]), [0, 1, 130, 0, 2]);
        assert_eq!(back_and_forth(&[7, 7, 7, 7, 0]), [96, 7, REST]);
    }

    #[test]
    fn what_is_torn_is_no_code() {
        for code in [&[5, 1][..], &[96], &[253], &[254, 1], &[]] {
            assert!(decode(code, 10).is_none());
        }
        assert!(decode(&[140], 10).is_none());
    }

    #[test]
    fn a_value_comes_back_within_its_step_and_noise_does_not() {
        let picture = Picture {
            pixels: vec![3, 4, 9],
            values: vec![[2e-4, 1e-4, 0.0], [1e-6, 3e-5, 1e-5], [1e-7, 1e-7, 1e-6]],
            peak: 2e-4,
        };
        let mut coded = Coded::default();
        for coding in Coding::ALL {
            coded.make(coding, 5e-6, &picture, 10);
            assert!(coded.bytes.is_sorted_by_key(|(place, _)| place));
            for (channel, shown) in coded.shown.iter().enumerate() {
                for (pixel, shown) in shown {
                    let at = picture.pixels.iter().position(|listed| listed == pixel).unwrap();
                    let value = picture.values[at][channel];
                    let step = match coding {
                        Coding::Rgbe => largest(&picture.values[at]) / 256.0,
                        Coding::Root { levels } => {
                            (value * picture.peak).sqrt() / f32::from(levels) + picture.peak / f32::from(levels).powi(2)
                        }
                    };
                    assert!((shown - value).abs() <= 1.01 * step, "{coding}: {value} became {shown}");
                    assert_ne!(*pixel, 9, "below the threshold");
                }
            }
            coded.make(coding, 3e-4, &picture, 10);
            assert!(coded.bytes.is_empty());
        }
    }

    #[test]
    fn codings_have_names() {
        for coding in Coding::ALL {
            assert_eq!(coding.to_string().parse(), Ok(coding));
        }
        assert!("root0".parse::<Coding>().is_err() && "float".parse::<Coding>().is_err());
    }
}

//! Radiance HDR: three mantissas that share one exponent, run-length coded (Ward, "Real Pixels", Graphics Gems II).
//!
//! Read: flat, old and new run lengths, rows from the top or the bottom, columns from the left or the right. Not read:
//! columns before rows, XYZE. `EXPOSURE` is left to the caller, as is `COLORCORR`: hardly any writer means it.
//!
//! Own code, because the reader of the image crate multiplies run lengths until they overflow, takes a dark pixel of a
//! narrow picture for a run, and knows one orientation; its writer cuts mantissas off instead of rounding them.

use std::io::{self, Write};
use std::path::Path;

use super::error::{Fault, check_size};
use super::picture::{check_finite, place};
use super::{FileError, write_atomically};
use crate::{Image, Linear, Radiance};

/// Row lengths for which the new run-length code is defined.
const NEW_CODE_WIDTHS: std::ops::Range<usize> = 8..0x8000;
/// 2¹²⁷: where the shared exponent ends.
const LIMIT: f32 = f32::from_bits(254 << 23);

/// Writes a radiance picture as Radiance HDR: the error is at most 0.4 % of the largest channel of a pixel. What the
/// format cannot hold, negative samples, become 0.
///
/// # Errors
/// [`FileError::NotFinite`], [`FileError::OutOfRange`] from 2¹²⁷ on, or [`FileError::Write`].
pub fn write_hdr(path: &Path, image: &Image<Radiance>) -> Result<(), FileError> {
    check_finite(path, image)?;
    let samples = image.pixels().as_flattened();
    if let Some(first) = samples.iter().position(|sample| *sample >= LIMIT) {
        let (x, y, channel) = place(first, image.width());
        let (value, format) = (samples[first], "a shared exponent of 8 bits");
        return Err(FileError::OutOfRange { path: path.to_path_buf(), x, y, channel, value, format, limit: LIMIT });
    }
    write_atomically(path, |out| encode(out, image))
}

fn encode(out: &mut impl Write, image: &Image<Radiance>) -> io::Result<()> {
    let (width, height) = image.size();
    if width == 0 || height == 0 {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "a picture without pixels"));
    }
    write!(out, "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n")?;
    let mut packed = Vec::new();
    for row in image.pixels().chunks_exact(width) {
        let row: Vec<_> = row.iter().map(|pixel| rgbe_of(*pixel)).collect();
        if NEW_CODE_WIDTHS.contains(&width) {
            packed.clear();
            packed.extend([2, 2, (width >> 8) as u8, width as u8]);
            for component in 0..4 {
                let bytes: Vec<_> = row.iter().map(|rgbe| rgbe[component]).collect();
                pack_runs(&mut packed, &bytes);
            }
            out.write_all(&packed)?;
        } else {
            out.write_all(row.as_flattened())?;
        }
    }
    Ok(())
}

/// 128 + n, byte: n equal bytes. n, bytes: n bytes as they are.
fn pack_runs(packed: &mut Vec<u8>, mut bytes: &[u8]) {
    let run_at = |bytes: &[u8]| bytes.iter().take(127).take_while(|byte| **byte == bytes[0]).count();
    while !bytes.is_empty() {
        let run = run_at(bytes);
        if run >= 4 {
            packed.extend([128 + run as u8, bytes[0]]);
            bytes = &bytes[run..];
        } else {
            // As they are, up to the next run worth its two bytes.
            let count = (1..bytes.len().min(128)).find(|start| run_at(&bytes[*start..]) >= 4);
            let (plain, rest) = bytes.split_at(count.unwrap_or(bytes.len().min(128)));
            packed.push(plain.len() as u8);
            packed.extend_from_slice(plain);
            bytes = rest;
        }
    }
}

/// The nearest pixel of the format whose largest mantissa is 128 … 255.
fn rgbe_of(pixel: [f32; 3]) -> [u8; 4] {
    let largest = pixel.into_iter().fold(0.0, f32::max);
    // `largest` is in 2^(exponent - 1) .. 2^exponent; smaller than the exponent reaches is 0.
    let mut exponent = i32::from((largest.to_bits() >> 23) as u8) - 126;
    if largest < f32::MIN_POSITIVE {
        return [0; 4];
    }
    let mantissa = |value: f32, exponent| (f64::from(value) * power_of_two(8 - exponent)).round();
    if mantissa(largest, exponent) > 255.0 {
        exponent += 1;
    }
    // 255.5 · 2¹¹⁹ and more rounds to an exponent there is none for: the last mantissa is 0.2 % away.
    let exponent = exponent.min(127);
    let [r, g, b] = pixel.map(|value| mantissa(value, exponent) as u8);
    [r, g, b, (exponent + 128) as u8]
}

/// What a pixel of the format means: mantissa · 2^(e - 136), 0 for e = 0.
fn pixel_of([r, g, b, e]: [u8; 4], scales: &[f32; 256]) -> [f32; 3] {
    [r, g, b].map(|mantissa| f32::from(mantissa) * scales[usize::from(e)])
}

fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((1023 + exponent) as u64) << 52)
}

pub(super) fn decode(bytes: &[u8]) -> Result<Image<Linear>, Fault> {
    let mut input = Input { rest: bytes };
    let layout = input.header()?;
    let (width, height) = (layout.width, layout.height);
    // The shortest row is one pixel and one run: 1000 bytes do not make a million rows.
    if height > input.rest.len() / 4 {
        return Err(Fault::early_end());
    }
    let mut scales = [0.0; 256];
    for (exponent, scale) in (1..).zip(&mut scales[1..]) {
        *scale = power_of_two(exponent - 136) as f32; // exact, though the smallest are subnormal
    }
    let mut image = Image::black(width, height);
    let mut row = vec![[0; 4]; width];
    for index in 0..height {
        input.row(&mut row)?;
        let y = if layout.from_the_top { index } else { height - 1 - index };
        let target = &mut image.pixels_mut()[y * width..][..width];
        let pixels = row.iter().map(|rgbe| pixel_of(*rgbe, &scales));
        if layout.from_the_left {
            target.iter_mut().zip(pixels).for_each(|(target, pixel)| *target = pixel);
        } else {
            target.iter_mut().rev().zip(pixels).for_each(|(target, pixel)| *target = pixel);
        }
    }
    Ok(image)
}

struct Layout {
    width: usize,
    height: usize,
    from_the_top: bool,
    from_the_left: bool,
}

struct Input<'a> {
    rest: &'a [u8],
}

impl Input<'_> {
    fn line(&mut self) -> Result<String, Fault> {
        let end = self.rest.iter().position(|byte| *byte == b'\n').ok_or_else(Fault::early_end)?;
        let line = String::from_utf8_lossy(&self.rest[..end]).trim_end_matches('\r').to_owned();
        self.rest = &self.rest[end + 1..];
        Ok(line)
    }

    /// Lines up to an empty one, then the line with the size.
    fn header(&mut self) -> Result<Layout, Fault> {
        loop {
            let line = self.line()?;
            if line.is_empty() {
                break;
            }
            if let Some(format) = line.strip_prefix("FORMAT=").map(str::trim)
                && format != "32-bit_rle_rgbe"
            {
                return Err(Fault::unsupported(format!("format 32-bit_rle_rgbe was expected, found {format:.40}")));
            }
        }
        let line = self.line()?;
        let words: Vec<_> = line.split_whitespace().collect();
        let &[rows, height, columns, width] = &words[..] else {
            return Err(Fault::damaged(format!("a size like `-Y 480 +X 640` was expected, found `{line:.40}`")));
        };
        let (Ok(height), Ok(width)) = (height.parse::<u32>(), width.parse::<u32>()) else {
            return Err(Fault::damaged(format!("a size like `-Y 480 +X 640` was expected, found `{line:.40}`")));
        };
        if !matches!((rows, columns), ("-Y" | "+Y", "-X" | "+X")) {
            return Err(Fault::unsupported(format!("rows of columns (±Y, ±X) were expected, found `{line:.40}`")));
        }
        check_size(width.into(), height.into())?;
        let (from_the_top, from_the_left) = (rows == "-Y", columns == "+X");
        Ok(Layout { width: width as usize, height: height as usize, from_the_top, from_the_left })
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], Fault> {
        let (taken, rest) = self.rest.split_first_chunk().ok_or_else(Fault::early_end)?;
        self.rest = rest;
        Ok(*taken)
    }

    fn row(&mut self, row: &mut [[u8; 4]]) -> Result<(), Fault> {
        let first = self.take::<4>()?;
        match first {
            [2, 2, high @ 0..128, low] if NEW_CODE_WIDTHS.contains(&row.len()) => {
                if usize::from(high) << 8 | usize::from(low) != row.len() {
                    return Err(Fault::damaged("a row of another length than the header announces"));
                }
                (0..4).try_for_each(|component| self.component(row, component))
            }
            _ => self.old_row(first, row),
        }
    }

    /// One component of a row in the new code.
    fn component(&mut self, row: &mut [[u8; 4]], component: usize) -> Result<(), Fault> {
        let mut rest = row;
        while !rest.is_empty() {
            let [code] = self.take()?;
            let count = usize::from(if code > 128 { code - 128 } else { code });
            let (target, after) =
                rest.split_at_mut_checked(count).ok_or_else(|| Fault::damaged("a run past its row"))?;
            if code > 128 {
                let [value] = self.take()?;
                target.iter_mut().for_each(|rgbe| rgbe[component] = value);
            } else {
                let (values, input) = self.rest.split_at_checked(count).ok_or_else(Fault::early_end)?;
                self.rest = input;
                target.iter_mut().zip(values).for_each(|(rgbe, value)| rgbe[component] = *value);
            }
            rest = after;
        }
        Ok(())
    }

    /// Flat pixels; 1, 1, 1, n repeats the pixel before it n times, and n · 256ᵏ times after k other repetitions.
    fn old_row(&mut self, first: [u8; 4], row: &mut [[u8; 4]]) -> Result<(), Fault> {
        let (mut next, mut filled, mut shift) = (first, 0, 0);
        loop {
            if let [1, 1, 1, count] = next {
                if filled == 0 || shift > 24 {
                    return Err(Fault::damaged("a repetition of nothing"));
                }
                let end = filled + (usize::from(count) << shift);
                let before = row[filled - 1];
                row.get_mut(filled..end).ok_or_else(|| Fault::damaged("a run past its row"))?.fill(before);
                (filled, shift) = (end, shift + 8);
            } else {
                row[filled] = next;
                (filled, shift) = (filled + 1, 0);
            }
            if filled == row.len() {
                return Ok(());
            }
            next = self.take()?;
        }
    }
}

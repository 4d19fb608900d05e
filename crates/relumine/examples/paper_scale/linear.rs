//! How time grows with pixels and lit cells.

use relumine::radiometry::Image;
use relumine::{ReflectanceField, ResidentPacked};
use relumine_relight::ResidentBlock;
use serde_json::{Value, json};

use crate::Failure;
use crate::lights;
use crate::measure::{Milliseconds, rounded};

/// A part of the picture under light from some positions.
struct Point {
    pixels: usize,
    positions: usize,
    cells: usize,
    ms: f64,
}

/// Times every 8th block, every 4th, and so on under light from 1, 2, 4, … positions, all squares of each.
pub(crate) fn curve(field: &ReflectanceField, blocks: &[ResidentBlock], repeat: usize) -> Result<Value, Failure> {
    let cells = field.cells();
    let (width, height) = field.picture_size();
    let mut numbers: Vec<usize> =
        (0..).map(|power| 1 << power).take_while(|number| *number < cells.positions()).collect();
    numbers.push(cells.positions());
    let mut points = Vec::new();
    for step in [8, 4, 2, 1].into_iter().filter(|step| *step <= blocks.len()) {
        let some: Vec<ResidentBlock> = blocks.iter().step_by(step).cloned().collect();
        let pixels = some.iter().map(|block| block.extent().pixels()).sum();
        let some = ResidentPacked::from_resident(some, [width, height], cells.positions(), cells.squares())?;
        let mut picture = Image::black(width, height);
        for number in &numbers {
            let positions = lights::spread(cells, *number);
            let pair = [1, 2].map(|seed| lights::random(cells, &positions, seed));
            let mut times = Milliseconds::default();
            for index in 0..repeat {
                times.time(|| some.relight_into(&pair[index % 2], &mut picture))?;
            }
            let (positions, cells) = lights::lit(&pair[0]);
            points.push(Point { pixels, positions, cells, ms: times.least() });
        }
    }
    Ok(report(&points))
}

/// The points, and what they would take if time were pixels · (a + b · cells): a and b of the least relative squares.
fn report(points: &[Point]) -> Value {
    let mut sums = [0.0; 5];
    let terms = |point: &Point| {
        let pixels = point.pixels as f64;
        (pixels / point.ms, pixels * point.cells as f64 / point.ms)
    };
    for (x, y) in points.iter().map(terms) {
        for (sum, term) in sums.iter_mut().zip([x * x, x * y, y * y, x, y]) {
            *sum += term;
        }
    }
    let [xx, xy, yy, x, y] = sums;
    let determinant = xx * yy - xy * xy;
    let (a, b) = ((x * yy - y * xy) / determinant, (y * xx - x * xy) / determinant);
    let off = |point: &Point| {
        let (x, y) = terms(point);
        a * x + b * y - 1.0
    };
    let largest = points.iter().map(|point| off(point).abs()).fold(0.0, f64::max);
    let each: Vec<Value> = points
        .iter()
        .map(|point| {
            json!({
                "pixels": point.pixels,
                "lit_positions": point.positions,
                "lit_cells": point.cells,
                "ms": rounded(point.ms),
                "line_is_off_by": rounded(off(point)),
            })
        })
        .collect();
    json!({
        "points": each,
        "ns_per_pixel": rounded(1e6 * a),
        "ps_per_pixel_and_cell": rounded(1e9 * b),
        "largest_deviation_of_line": rounded(largest),
    })
}

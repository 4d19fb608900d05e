//! Every Rᵢ of a small field as an array of NumPy's.

use std::fs::File;
use std::io::Write;
use std::os::unix::fs::FileExt;
use std::path::Path;

use half::f16;
use rayon::prelude::*;
use relumine::{Coefficients, ReflectanceField, ResidentPacked};
use relumine_field::packed::{Groups, PackedBlock};
use serde_json::{Value, json};

use crate::Failure;
use crate::lights::{self, Named};
use crate::words::Words;

pub(crate) fn run(words: &Words) -> Result<Value, Failure> {
    let [path, folder] = words.paths()?;
    let field = ReflectanceField::open(path)?;
    let cells = field.cells();
    let every: Vec<usize> = (0..cells.positions()).collect();
    let mut all = vec![Named { name: "random".into(), coefficients: lights::random(cells, &every, 0) }];
    all.extend(lights::read(&words.lights, cells)?);
    let resident = ResidentPacked::load(&field)?;
    std::fs::create_dir_all(folder)?;

    let (width, height) = field.picture_size();
    let pixels = width * height;
    let planes = |values: &[[f32; 3]]| -> Vec<f32> { (0..3).flat_map(|c| values.iter().map(move |v| v[c])).collect() };
    let coefficients: Vec<f32> = all.iter().flat_map(|light| planes(light.coefficients.values())).collect();
    write(&folder.join("lights.npy"), &[all.len(), 3, cells.len()], &coefficients)?;
    let picture = |light: &Coefficients| resident.relight(light).map(|picture| planes(picture.pixels()));
    let pictures: Vec<Vec<f32>> = all.iter().map(|light| picture(&light.coefficients)).collect::<Result<_, _>>()?;
    write(&folder.join("pictures.npy"), &[all.len(), 3, pixels], &pictures.concat())?;
    drop((resident, pictures));

    write_basis(&folder.join("basis.npy"), &field)?;
    let names: Vec<&str> = all.iter().map(|light| light.name.as_str()).collect();
    Ok(
        json!({ "picture": [width, height], "cells": cells.len(), "basis_bytes": 12 * cells.len() * pixels, "lights": names }),
    )
}

/// All transfers, float32 `[channel, cell, pixel]`; memory holds the packed field and one position a thread.
fn write_basis(path: &Path, field: &ReflectanceField) -> Result<(), Failure> {
    let [down, across] = field.blocks().grid();
    let blocks: Vec<PackedBlock> = (0..down * across)
        .into_par_iter()
        .map(|index| field.packed_block([index / across, index % across], |_| true))
        .collect::<Result<_, _>>()?;
    let (width, height) = field.picture_size();
    let (pixels, cells, m) = (width * height, field.cells().len(), field.cells().squares());
    let file = File::create(path)?;
    let start = header(&[3, cells, pixels]);
    (&file).write_all(&start)?;
    let groups = Groups::new(m);
    let write = |position: usize| -> Result<(), Failure> {
        let scale = field.scale(position);
        let mut halves = Vec::new();
        let mut planes = vec![0.0f32; 3 * m * m * pixels];
        for block in &blocks {
            halves.clear();
            halves.resize(3 * m * m * block.extent.pixels(), f16::ZERO);
            block.decode(position, &groups, scale, &mut halves);
            for (row, halves) in halves.chunks_exact(block.extent.columns.len()).enumerate() {
                let (picture, row) = (row / block.extent.rows.len(), row % block.extent.rows.len());
                let (square, channel) = (picture / 3, picture % 3);
                let at = ((channel * m * m + square) * height + block.extent.rows.start + row) * width;
                let to = &mut planes[at..at + width][block.extent.columns.clone()];
                to.iter_mut().zip(halves).for_each(|(to, half)| *to = half.to_f32() * scale);
            }
        }
        for (channel, plane) in planes.chunks_exact(m * m * pixels).enumerate() {
            let at = start.len() + 4 * (channel * cells + position * m * m) * pixels;
            file.write_all_at(&bytes(plane), at as u64)?;
        }
        Ok(())
    };
    (0..field.cells().positions()).into_par_iter().map(write).collect()
}

fn write(path: &Path, shape: &[usize], values: &[f32]) -> Result<(), Failure> {
    let mut file = File::create(path)?;
    file.write_all(&header(shape))?;
    Ok(file.write_all(&bytes(values))?)
}

fn bytes(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// The beginning of a file of float32 in C order, format 1.0 of `.npy`.
fn header(shape: &[usize]) -> Vec<u8> {
    let sides: String = shape.iter().map(|side| format!("{side}, ")).collect();
    let mut text = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({sides}), }}");
    while (10 + text.len() + 1) % 64 != 0 {
        text.push(' ');
    }
    text.push('\n');
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    header.extend((text.len() as u16).to_le_bytes());
    header.extend(text.as_bytes());
    header
}

//! `relumine compare`: error figures between two pictures.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use relumine::radiometry::files::{self, ExrSample};
use relumine::radiometry::{Difference, Encoded, Image, Linear, difference};

use crate::failure::{Failure, printed};
use crate::output::{PictureFormat, refuse_existing};

/// Compare a picture A with a reference B
///
/// Prints relative L2 (‖A − B‖ / ‖B‖), the ratio of means, RMSE and PSNR, over the pixels of the mask and all channels. PNG,
/// TIFF and JPEG are decoded from sRGB to linear first unless --raw is given.
#[derive(Args)]
pub(crate) struct Arguments {
    /// The picture
    a: PathBuf,
    /// The reference
    b: PathBuf,
    /// Compare only where this picture is not black
    #[arg(long, value_name = "PICTURE")]
    mask: Option<PathBuf>,
    /// Write the difference: .exr holds A − B, .png shows A too bright in red, too dark in blue
    #[arg(short, long, value_name = "OUT")]
    output: Option<PathBuf>,
    /// Multiply A with the one factor that brings it nearest to B first
    #[arg(long)]
    fit_scale: bool,
    /// Take integer codes as they are, 0 to 1, instead of decoding sRGB
    #[arg(long)]
    raw: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Replace the output if it is there
    #[arg(long)]
    force: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    if let Some(output) = &arguments.output {
        if !matches!(PictureFormat::of(output)?, PictureFormat::Exr | PictureFormat::Png) {
            return Err(Failure::usage(format!("{}: a difference is written as .exr or .png", output.display())));
        }
        refuse_existing(output, arguments.force)?;
    }
    let a = read_linear(&arguments.a, arguments.raw)?;
    let b = read_linear(&arguments.b, arguments.raw)?;
    same_size(&arguments.a, a.size(), &arguments.b, b.size())?;
    let mask = match &arguments.mask {
        Some(path) => {
            let mask = read_linear(path, true)?;
            same_size(path, mask.size(), &arguments.b, b.size())?;
            Some(mask.pixels().iter().map(|pixel| pixel.iter().any(|sample| *sample > 0.0)).collect::<Vec<bool>>())
        }
        None => None,
    };
    let Some(figures) = difference(&a, &b, mask.as_deref(), arguments.fit_scale) else {
        let path = arguments.b.display();
        return Err(Failure::failed(format!(
            "{path}: nothing to compare with: it is black, or the mask leaves no pixel"
        )));
    };
    if let Some(output) = &arguments.output {
        write_difference(output, &a, &b, mask.as_deref(), figures.scale)?;
    }
    print(&figures, arguments)
}

fn print(figures: &Difference, arguments: &Arguments) -> Result<(), Failure> {
    let Difference { relative_l2, ratio_of_means, rmse, psnr_db, scale, pixels } = figures;
    let mut out = std::io::stdout().lock();
    if arguments.json {
        // JSON has no infinity: equal pictures have no PSNR.
        let psnr = if psnr_db.is_finite() { format!("{psnr_db:.4}") } else { "null".into() };
        return printed(writeln!(
            out,
            "{{\"relative_l2\": {relative_l2:.8}, \"ratio_of_means\": {ratio_of_means:.8}, \"rmse\": {rmse:.8e}, \
             \"psnr_db\": {psnr}, \"scale\": {scale:.8}, \"pixels\": {pixels}}}"
        ));
    }
    printed(writeln!(
        out,
        "relative L2     {relative_l2:.5}\nratio of means  {ratio_of_means:.5}\nRMSE            {rmse:.4e}\n\
         PSNR            {psnr_db:.2} dB\npixels          {pixels}"
    ))?;
    if arguments.fit_scale { printed(writeln!(out, "scale of A      {scale:.5}")) } else { Ok(()) }
}

fn same_size(a: &Path, size_a: (usize, usize), b: &Path, size_b: (usize, usize)) -> Result<(), Failure> {
    if size_a == size_b {
        return Ok(());
    }
    let ((aw, ah), (bw, bh)) = (size_a, size_b);
    Err(Failure::failed(format!("{} has {aw} × {ah} pixels, but {} has {bw} × {bh}", a.display(), b.display())))
}

fn read_linear(path: &Path, raw: bool) -> Result<Image<Linear>, Failure> {
    Ok(files::read_picture(path)?.into_linear(!raw))
}

fn write_difference(
    path: &Path,
    a: &Image<Linear>,
    b: &Image<Linear>,
    mask: Option<&[bool]>,
    scale: f64,
) -> Result<(), Failure> {
    let scale = scale as f32;
    let inside = |index: usize| mask.is_none_or(|mask| mask[index]);
    let pairs = || a.pixels().iter().zip(b.pixels()).enumerate();
    if PictureFormat::of(path)? == PictureFormat::Exr {
        let pixels = pairs()
            .map(
                |(index, (a, b))| {
                    if inside(index) { [0, 1, 2].map(|channel| scale * a[channel] - b[channel]) } else { [0.0; 3] }
                },
            )
            .collect();
        files::write_exr(path, &Image::<Linear>::from_pixels(a.width(), a.height(), pixels), ExrSample::Float, &[])?;
        return Ok(());
    }
    let luminance = |pixel: &[f32; 3]| 0.2126 * pixel[0] + 0.7152 * pixel[1] + 0.0722 * pixel[2];
    let brightest = b.pixels().iter().map(luminance).fold(f32::MIN_POSITIVE, f32::max);
    let pixels = pairs()
        .map(|(index, (a, b))| {
            // The square root shows small errors beside large ones.
            let error = if inside(index) { (scale * luminance(a) - luminance(b)) / brightest } else { 0.0 };
            let shown = error.abs().sqrt().min(1.0);
            if error > 0.0 { [shown, 0.0, 0.0] } else { [0.0, 0.0, shown] }
        })
        .collect();
    files::write_png8(path, &Image::<Encoded>::from_pixels(a.width(), a.height(), pixels))?;
    Ok(())
}

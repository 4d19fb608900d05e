//! Relit pictures to files, by extension.

use std::path::Path;

use clap::{Args, ValueEnum};
use relumine::radiometry::files::{self, ExrSample};
use relumine::radiometry::{Display, Image, Radiance, Tone};

use crate::failure::Failure;

/// How radiance is shown in files that hold display codes.
#[derive(Args, Clone, Debug)]
pub(crate) struct DisplayArguments {
    /// Brightness of PNG and TIFF, in stops: radiance is multiplied by 2^STOPS.
    #[arg(long, default_value_t = 0.0, value_name = "STOPS", allow_negative_numbers = true)]
    exposure: f32,
    /// What PNG and TIFF do above white.
    #[arg(long, value_enum, default_value_t = ToneArgument::Clip)]
    tone: ToneArgument,
}

#[derive(ValueEnum, Clone, Copy, Debug)]
enum ToneArgument {
    /// Cut off at white.
    Clip,
    /// Roll highlights off on a filmic curve.
    Filmic,
}

impl DisplayArguments {
    fn display(&self) -> Display {
        let tone = match self.tone {
            ToneArgument::Clip => Tone::Clip,
            ToneArgument::Filmic => Tone::Filmic,
        };
        Display { exposure_stops: self.exposure, tone }
    }
}

/// Refuses to write over something that is there.
pub(crate) fn refuse_existing(path: &Path, force: bool) -> Result<(), Failure> {
    if path.exists() && !force {
        return Err(Failure::failed(format!("{} exists already", path.display()))
            .with_hint("choose another name, or add --force to replace it"));
    }
    match path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        Some(folder) if !folder.is_dir() => {
            Err(Failure::failed(format!("{}: the folder {} is not there", path.display(), folder.display()))
                .with_hint("make it, or choose another name"))
        }
        _ => Ok(()),
    }
}

/// What a picture file is, by its extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PictureFormat {
    Exr,
    Hdr,
    Png,
    Tiff,
}

impl PictureFormat {
    pub(crate) fn extension(self) -> &'static str {
        match self {
            Self::Exr => "exr",
            Self::Hdr => "hdr",
            Self::Png => "png",
            Self::Tiff => "tif",
        }
    }

    pub(crate) fn of(path: &Path) -> Result<Self, Failure> {
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        match extension.as_deref() {
            Some("exr") => Ok(Self::Exr),
            Some("hdr") => Ok(Self::Hdr),
            Some("png") => Ok(Self::Png),
            Some("tif" | "tiff") => Ok(Self::Tiff),
            _ => {
                let path = path.display();
                Err(Failure::usage(format!("{path}: expected a name that ends in .exr, .hdr, .png or .tif")))
            }
        }
    }
}

/// Writes a picture: EXR (float) and HDR hold radiance, PNG (8 bit) and TIFF (16 bit) what a display shows.
pub(crate) fn write_picture(path: &Path, picture: &Image<Radiance>, display: &DisplayArguments) -> Result<(), Failure> {
    let shown = || display.display().encode(picture);
    match PictureFormat::of(path)? {
        PictureFormat::Exr => files::write_exr(path, picture, ExrSample::Float, &[])?,
        PictureFormat::Hdr => files::write_hdr(path, picture)?,
        PictureFormat::Png => files::write_png8(path, &shown())?,
        PictureFormat::Tiff => files::write_tiff16(path, &shown())?,
    }
    Ok(())
}

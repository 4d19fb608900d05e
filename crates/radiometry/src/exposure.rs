//! How long and how wide the shutter was open.

/// The exposure of a photograph.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExposureSettings {
    /// Shutter time, seconds.
    pub exposure_s: f64,
    /// Sensitivity and aperture, if the file gives them.
    pub gain: Option<Gain>,
}

/// Sensitivity and aperture of a photograph.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gain {
    /// ISO sensitivity.
    pub iso: f64,
    /// The f-number.
    pub f_number: f64,
}

impl ExposureSettings {
    /// `exposure_s` · (`iso`/100) / `f_number`²: what a radiance is multiplied with on its way to the relative exposure X.
    pub fn relative(&self) -> f64 {
        match self.gain {
            Some(Gain { iso, f_number }) => self.exposure_s * (iso / 100.0) / (f_number * f_number),
            None => self.exposure_s,
        }
    }
}

//! White balance: three gains, for the projector's own colour.

use super::space::luminance;

/// The gains that make a neutral reference neutral: what a grey card shows under the projector's white light, black taken away,
/// times its gain is the same in all three channels and has the luminance (Rec. 709) that was measured. So a white balance
/// changes the colour of what is shown, not its brightness.
///
/// `measured` is linear Rec. 709, in any unit: the camera's channels after its colour correction. `None` unless all three
/// channels are above 0 and finite: a channel that saw nothing cannot be balanced.
///
/// Coefficients times these gains relight as if the projector's light had been neutral; projected levels times these gains, over
/// the largest of them, are neutral light.
pub fn white_balance(measured: [f64; 3]) -> Option<[f64; 3]> {
    let lit = measured.iter().all(|value| *value > 0.0 && value.is_finite());
    let gains = measured.map(|value| luminance(measured) / value);
    (lit && gains.iter().all(|gain| gain.is_finite() && *gain > 0.0)).then_some(gains)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grey_becomes_grey_of_the_same_luminance() {
        for measured in [[0.8, 1.0, 0.5], [3e-4, 2e-4, 9e-4], [7.0, 7.0, 7.0]] {
            let gains = white_balance(measured).unwrap();
            let balanced = [0, 1, 2].map(|channel| gains[channel] * measured[channel]);
            assert!((balanced[0] / balanced[1] - 1.0).abs() < 1e-12 && (balanced[2] / balanced[1] - 1.0).abs() < 1e-12);
            assert!((luminance(balanced) / luminance(measured) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_channel_without_light_cannot_be_balanced() {
        for measured in
            [[0.0, 1.0, 1.0], [1.0, -0.1, 1.0], [1.0, 1.0, f64::NAN], [f64::INFINITY, 1.0, 1.0], [1.0, 1e-320, 1.0]]
        {
            assert_eq!(white_balance(measured), None, "{measured:?}");
        }
    }
}

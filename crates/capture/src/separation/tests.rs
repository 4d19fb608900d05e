//! Claims about separation on squares whose light is known.

use proptest::prelude::*;

use super::*;

mod noisy;

/// Photographs of known squares, `truth[(v · M + u) · lanes + lane]`, without noise.
struct Photographed {
    squares: usize,
    spacing: usize,
    lanes: usize,
    rows: Vec<Vec<f32>>,
    columns: Vec<Vec<f32>>,
    white: Vec<f32>,
}

impl Photographed {
    fn new(squares: usize, spacing: usize, truth: &[f32]) -> Self {
        let lanes = truth.len() / (squares * squares);
        let sum = |members: &[(usize, usize)]| -> Vec<f32> {
            (0..lanes)
                .map(|lane| members.iter().map(|(u, v)| truth[(v * squares + u) * lanes + lane]).sum::<f32>())
                .collect()
        };
        let lines = (0..squares).flat_map(|line| (0..spacing).map(move |k| (line, k)));
        let comb = |k: usize| (k..squares).step_by(spacing);
        let rows = lines.clone().map(|(v, k)| sum(&comb(k).map(|u| (u, v)).collect::<Vec<_>>())).collect();
        let columns = lines.map(|(u, k)| sum(&comb(k).map(|v| (u, v)).collect::<Vec<_>>())).collect();
        let white = sum(&(0..squares * squares).map(|i| (i % squares, i / squares)).collect::<Vec<_>>());
        Self { squares, spacing, lanes, rows, columns, white }
    }

    fn combs(&self) -> Combs<'_> {
        Combs {
            squares: self.squares,
            spacing: self.spacing,
            rows: self.rows.iter().map(|frame| Some(frame.as_slice())).collect(),
            columns: self.columns.iter().map(|frame| Some(frame.as_slice())).collect(),
            white: Some(&self.white),
            noise: None,
            lanes: self.lanes,
        }
    }
}

fn separated(combs: &Combs, method: Method) -> Vec<f32> {
    let mut squares = vec![f32::NAN; combs.squares * combs.squares * combs.lanes];
    match method {
        Method::Minimum => separate_minimum(combs, &mut squares),
        Method::Thresholded => drop(separate_thresholded(combs, THRESHOLD_SIGMAS, &mut squares)),
        Method::Unbiased => drop(separate_unbiased(combs, &mut squares)),
        Method::Fitted => drop(separate_fitted(combs, &mut squares)),
    }
    squares
}

#[test]
fn a_pixel_that_one_square_lights_is_separated_exactly() {
    // Every lane sees one square only: a matte plane, each point under one square.
    let m = 8;
    let lanes = m * m;
    let mut truth = vec![0.0; m * m * lanes];
    for i in 0..m * m {
        truth[i * lanes + i] = 0.1 + i as f32;
    }
    let photographs = Photographed::new(m, 3, &truth);
    for method in [Method::Minimum, Method::Fitted] {
        assert_eq!(separated(&photographs.combs(), method), truth, "{method:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(2003), ..Default::default() })]

    #[test]
    fn the_fit_explains_every_comb_and_the_white_frame(
        m in 1usize..9,
        spacing in 1usize..4,
        values in prop::collection::vec(0.0f32..1.0, 64 * 4),
        sparsity in 0.0f32..0.9,
    ) {
        let spacing = spacing.min(m);
        // Light from everywhere, as in a white bowl: the minimum alone fails here.
        let truth: Vec<f32> =
            values[..m * m * 4].iter().map(|value| if *value < sparsity { 0.0 } else { *value }).collect();
        let photographs = Photographed::new(m, spacing, &truth);
        let combs = photographs.combs();
        let minimum = separated(&combs, Method::Minimum);
        for (value, truth) in minimum.iter().zip(&truth) {
            prop_assert!(*value >= truth - 1e-5, "without noise the minimum is never too small");
        }
        let fitted = separated(&combs, Method::Fitted);
        prop_assert!(fitted.iter().all(|value| value.is_finite() && *value >= 0.0));
        let fit = residual(&combs, &fitted);
        prop_assert!(fit.combs().unwrap_or(0.0) < 2e-3, "combs {:?}", fit.combs());
        prop_assert!(fit.white().unwrap_or(0.0) < 1e-5, "white {:?}", fit.white());
        prop_assert!(fit.combs_error <= residual(&combs, &minimum).combs_error + 1e-9);
    }

    #[test]
    fn noise_is_neither_lost_nor_made_negative(values in prop::collection::vec(-0.5f32..1.0, 48 * 2 + 2)) {
        // Photographs that are nothing but noise around black.
        let lanes = 2;
        let frame = |i: usize| Some(&values[i * lanes..][..lanes]);
        let combs = Combs {
            squares: 8, spacing: 3, lanes,
            rows: (0..24).map(frame).collect(),
            columns: (24..48).map(frame).collect(),
            white: Some(&values[96..]),
            noise: None,
        };
        let fitted = separated(&combs, Method::Fitted);
        prop_assert!(fitted.iter().all(|value| value.is_finite() && *value >= 0.0));
        // All squares add up to the white frame where it is believed, else to what the two families of combs saw on average,
        // cut at zero once a table.
        for lane in 0..lanes {
            let sum: f32 = fitted.chunks_exact(lanes).map(|square| square[lane]).sum();
            let seen = |line: usize, k: usize| values[(line * 3 + k) * lanes + lane];
            let table = |k: usize, kk: usize| {
                let rows: f32 = (kk..8).step_by(3).map(|v| seen(v, k)).sum();
                let columns: f32 = (k..8).step_by(3).map(|u| seen(8 + u, kk)).sum();
                (0.5 * (rows + columns)).max(0.0)
            };
            let combs: f32 = (0..9).map(|i| table(i / 3, i % 3)).sum();
            let white = values[96 + lane];
            let believed = white * 2.0 >= combs && white <= combs * 2.0;
            let expected = if believed { white } else { combs };
            prop_assert!((sum - expected).abs() < 1e-3, "{sum}, not {expected}");
        }
    }
}

#[test]
fn a_comb_that_was_not_taken_takes_its_squares_and_no_others() {
    let m = 6;
    let truth: Vec<f32> = (0..m * m).map(|i| 1.0 + (i * 7 % 5) as f32).collect();
    let photographs = Photographed::new(m, 3, &truth);
    let mut combs = photographs.combs();
    combs.rows[2 * 3 + 1] = None; // row-2-1: squares (1, 2) and (4, 2)
    assert!(!combs.is_present(1, 2) && !combs.is_present(4, 2) && combs.is_present(0, 2));
    for method in [Method::Minimum, Method::Fitted] {
        let squares = separated(&combs, method);
        assert!(squares.iter().all(|value| value.is_finite()));
        assert_eq!((squares[2 * m + 1], squares[2 * m + 4]), (0.0, 0.0));
        for i in (0..m * m).filter(|i| ![2 * m + 1, 2 * m + 4].contains(i)) {
            assert!(squares[i] > 0.0, "{method:?}: square {i} is lost without need");
        }
    }
    // Blocks that lack nothing are fitted as before.
    let whole = separated(&photographs.combs(), Method::Fitted);
    let broken = separated(&combs, Method::Fitted);
    assert!((whole[0] / broken[0] - 1.0).abs() < 1e-3);
}

#[test]
fn without_a_trusted_white_frame_the_combs_decide() {
    let truth: Vec<f32> = (0..36).map(|i| 1.0 + (i % 5) as f32).collect();
    let photographs = Photographed::new(6, 3, &truth);
    let mut combs = photographs.combs();
    let nothing = [f32::NAN];
    combs.white = Some(&nothing);
    let with_nan = separated(&combs, Method::Fitted);
    combs.white = None;
    let without = separated(&combs, Method::Fitted);
    assert_eq!(with_nan, without);
    assert!((without.iter().sum::<f32>() / truth.iter().sum::<f32>() - 1.0).abs() < 1e-5);
}

#[test]
fn a_white_frame_that_contradicts_the_combs_darkens_nothing() {
    let truth: Vec<f32> = (0..36).map(|i| 1.0 + (i % 5) as f32).collect();
    let photographs = Photographed::new(6, 3, &truth);
    let mut combs = photographs.combs();
    combs.white = None;
    let without = separated(&combs, Method::Fitted);
    for white in &[[0.0], [-0.3], [1e-3], [1e6], [f32::NAN]] {
        combs.white = Some(white);
        assert_eq!(separated(&combs, Method::Fitted), without, "a white frame of {white:?}");
    }
}

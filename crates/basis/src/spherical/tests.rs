//! Claims about regions and triangles together, on made, random and real sets of sites.

use super::{SphericalError, Triangulation, Weights, hemisphere_voronoi, hemisphere_voronoi_areas};
use glam::DVec3;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use std::f64::consts::{PI, TAU};
use std::ops::Range;

/// The same random cases in every run.
pub(super) fn seeded(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, rng_seed: RngSeed::Fixed(7), failure_persistence: None, ..ProptestConfig::default() }
}

/// n directions spread evenly by area over z ≥ lowest.
pub(super) fn spiral(n: usize, lowest: f64) -> Vec<DVec3> {
    let golden = PI * (3.0 - 5.0_f64.sqrt());
    let at = |k: usize| direction(lowest + (1.0 - lowest) * (k as f64 + 0.5) / n as f64, k as f64 * golden);
    (0..n).map(at).collect()
}

/// n directions at one elevation \[rad\].
pub(super) fn ring(n: usize, elevation: f64) -> Vec<DVec3> {
    (0..n).map(|k| direction(elevation.sin(), k as f64 * TAU / n as f64)).collect()
}

/// Random sites, some a little below the horizon, none nearer than 1e-4 to another.
pub(super) fn sites(count: Range<usize>) -> impl Strategy<Value = Vec<DVec3>> {
    proptest::collection::vec((-0.1_f64..1.0, 0.0..TAU), count).prop_map(|drawn| {
        let mut sites: Vec<DVec3> = Vec::new();
        for site in drawn.into_iter().map(|(z, azimuth)| direction(z, azimuth)) {
            if sites.iter().all(|other| other.distance(site) > 1e-4) {
                sites.push(site);
            }
        }
        sites
    })
}

fn direction(z: f64, azimuth: f64) -> DVec3 {
    let (sin, cos) = azimuth.sin_cos();
    let across = (1.0 - z * z).max(0.0).sqrt();
    DVec3::new(across * cos, across * sin, z)
}

/// The positions of the regular partition.
fn grid(azimuths: usize, tilts: usize) -> Vec<DVec3> {
    let step = 0.5 * PI / tilts as f64;
    let centre = |p: usize| {
        let (i, j) = ((p % azimuths) as f64, (p / azimuths) as f64);
        direction(((j + 0.5) * step).cos(), (i + 0.5) * TAU / azimuths as f64)
    };
    (0..azimuths * tilts).map(centre).collect()
}

fn blend(weights: &Weights, sites: &[DVec3]) -> DVec3 {
    weights.into_iter().map(|(site, weight)| sites[site] * weight).sum()
}

fn difference(a: &Weights, b: &Weights) -> f64 {
    let of = |weights: &Weights, site: usize| -> f64 {
        weights.into_iter().filter(|entry| entry.0 == site).map(|entry| entry.1).sum()
    };
    let both = a.into_iter().chain(b).map(|entry| entry.0);
    both.map(|site| (of(a, site) - of(b, site)).abs()).fold(0.0, f64::max)
}

/// Follows the largest change along an arc down to a gap of 1e-13: what is left there would be a jump.
fn check_continuous(triangulation: &Triangulation, from: DVec3, to: DVec3) -> Result<(), TestCaseError> {
    const STEPS: usize = 64;
    let at = |t: f64| (from * (1.0 - t) + to * t).normalize_or(DVec3::Z);
    let weights = |t: f64| triangulation.weights(at(t));
    for step in 0..STEPS {
        let (mut low, mut high) = (step as f64 / STEPS as f64, (step + 1) as f64 / STEPS as f64);
        while high - low > 1e-13 {
            let middle = 0.5 * (low + high);
            let (a, b, c) = (weights(low), weights(middle), weights(high));
            if difference(&a, &b) > difference(&b, &c) { high = middle } else { low = middle }
        }
        let jump = difference(&weights(low), &weights(high));
        prop_assert!(jump < 1e-6, "jump of {jump} at {} of {:?}", at(low), triangulation.sites());
    }
    Ok(())
}

/// What every set of sites must keep to.
fn check_weights(sites: &[DVec3]) -> Result<Triangulation, TestCaseError> {
    let triangulation = Triangulation::new(sites).unwrap();
    for (index, &site) in sites.iter().enumerate() {
        let weights = triangulation.weights(site);
        prop_assert_eq!(weights.as_slice(), &[(index, 1.0)]);
        prop_assert_eq!(triangulation.nearest(site), index);
    }
    for direction in spiral(700, 0.0) {
        let weights = triangulation.weights(direction);
        prop_assert!((weights.into_iter().map(|entry| entry.1).sum::<f64>() - 1.0).abs() < 1e-15);
        prop_assert!(weights.into_iter().all(|(site, weight)| site < sites.len() && weight > 0.0));
        if triangulation.covers(direction) {
            prop_assert!(blend(&weights, sites).normalize().distance(direction) < 1e-9);
        }
        let plain = (0..sites.len())
            .min_by(|&a, &b| sites[a].distance_squared(direction).total_cmp(&sites[b].distance_squared(direction)));
        let (fast, plain) = (triangulation.nearest(direction), plain.unwrap());
        prop_assert!(sites[fast].distance(direction) - sites[plain].distance(direction) < 1e-13);
    }
    let probes = spiral(12, 0.0);
    for pair in probes.windows(2) {
        check_continuous(&triangulation, pair[0], pair[1])?;
    }
    for (k, probe) in probes.iter().enumerate() {
        check_continuous(&triangulation, *probe, sites[k % sites.len()])?;
        check_continuous(&triangulation, *probe, DVec3::Z)?;
    }
    // Along the horizon and just above it, all around.
    for quarter in 0..4 {
        let [a, b] = [0.0, 1.0].map(|k| (f64::from(quarter) + k) * PI / 2.0);
        check_continuous(&triangulation, direction(0.0, a), direction(0.0, b))?;
        check_continuous(&triangulation, direction(0.02, a + 0.3), direction(0.02, b + 0.3))?;
    }
    Ok(triangulation)
}

fn check_regions(sites: &[DVec3]) -> Result<(), TestCaseError> {
    let regions = hemisphere_voronoi(sites).unwrap();
    let total: f64 = regions.iter().map(super::VoronoiRegion::area).sum();
    prop_assert!((total - TAU).abs() < 1e-9, "{} off", total - TAU);
    // Stratified samples of a region are nearest to its site.
    for (site, region) in regions.iter().enumerate().filter(|(_, region)| region.area() > 0.0) {
        for k in 0..25 {
            let direction = region.sample((f64::from(k % 5) + 0.5) / 5.0, (f64::from(k / 5) + 0.5) / 5.0);
            prop_assert!(direction.z > -1e-12);
            let nearest = sites.iter().map(|other| other.distance(direction)).fold(f64::INFINITY, f64::min);
            prop_assert!(sites[site].distance(direction) - nearest < 1e-9);
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(seeded(40))]

    #[test]
    fn areas_of_random_sites_sum_to_the_hemisphere(sites in sites(1..200)) {
        check_regions(&sites)?;
    }

    #[test]
    fn random_sites_share_light_continuously(sites in sites(1..40)) {
        check_weights(&sites)?;
    }

    #[test]
    fn a_crowd_on_one_side_shares_light_continuously(
        sites in sites(3..20), towards in 0.0..TAU, shift in 0.5_f64..4.0
    ) {
        let shift = direction(0.1, towards) * shift;
        let sites: Vec<DVec3> = sites.iter().map(|&site| (site + shift).normalize()).collect();
        prop_assume!(sites.iter().all(|site| site.z > -0.2));
        check_weights(&sites)?;
    }

    #[test]
    fn nearly_one_great_circle_shares_light_continuously(
        offsets in proptest::collection::vec((-1.4_f64..1.4, -1.0_f64..1.0), 2..20), thickness in -9_i32..0
    ) {
        let width = 10.0_f64.powi(thickness);
        let site = |&(along, across): &(f64, f64)| DVec3::new(along.sin(), across * width, along.cos()).normalize();
        let sites: Vec<DVec3> = offsets.iter().map(site).collect();
        let apart = |(k, a): (usize, &DVec3)| sites[..k].iter().all(|b| a.distance(*b) > 1e-3);
        prop_assume!(sites.iter().enumerate().all(apart));
        check_weights(&sites)?;
    }
}

#[test]
fn one_site_owns_everything() {
    for site in [DVec3::Z, DVec3::X, DVec3::new(0.9, 0.1, -0.1)] {
        assert!((hemisphere_voronoi_areas(&[site]).unwrap()[0] - TAU).abs() < 1e-14);
        let triangulation = Triangulation::new(&[site]).unwrap();
        assert!(spiral(100, 0.0).iter().all(|&d| triangulation.weights(d).as_slice() == [(0, 1.0)]));
    }
}

#[test]
fn symmetric_sites_own_equal_areas() {
    let octants: Vec<DVec3> = [(1, 1), (-1, 1), (-1, -1), (1, -1)]
        .iter()
        .flat_map(|&(x, y)| [DVec3::new(f64::from(x), f64::from(y), 0.4), DVec3::new(f64::from(x), f64::from(y), 3.0)])
        .collect();
    let areas = hemisphere_voronoi_areas(&octants).unwrap();
    assert!(areas.iter().enumerate().all(|(k, area)| (area - areas[k % 2]).abs() < 1e-14));
    let wedges = hemisphere_voronoi_areas(&ring(7, 0.2)).unwrap();
    assert!(wedges.iter().all(|area| (area - TAU / 7.0).abs() < 1e-14));
}

#[test]
fn areas_are_the_share_of_directions_nearest() {
    let sites = [ring(5, 0.1), ring(3, 0.9), vec![direction(0.99, 2.0), direction(-0.15, 1.0)]].concat();
    let (regions, triangulation) = (hemisphere_voronoi(&sites).unwrap(), Triangulation::new(&sites).unwrap());
    const N: usize = 400_000;
    let mut owned = vec![(0.0, DVec3::ZERO); sites.len()];
    for direction in spiral(N, 0.0) {
        let (count, sum) = &mut owned[triangulation.nearest(direction)];
        *count += 1.0;
        *sum += direction;
    }
    for (region, (count, sum)) in regions.iter().zip(owned) {
        assert!((region.area() - TAU * count / N as f64).abs() < 2e-3, "{} {count}", region.area());
        // The mean of stratified samples is the mean of the region.
        let side = 600;
        let strata = (0..side * side).map(|k| [k % side, k / side].map(|t| (f64::from(t) + 0.5) / f64::from(side)));
        let mean = strata.map(|[u, v]| region.sample(u, v)).sum::<DVec3>() / f64::from(side * side);
        assert!(mean.distance(sum / count) < 1e-3, "{mean} {}", sum / count);
    }
}

#[test]
fn the_regular_grid_works() {
    let sites = grid(12, 4);
    check_regions(&sites).unwrap();
    let triangulation = check_weights(&sites).unwrap();
    // Three bands of twelve quads and the cap of the innermost ring.
    assert_eq!(triangulation.triangles().len(), 3 * 12 * 2 + 10);
    // Below the lowest ring two neighbours of that ring share the light, half and half below the middle of their arc.
    let below = triangulation.weights(direction(0.05, TAU / 12.0));
    assert_eq!(below.as_slice().len(), 2);
    assert!(below.into_iter().all(|(site, weight)| (36..38).contains(&site) && (weight - 0.5).abs() < 1e-12));
}

#[test]
fn equally_near_sites_give_the_lowest_index() {
    let (azimuths, sites) = (36, grid(36, 9));
    let triangulation = Triangulation::new(&sites).unwrap();
    // The zenith is as near to the whole first ring; the middle of two neighbours in a ring is near to both.
    assert_eq!(triangulation.nearest(DVec3::Z), 0);
    for (a, &site) in sites.iter().enumerate() {
        let b = if a % azimuths + 1 == azimuths { a + 1 - azimuths } else { a + 1 };
        assert_eq!(triangulation.nearest(site + sites[b]), a.min(b));
    }
}

#[test]
fn sites_on_one_great_circle_work() {
    let meridian = |tilts: &[f64]| tilts.iter().map(|t| DVec3::new(t.sin(), 0.0, t.cos())).collect::<Vec<_>>();
    let slanted = |sites: Vec<DVec3>| sites.iter().map(|p| DVec3::new(p.x, p.z * 0.6, p.z * 0.8)).collect::<Vec<_>>();
    let sets = [
        ring(12, 0.0),
        ring(3, 0.02),
        meridian(&[-1.2, -0.5, 0.1, 0.4, 1.3]),
        slanted(meridian(&[-1.0, -0.5, 0.1, 0.4, 1.5])),
        meridian(&[0.3, 0.4]),
        meridian(&[-1.5, 1.5]),
    ];
    for sites in sets {
        check_regions(&sites).unwrap();
        let triangulation = check_weights(&sites).unwrap();
        assert!(triangulation.triangles().is_empty());
        let between = (sites[0] + sites[1]).normalize();
        assert!(blend(&triangulation.weights(between), &sites).normalize().distance(between) < 0.03);
    }
    // Two opposite sites are joined over the zenith.
    let opposite = Triangulation::new(&[DVec3::X, DVec3::NEG_X]).unwrap();
    assert_eq!(opposite.weights(DVec3::Z).as_slice().len(), 2);
    assert!((opposite.weights(DVec3::new(1.0, 0.0, 1.0)).as_slice()[0].1 - 0.75).abs() < 1e-12);
}

#[test]
fn low_and_dented_rings_work() {
    let sets = [
        [ring(9, -0.1), vec![DVec3::Z]].concat(),
        [ring(9, -0.1), ring(5, 0.05)].concat(),
        [ring(24, 0.0), ring(12, 0.6)].concat(),
        (0..24).map(|k| direction(0.02 + 0.015 * f64::from(k * 7 % 5), f64::from(k) * TAU / 24.0)).collect(),
        [
            spiral(30, 0.3),
            (0..24).map(|k| direction(0.004 * f64::from(k * 7 % 5), f64::from(k) * TAU / 24.0)).collect(),
        ]
        .concat(),
        ring(8, -0.1),
        vec![direction(-0.1, 0.0), direction(-0.05, 0.1), direction(-0.15, 0.15)],
        vec![DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::new(0.0, 0.7, 0.7)],
    ];
    for sites in sets {
        let sites: Vec<DVec3> = sites.iter().map(|site| site.normalize()).collect();
        check_regions(&sites).unwrap();
        check_weights(&sites).unwrap();
    }
}

#[test]
fn flat_triangles_at_the_border_are_outside() {
    // A band along a meridian, 0.5° wide. The sliver of its two ends and a site on its side is left out; another one
    // is flat too, but without it the last site would have no triangle.
    let band = [(-0.5_f64, 0.0086_f64), (1.3, 0.0), (0.0, 0.0), (-0.35, 0.0), (-1.05, 0.0099)];
    let sites: Vec<DVec3> = band.map(|(tilt, y)| DVec3::new(tilt.sin(), y, tilt.cos()).normalize()).to_vec();
    let triangulation = check_weights(&sites).unwrap();
    assert_eq!(triangulation.triangles(), [[0, 4, 3], [0, 3, 2], [0, 2, 1]]);
}

#[test]
fn unusable_sites_are_refused() {
    use SphericalError::{BelowHorizon, Coincident, NoDirection, NoSites};
    let refuse = |sites: &[DVec3]| {
        let error = Triangulation::new(sites).unwrap_err();
        assert_eq!(hemisphere_voronoi_areas(sites).map_err(|error| error.to_string()), Err(error.to_string()));
        error
    };
    assert_eq!(refuse(&[]), NoSites);
    assert!(matches!(refuse(&[DVec3::Z, DVec3::ZERO]), NoDirection { index: 1, .. }));
    assert!(matches!(refuse(&[DVec3::splat(f64::NAN)]), NoDirection { index: 0, .. }));
    assert!(matches!(refuse(&[DVec3::Z, DVec3::X, DVec3::NEG_Z]), BelowHorizon { index: 2, .. }));
    let twice = refuse(&[DVec3::Z, DVec3::X, DVec3::Y, DVec3::new(1.0, 0.0, 1e-7)]);
    assert!(matches!(twice, Coincident { first: 1, second: 3, .. }), "{twice}");
}

#[test]
fn any_finite_query_is_answered() {
    let triangulation = Triangulation::new(&grid(12, 4)).unwrap();
    for query in [DVec3::ZERO, DVec3::NEG_Z, DVec3::splat(1e300), DVec3::splat(-1e-300), DVec3::new(1e-320, 0.0, 0.0)] {
        assert!(!triangulation.weights(query).as_slice().is_empty());
        assert!(triangulation.nearest(query) < 48);
    }
}

#[test]
fn real_domes_work() {
    let data = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    for dome in ["rti_lion240", "rti_icon72", "RealRTI/item8", "RealRTI/item10", "RealRTI/item11"] {
        let Ok(text) = std::fs::read_to_string(data.join(dome).join("dirs.lp")) else {
            println!("skipped: no {dome}/dirs.lp");
            continue;
        };
        let count: usize = text.lines().next().unwrap().trim().parse().unwrap();
        let site = |line: &str| {
            let numbers: Vec<f64> = line.split_whitespace().skip(1).map_while(|word| word.parse().ok()).collect();
            (numbers.len() == 3).then(|| DVec3::new(numbers[0], numbers[1], numbers[2]).normalize())
        };
        let sites: Vec<DVec3> = text.lines().skip(1).filter_map(site).collect();
        assert_eq!(sites.len(), count, "{dome}");
        check_regions(&sites).unwrap();
        check_weights(&sites).unwrap();
    }
}

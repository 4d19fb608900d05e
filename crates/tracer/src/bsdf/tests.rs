//! Claims that hold for every material: samples agree with densities, nothing shines more than it gets, and light goes both
//! ways alike.

use glam::Vec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::*;
use crate::Texture;

fn constant(x: f32, y: f32, z: f32) -> Texture {
    Texture::Constant(Vec3::new(x, y, z))
}

fn materials() -> Vec<(&'static str, Material)> {
    let rough = |alpha: f32| Material::Glass { index: 1.5, alpha, tint: Vec3::ONE };
    let layered = |roughness: f32, metallic: f32, transmission: f32, solid: bool| Material::MetallicRoughness {
        base_colour: constant(0.9, 0.6, 0.3),
        roughness_metallic: constant(0.0, roughness, metallic),
        index: 1.5,
        transmission,
        solid,
    };
    vec![
        ("diffuse", Material::Diffuse { reflectance: constant(0.8, 0.5, 0.2) }),
        ("gold", Material::Conductor { eta: Vec3::new(0.14, 0.37, 1.44), k: Vec3::new(3.98, 2.39, 1.6), alpha: 0.25 }),
        ("ivory", Material::Plastic { diffuse: constant(0.7, 0.6, 0.42), index: 1.49, alpha: 0.15 }),
        ("rough glass", rough(0.3)),
        ("smooth glass", rough(0.0)),
        ("painted", layered(0.5, 0.0, 0.0, false)),
        ("half metal", layered(0.4, 0.5, 0.0, false)),
        ("pane", layered(0.4, 0.0, 0.8, false)),
        ("body of glass", layered(0.5, 0.0, 0.9, true)),
    ]
}

fn directions() -> [Vec3; 3] {
    [
        Vec3::new(0.0, 0.1, 1.0).normalize(),
        Vec3::new(0.6, -0.2, 0.7).normalize(),
        Vec3::new(-0.9, 0.2, 0.25).normalize(),
    ]
}

fn sides(bsdf: &Bsdf, material: &Material) -> Vec<Varying> {
    let sides = if bsdf.transmits() { vec![true, false] } else { vec![true] };
    sides.into_iter().map(|outside| Bsdf::varying(material, Vec2::ZERO, outside)).collect()
}

#[test]
fn samples_and_densities_give_the_same_albedo() {
    let mut rng = Pcg64::seed_from_u64(1);
    for (name, material) in materials() {
        let bsdf = Bsdf::new(&material, &mut Coats::new());
        if bsdf.is_specular() {
            continue;
        }
        for at in sides(&bsdf, &material) {
            for wo in directions() {
                let n = 400_000;
                let (mut sampled, mut squares, mut uniform, mut density) = (0.0, 0.0, 0.0, 0.0);
                for _ in 0..n {
                    let u = [rng.random(), rng.random(), rng.random()];
                    let weight = bsdf.sample(&at, wo, u).map_or(0.0, |scattered| scattered.weight.x);
                    sampled += f64::from(weight);
                    squares += f64::from(weight * weight);
                    let z = 2.0 * rng.random::<f32>() - 1.0;
                    let (sine, cosine) = (TAU * rng.random::<f32>()).sin_cos();
                    let r = (1.0 - z * z).sqrt();
                    let wi = Vec3::new(r * cosine, r * sine, z);
                    uniform += f64::from(2.0 * TAU * bsdf.value(&at, wo, wi).x);
                    density += f64::from(2.0 * TAU * bsdf.density(&at, wo, wi));
                }
                let n = f64::from(n);
                let (sampled, uniform, density) = (sampled / n, uniform / n, density / n);
                let error = ((squares / n - sampled * sampled).max(0.0) / n).sqrt();
                // The uniform estimate of a peak is the noisier one: a few per cent.
                let close = (sampled - uniform).abs() < 5.0 * error + 0.04 * sampled;
                assert!(close, "{name} from {wo}, outside {}: {sampled} ± {error}, uniform {uniform}", at.outside);
                assert!(density < 1.04, "{name} from {wo}: the density adds up to {density}");
            }
        }
    }
}

#[test]
fn nothing_shines_more_than_it_gets() {
    let mut rng = Pcg64::seed_from_u64(2);
    for (name, material) in materials() {
        let bsdf = Bsdf::new(&material, &mut Coats::new());
        let at = Bsdf::varying(&material, Vec2::ZERO, true);
        for wo in directions() {
            let n = 50_000;
            let (mut sum, mut squares) = (0.0, 0.0);
            for _ in 0..n {
                let u = [rng.random(), rng.random(), rng.random()];
                let weight = bsdf.sample(&at, wo, u).map_or(0.0, |scattered| {
                    // Radiance that enters a denser body is squeezed; flux is what cannot grow.
                    let squeezed = match &material {
                        Material::Glass { .. } if scattered.wi.z < 0.0 => 1.5 * 1.5,
                        Material::MetallicRoughness { solid: true, .. } if scattered.wi.z < 0.0 => 1.5 * 1.5,
                        _ => 1.0,
                    };
                    f64::from(scattered.weight.max_element()) * squeezed
                });
                sum += weight;
                squares += weight * weight;
            }
            let mean = sum / f64::from(n);
            let error = ((squares / f64::from(n) - mean * mean).max(0.0) / f64::from(n)).sqrt();
            assert!(mean <= 1.0 + 3.0 * error + 1e-5, "{name} from {wo}: {mean} ± {error}");
            if name == "smooth glass" {
                assert!((mean - 1.0).abs() < 1e-5, "clear glass loses nothing: {mean}");
            }
        }
    }
}

#[test]
fn light_goes_both_ways_alike() {
    // f(wo, wi) = f(wi, wo); through an interface f(wo, wi)/η²ₒ = f(wi, wo)/η²ᵢ.
    let (a, b) = (Vec3::new(0.5, 0.1, 0.8).normalize(), Vec3::new(-0.3, 0.4, 0.6).normalize());
    for (name, material) in materials() {
        let bsdf = Bsdf::new(&material, &mut Coats::new());
        let at = Bsdf::varying(&material, Vec2::ZERO, true);
        let there = bsdf.value(&at, a, b) / b.z;
        let back = bsdf.value(&at, b, a) / a.z;
        assert!((there - back).abs().max_element() <= 1e-4 * there.max_element(), "{name}: {there} and {back}");
    }
    let glass = Material::Glass { index: 1.5, alpha: 0.4, tint: Vec3::ONE };
    let bsdf = Bsdf::new(&glass, &mut Coats::new());
    let wo = Vec3::new(0.4, 0.0, 0.9).normalize();
    let below = Vec3::new(-0.2, 0.1, -0.95).normalize();
    // Seen from inside, z points the other way.
    let flip = |w: Vec3| Vec3::new(w.x, w.y, -w.z);
    let in_ = bsdf.value(&Bsdf::varying(&glass, Vec2::ZERO, true), wo, below).x / below.z.abs();
    let out = bsdf.value(&Bsdf::varying(&glass, Vec2::ZERO, false), flip(below), flip(wo)).x / wo.z;
    assert!((in_ * 1.5 * 1.5 / out - 1.0).abs() < 1e-4, "{in_} in, {out} out");
}

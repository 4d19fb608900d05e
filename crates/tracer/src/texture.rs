//! Colours that vary over a surface.

use std::sync::Arc;

use glam::{Affine2, Vec2, Vec3};
use relumine_radiometry::{Image, Linear};

/// A linear RGB value for every point of a surface.
#[derive(Clone, Debug)]
pub enum Texture {
    /// The same everywhere.
    Constant(Vec3),
    /// Two colours in turn, in fields of `1 / fields` units of texture coordinates.
    Checkerboard {
        /// The colour of the field at (0, 0).
        even: Vec3,
        /// The colour of its neighbours.
        odd: Vec3,
        /// Fields a unit along u and v.
        fields: Vec2,
    },
    /// A picture.
    Picture(TexturePicture),
}

/// A picture laid over texture coordinates: (0, 0) is its upper left corner, v points downward; bilinear between pixel
/// centres.
#[derive(Clone, Debug)]
pub struct TexturePicture {
    /// Linear samples; whoever reads the file has decoded sRGB where the file means colour.
    pub picture: Arc<Image<Linear>>,
    /// What the samples are multiplied with.
    pub factor: Vec3,
    /// What happens beyond the borders, along u and v.
    pub wrap: [Wrap; 2],
    /// From the mesh's texture coordinates to the picture's.
    pub picture_from_mesh: Affine2,
}

/// What a picture shows beyond its borders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// Begins again.
    #[default]
    Repeat,
    /// Begins again, mirrored.
    Mirror,
    /// Its border goes on.
    Clamp,
}

impl Texture {
    /// The value at texture coordinates `uv`.
    pub fn at(&self, uv: Vec2) -> Vec3 {
        match self {
            Self::Constant(value) => *value,
            Self::Checkerboard { even, odd, fields } => {
                let field = (uv * *fields).floor();
                if (field.x + field.y).rem_euclid(2.0) < 0.5 { *even } else { *odd }
            }
            Self::Picture(picture) => picture.at(uv),
        }
    }
}

impl TexturePicture {
    fn at(&self, uv: Vec2) -> Vec3 {
        let (width, height) = self.picture.size();
        let size = Vec2::new(width as f32, height as f32);
        // A whole number of pictures away everything looks the same (mirrored, of two): far coordinates keep their digits.
        let uv = self.picture_from_mesh.transform_point2(uv);
        let near = |value: f32, wrap: Wrap| match wrap {
            Wrap::Repeat | Wrap::Mirror => value.rem_euclid(2.0),
            Wrap::Clamp => value.clamp(-1.0, 2.0),
        };
        let place = Vec2::new(near(uv.x, self.wrap[0]), near(uv.y, self.wrap[1])) * size - 0.5;
        let corner = place.floor();
        let share = place - corner;
        let column = |step: i64| self.wrap[0].index(corner.x as i64 + step, width);
        let row = |step: i64| self.wrap[1].index(corner.y as i64 + step, height);
        let at = |x: usize, y: usize| Vec3::from_array(self.picture.pixel(x, y));
        let (left, right, top, bottom) = (column(0), column(1), row(0), row(1));
        let above = at(left, top).lerp(at(right, top), share.x);
        let below = at(left, bottom).lerp(at(right, bottom), share.x);
        above.lerp(below, share.y) * self.factor
    }
}

impl Wrap {
    fn index(self, index: i64, length: usize) -> usize {
        let n = length as i64;
        let index = match self {
            Self::Repeat => index.rem_euclid(n),
            Self::Mirror => {
                let within = index.rem_euclid(2 * n);
                within.min(2 * n - 1 - within)
            }
            Self::Clamp => index.clamp(0, n - 1),
        };
        index as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_begins_at_its_upper_left_corner_and_wraps_as_told() {
        let picture = Arc::new(Image::from_pixels(4, 1, (0..4).map(|x| [x as f32, 0.0, 0.0]).collect()));
        let at = |wrap: Wrap, u: f32| {
            let picture = picture.clone();
            let texture = TexturePicture {
                picture,
                factor: Vec3::splat(2.0),
                wrap: [wrap; 2],
                picture_from_mesh: Affine2::IDENTITY,
            };
            Texture::Picture(texture).at(Vec2::new(u, 0.3)).x / 2.0
        };
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            assert_eq!((at(wrap, 0.125), at(wrap, 0.5), at(wrap, 0.875)), (0.0, 1.5, 3.0));
        }
        assert_eq!((at(Wrap::Repeat, 1.0), at(Wrap::Mirror, 1.0), at(Wrap::Clamp, 1.0)), (1.5, 3.0, 3.0));
        assert_eq!((at(Wrap::Repeat, -0.375), at(Wrap::Mirror, -0.375), at(Wrap::Clamp, -9.0)), (2.0, 1.0, 0.0));
    }

    #[test]
    fn fields_of_a_checkerboard_alternate_both_ways() {
        let board = Texture::Checkerboard { even: Vec3::ONE, odd: Vec3::ZERO, fields: Vec2::splat(2.0) };
        let at = |u: f32, v: f32| board.at(Vec2::new(u, v)).x;
        assert_eq!((at(0.1, 0.1), at(0.6, 0.1), at(0.6, 0.6), at(-0.1, 0.1)), (1.0, 0.0, 1.0, 0.0));
    }
}

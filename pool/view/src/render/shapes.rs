//! The outlines of bodies: discs for allies, hexagons (small ones: diamonds) for enemies, and the parts of
//! them that show values.

use glam::Vec2;
use smaclite_scenarios::Faction;

/// The distance of corners from the centre, in radii of the unit: with these a hexagon and a diamond cover
/// the area of the disc.
const HEXAGON_CORNER: f32 = 1.1;
const DIAMOND_CORNER: f32 = 1.253;

/// With a smaller radius in pixels a hexagon looks like a disc, a diamond does not.
const MIN_RADIUS_OF_HEXAGONS: f32 = 5.5;

/// A closed outline around (0, 0) of a unit with radius 1: corners at equal distances, clockwise from the
/// northern one. y grows downwards, as in pictures.
#[derive(Clone, Debug)]
pub(crate) struct Outline {
    corners: Vec<Vec2>,
}

impl Outline {
    fn regular(n: u32, distance: f32) -> Outline {
        let corner = |i: u32| {
            let angle = std::f32::consts::TAU * i as f32 / n as f32;
            Vec2::new(angle.sin(), -angle.cos()) * distance
        };
        Outline { corners: (0..n).map(corner).collect() }
    }

    /// The outline around a point with a radius.
    pub fn at(&self, centre: Vec2, radius: f32) -> impl Iterator<Item = Vec2> {
        self.corners.iter().map(move |corner| centre + corner * radius)
    }

    /// The directions from the centre to the corners.
    pub fn corners(&self) -> &[Vec2] {
        &self.corners
    }

    /// The upper part of the outline: what is empty of a vessel that is filled to `share` of its height.
    pub fn filled_above(&self, centre: Vec2, radius: f32, share: f32) -> impl Iterator<Item = Vec2> {
        // The first corner is the highest point, and the outline is point-symmetric.
        let level = self.corners[0].y * (2.0 * share - 1.0);
        let next = self.corners.iter().cycle().skip(1);
        self.corners.iter().zip(next).flat_map(move |(&a, &b)| {
            let crossing = ((a.y < level) != (b.y < level)).then(|| a.lerp(b, (level - a.y) / (b.y - a.y)));
            let above = (a.y < level).then_some(a);
            [above, crossing].into_iter().flatten().map(move |corner| centre + corner * radius)
        })
    }

    /// A band between two radii that goes clockwise from north along `share` of the outline.
    pub fn band(&self, centre: Vec2, inner: f32, outer: f32, share: f32) -> impl Iterator<Item = Vec2> {
        let n = self.corners.len();
        let end = share.clamp(0.0, 1.0) * n as f32;
        let whole = end as usize;
        let last = self.corners[whole % n].lerp(self.corners[(whole + 1) % n], end.fract());
        let ahead = (0..=whole).map(move |i| self.corners[i % n]).chain([last]);
        let back = [last].into_iter().chain((0..=whole).rev().map(move |i| self.corners[i % n]));
        ahead
            .map(move |corner| centre + corner * outer)
            .chain(back.map(move |corner| centre + corner * inner))
    }
}

/// The outlines of all bodies.
#[derive(Clone, Debug)]
pub(crate) struct Shapes {
    discs: [Outline; 4],
    hexagon: Outline,
    diamond: Outline,
}

impl Shapes {
    pub fn new() -> Shapes {
        let disc = |n| Outline::regular(n, 1.0);
        Shapes {
            discs: [disc(24), disc(48), disc(96), disc(384)],
            hexagon: Outline::regular(6, HEXAGON_CORNER),
            diamond: Outline::regular(4, DIAMOND_CORNER),
        }
    }

    /// The outline of a faction's units at a radius in pixels.
    pub fn body(&self, faction: Faction, radius: f32) -> &Outline {
        match faction {
            Faction::Ally => self.disc(radius),
            Faction::Enemy if radius < MIN_RADIUS_OF_HEXAGONS => &self.diamond,
            Faction::Enemy => &self.hexagon,
        }
    }

    /// A disc that differs from a circle by less than a tenth of a pixel, up to a radius of 3000.
    pub fn disc(&self, radius: f32) -> &Outline {
        let [small, medium, large, huge] = &self.discs;
        match radius {
            ..10.0 => small,
            ..40.0 => medium,
            ..160.0 => large,
            _ => huge,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The area of a polygon, by the shoelace formula.
    fn area(corners: impl Iterator<Item = Vec2>) -> f32 {
        let corners: Vec<Vec2> = corners.collect();
        let next = corners.iter().cycle().skip(1);
        corners.iter().zip(next).map(|(a, b)| a.perp_dot(*b)).sum::<f32>().abs() / 2.0
    }

    fn check(outline: &Outline) {
        let whole = area(outline.at(Vec2::ZERO, 1.0));
        for share in [0.0, 0.25, 0.5, 1.0] {
            let filled = area(outline.filled_above(Vec2::ZERO, 1.0, share));
            let rest = area(outline.filled_above(Vec2::ZERO, 1.0, 1.0 - share));
            assert!((filled + rest - whole).abs() < 1e-4, "{share}: {filled} and {rest} of {whole}");
            let band = area(outline.band(Vec2::ZERO, 0.5, 1.0, share));
            assert!((band - 0.75 * whole * share).abs() < 1e-4, "{share}: a band of {band}");
        }
    }

    #[test]
    fn parts_of_outlines_have_their_share_of_the_area() {
        let shapes = Shapes::new();
        check(&shapes.hexagon);
        check(&shapes.diamond);
        shapes.discs.iter().for_each(check);
    }

    #[test]
    fn all_bodies_are_as_large_as_their_discs() {
        for radius in [3.0, 30.0] {
            let enemy = area(Shapes::new().body(Faction::Enemy, radius).at(Vec2::ZERO, 1.0));
            assert!((enemy / std::f32::consts::PI - 1.0).abs() < 0.01, "{enemy}");
        }
    }
}

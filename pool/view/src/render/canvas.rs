//! Filling polygons and letters on a grid of pixels.

use glam::Vec2;
use tiny_skia::{FillRule, Paint, Path, PathBuilder, Pixmap, Stroke, Transform};

use super::font::{Font, Place};
use super::theme::Ink;

/// Polygons are cut off at this distance from the picture, in pixels.
const GUARD: f32 = 256.0;

/// The height of the largest letters.
const MAX_LETTER: f32 = 4096.0;

pub(crate) struct Canvas {
    pixels: Pixmap,
    path: PathBuilder,
    /// The polygon that is being added, kept for its memory.
    corners: Vec<Vec2>,
}

impl Canvas {
    /// A canvas of one colour; `None` if a side is 0 or too large.
    pub fn new(width: u32, height: u32, ink: Ink) -> Option<Canvas> {
        let mut pixels = Pixmap::new(width, height)?;
        let [r, g, b, a] = ink.rgba();
        pixels.fill(tiny_skia::Color::from_rgba8(r, g, b, a));
        Some(Canvas::over(pixels))
    }

    /// A canvas on which these pixels are already drawn.
    pub fn over(pixels: Pixmap) -> Canvas {
        Canvas { pixels, path: PathBuilder::new(), corners: Vec::new() }
    }

    pub fn into_pixels(self) -> Pixmap {
        self.pixels
    }

    /// Fills a polygon.
    pub fn fill(&mut self, corners: impl IntoIterator<Item = Vec2>, ink: Ink) {
        self.add(corners);
        self.fill_path(ink, FillRule::Winding);
    }

    /// Adds a polygon to the path that [`fill_path`](Self::fill_path) fills. A polygon with a corner that is
    /// not finite has no place in a picture.
    pub fn add(&mut self, corners: impl IntoIterator<Item = Vec2>) {
        self.corners.clear();
        self.corners.extend(corners);
        if self.corners.iter().any(|corner| !corner.is_finite()) {
            return;
        }
        // tiny-skia panics at coordinates that are too large for its fixed-point numbers.
        let limit = Vec2::new(self.pixels.width() as f32, self.pixels.height() as f32) + GUARD;
        let is_far = |corner: &Vec2| corner.min_element() < -GUARD || corner.cmpgt(limit).any();
        if self.corners.iter().any(is_far) {
            self.clip(limit);
        }
        let mut corners = self.corners.iter();
        let Some(first) = corners.next() else { return };
        self.path.move_to(first.x, first.y);
        corners.for_each(|corner| self.path.line_to(corner.x, corner.y));
        self.path.close();
    }

    /// Cuts the polygon in `corners` to the picture and a margin, side by side (Sutherland and Hodgman,
    /// "Reentrant polygon clipping", 1974).
    fn clip(&mut self, limit: Vec2) {
        let sides: [fn(Vec2, Vec2) -> f32; 4] = [
            |corner, _| corner.x + GUARD,
            |corner, _| corner.y + GUARD,
            |corner, limit| limit.x - corner.x,
            |corner, limit| limit.y - corner.y,
        ];
        for distance in sides {
            let corners = std::mem::take(&mut self.corners);
            let next = corners.iter().cycle().skip(1);
            for (&a, &b) in corners.iter().zip(next) {
                let (from, to) = (distance(a, limit), distance(b, limit));
                if from >= 0.0 {
                    self.corners.push(a);
                }
                if (from >= 0.0) != (to >= 0.0) {
                    self.corners.push(a + (b - a) * (from / (from - to)));
                }
            }
        }
        // Between very distant corners the crossings are rounded.
        self.corners.iter_mut().for_each(|corner| *corner = corner.clamp(Vec2::splat(-GUARD), limit));
    }

    /// Adds a polygon whose corners are cut by curves that begin `radius` before them.
    pub fn add_rounded(&mut self, corners: &[Vec2], radius: f32) {
        let n = corners.len();
        for (i, &corner) in corners.iter().enumerate() {
            let towards = |other: Vec2| {
                let side = other - corner;
                corner + side * (radius / side.length().max(f32::MIN_POSITIVE)).min(0.5)
            };
            let (from, to) = (towards(corners[(i + n - 1) % n]), towards(corners[(i + 1) % n]));
            if i == 0 {
                self.path.move_to(from.x, from.y);
            } else {
                self.path.line_to(from.x, from.y);
            }
            self.path.quad_to(corner.x, corner.y, to.x, to.y);
        }
        self.path.close();
    }

    /// Fills the added polygons and removes them.
    pub fn fill_path(&mut self, ink: Ink, rule: FillRule) {
        let path = std::mem::take(&mut self.path).finish();
        // There is no path if nothing was added, or only points that are not finite.
        let Some(path) = path else { return };
        self.pixels.fill_path(&path, &paint(ink), rule, Transform::identity(), None);
        self.path = path.clear();
    }

    /// Mixes a colour into every pixel; `share` is that of the new colour, from 0 to 1.
    pub fn fill_pixels(&mut self, ink: Ink, share: impl Fn(u32, u32) -> f32) {
        let width = self.pixels.width();
        for (i, pixel) in (0..).zip(self.pixels.data_mut().chunks_exact_mut(4)) {
            let share = share(i % width, i / width);
            for (old, new) in pixel.iter_mut().zip(ink.rgba()) {
                *old = (f32::from(*old) * (1.0 - share) + f32::from(new) * share).round() as u8;
            }
        }
    }

    /// Draws the outlines of the added polygons and removes them.
    pub fn stroke_path(&mut self, ink: Ink, width: f32) {
        let path = std::mem::take(&mut self.path).finish();
        let Some(path) = path else { return };
        self.stroke(&path, ink, width, Transform::identity());
        self.path = path.clear();
    }

    fn stroke(&mut self, path: &Path, ink: Ink, width: f32, transform: Transform) {
        let stroke = Stroke { width, line_join: tiny_skia::LineJoin::Round, ..Stroke::default() };
        self.pixels.stroke_path(path, &paint(ink), &stroke, transform, None);
    }

    /// Fills a straight line that is `from_width` wide at its start and `to_width` at its end.
    pub fn line(&mut self, from: Vec2, to: Vec2, from_width: f32, to_width: f32, ink: Ink) {
        let across = (to - from).normalize_or_zero().perp() / 2.0;
        let (a, b) = (across * from_width, across * to_width);
        self.fill([from - a, from + a, to + b, to - b], ink);
    }

    /// Writes a text whose capitals are `height` pixels high.
    pub fn text(&mut self, text: &str, place: Place, height: f32, ink: Ink) {
        if !self.is_near(place, height) {
            return;
        }
        for (outline, transform) in Font::embedded().lay_out(text, place, height) {
            self.pixels.fill_path(outline, &paint(ink), FillRule::Winding, transform, None);
        }
    }

    /// Whether letters of this height are on the picture or near it.
    fn is_near(&self, place: Place, height: f32) -> bool {
        let (Place::Middle(at) | Place::Start(at)) = place;
        let size = Vec2::new(self.pixels.width() as f32, self.pixels.height() as f32);
        let is_inside = at.cmpge(Vec2::splat(-height)).all() && at.cmple(size + height).all();
        is_inside && height <= MAX_LETTER
    }

    /// Writes a text with a border of another colour, which keeps it readable on any background.
    pub fn text_with_border(&mut self, text: &str, place: Place, height: f32, ink: Ink, border: Ink) {
        if !self.is_near(place, height) {
            return;
        }
        for (outline, transform) in Font::embedded().lay_out(text, place, height) {
            // The width is in the outline's units, in which a capital has height 1.
            self.stroke(outline, border, 0.4, transform);
        }
        self.text(text, place, height, ink);
    }
}

fn paint(ink: Ink) -> Paint<'static> {
    let mut paint = Paint { anti_alias: true, ..Paint::default() };
    let [r, g, b, a] = ink.rgba();
    paint.set_color_rgba8(r, g, b, a);
    paint
}

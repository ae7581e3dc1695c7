//! Distances in f64, as the rules compare them.

use glam::Vec2;

/// The distance between two points in f64, as searches and comparisons use it.
pub(crate) fn distance(a: Vec2, b: Vec2) -> f64 {
    distance_squared(a, b).sqrt()
}

/// The square of [`distance`].
pub(crate) fn distance_squared(a: Vec2, b: Vec2) -> f64 {
    let (dx, dy) = (f64::from(a.x) - f64::from(b.x), f64::from(a.y) - f64::from(b.y));
    dx * dx + dy * dy
}

/// The greatest number whose square root is at most `distance`: `s.sqrt() <= distance` exactly if
/// `s <= square_within(distance)`. The rules compare roots; with this the root need not be computed.
pub(crate) fn square_within(distance: f64) -> f64 {
    if distance.is_nan() || distance < 0.0 || distance == f64::INFINITY {
        return distance;
    }
    // The rounded square is only a few steps off, and the root is correctly rounded and monotonic.
    let mut square = distance * distance;
    while square.sqrt() > distance {
        square = square.next_down();
    }
    while square.next_up().sqrt() <= distance {
        square = square.next_up();
    }
    square
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comparing_squares_is_comparing_distances() {
        for distance in [0.0, 1e-160, 0.1, 5.0f64.sqrt(), 6.0, 9.0, 6.75 + 0.375, 1e200] {
            let square = square_within(distance);
            assert!(square.sqrt() <= distance && square.next_up().sqrt() > distance, "{distance}: {square}");
        }
        assert_eq!([square_within(-1.0), square_within(f64::INFINITY)], [-1.0, f64::INFINITY]);
    }
}

//! The formation of a group: the start positions of its units. `groups` reads the groups.

use crate::Faction;

/// Space between the edges of adjacent units of a group, in squares.
const GAP: f64 = 0.05;

/// Start positions `[x, y]` of a group's units around its centre, in squares, in the order of their `radii`.
///
/// The group fills a square grid of side ceil(sqrt(n)) row by row. Allies fill it from the south-west,
/// enemies from the north-east, so equal groups are point-symmetric.
pub fn formation(centre: [f64; 2], faction: Faction, radii: &[f64]) -> Vec<[f64; 2]> {
    let direction = match faction {
        Faction::Ally => 1.0,
        Faction::Enemy => -1.0,
    };
    let side = (1..).find(|side| side * side >= radii.len()).unwrap_or(1);
    let rows: Vec<&[f64]> = radii.chunks(side).collect();
    let row_radii: Vec<f64> = rows.iter().map(|row| row.iter().copied().fold(0.0, f64::max)).collect();
    // The rule omits the gaps from the width, so wide groups are off-centre, towards their last column.
    let width = rows.iter().map(|row| row.iter().map(|radius| 2.0 * radius).sum()).fold(0.0, f64::max);
    // Rows that stay empty add no radius, but the rule includes their gaps.
    let height = 2.0 * row_radii.iter().sum::<f64>() + (side as f64 - 1.0) * GAP;

    let corner_x = centre[0] - direction * width / 2.0;
    let mut y = centre[1] - direction * height / 2.0;
    let mut previous_row = 0.0;
    let mut positions = Vec::with_capacity(radii.len());
    for (row, &row_radius) in rows.iter().zip(&row_radii) {
        y += direction * (previous_row + row_radius);
        let mut x = corner_x;
        let mut previous = 0.0;
        for &radius in *row {
            x += direction * (previous + radius);
            positions.push([x, y]);
            x += direction * GAP;
            previous = radius;
        }
        y += direction * GAP;
        previous_row = row_radius;
    }
    positions
}

#[cfg(test)]
mod tests {
    use super::{Faction, formation};

    fn check(centre: [f64; 2], faction: Faction, radii: &[f64], expected: &[[f64; 2]]) {
        let positions = formation(centre, faction, radii);
        assert_eq!(positions.len(), expected.len());
        for (position, expected) in positions.iter().zip(expected) {
            let near = (0..2).all(|axis| (position[axis] - expected[axis]).abs() < 1e-12);
            assert!(near, "{positions:?} must be {expected:?}");
        }
    }

    #[test]
    fn a_single_unit_stands_on_the_centre() {
        check([9.0, 16.0], Faction::Ally, &[0.5], &[[9.0, 16.0]]);
        check([9.0, 16.0], Faction::Enemy, &[0.5], &[[9.0, 16.0]]);
    }

    #[test]
    fn rows_of_different_sizes() {
        // Side 2: rows (1.0, 0.5) and (0.25). Width 3, height 2 * 1.25 + 0.05 = 2.55; corner (8.5, 8.725).
        // Row 0: y = 8.725 + 1; x = 8.5 + 1, then + 0.05 + 1.5. Row 1: y + 0.05 + 1.25; x = 8.5 + 0.25.
        let expected = [[9.5, 9.725], [11.05, 9.725], [8.75, 11.025]];
        check([10.0, 10.0], Faction::Ally, &[1.0, 0.5, 0.25], &expected);
        let mirrored = expected.map(|[x, y]| [20.0 - x, 20.0 - y]);
        check([10.0, 10.0], Faction::Enemy, &[1.0, 0.5, 0.25], &mirrored);
    }

    #[test]
    fn the_gaps_of_empty_rows_are_included() {
        // Side 3 for 5 units: rows of 3 and 2, the third empty. Width 3, height 2 * (0.5 + 0.5) + 0.1 = 2.1.
        let expected = [[-1.0, -0.55], [0.05, -0.55], [1.1, -0.55], [-1.0, 0.5], [0.05, 0.5]];
        check([0.0, 0.0], Faction::Ally, &[0.5; 5], &expected);
    }
}

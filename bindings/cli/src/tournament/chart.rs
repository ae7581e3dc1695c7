//! The matrix of a tournament as a heat map in SVG, in the style of the documentation's charts: transparent,
//! with text in the colours of light and of dark pages.

use super::report::score;
use crate::svg::{LETTER, escaped};
use smaclite_lab::TournamentResult;
use std::fmt::Write;

/// Side lengths of a cell, in pixels.
const CELL: [f64; 2] = [46.0, 26.0];

/// The sine and the cosine of the names of columns, which are tilted by 45 degrees.
const TILT: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Colours of no points, of one half of them, and of all.
const COLOURS: [[u8; 3]; 3] = [[0xd9, 0x73, 0x0d], [0xdd, 0xdd, 0xdd], [0x00, 0x60, 0xa8]];

const STYLE: &str = "text { font: 9px 'DejaVu Sans', sans-serif; fill: #24292f } \
    @media (prefers-color-scheme: dark) { text { fill: #d8dae0 } } \
    .dark { fill: #24292f } .light { fill: #ffffff }";

/// The share of points of the agents (rows) against the enemies (columns), in per cent. Pairings that were
/// not played stay empty.
pub(super) fn heat_map(result: &TournamentResult) -> String {
    let names: Vec<&str> = result.players.iter().map(|player| player.player.as_str()).collect();
    let longest = names.iter().map(|name| name.chars().count()).max().unwrap_or(0) as f64 * LETTER;
    let (left, top) = (longest + 12.0, TILT * longest + 22.0);
    let n = names.len() as f64;
    // The name of the last column leans to the right of it.
    let (width, height) = (left + n * CELL[0] + TILT * longest, top + n * CELL[1] + 4.0);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.1} {height:.1}\" \
         width=\"{width:.1}\" height=\"{height:.1}\">\n<style>{STYLE}</style>\n\
         <text x=\"4\" y=\"12\">points of the agents (rows) against the enemies (columns), %</text>\n"
    );
    for (i, name) in names.iter().enumerate() {
        let (x, y) = (left + (i as f64 + 0.5) * CELL[0], top + (i as f64 + 0.5) * CELL[1] + 3.0);
        let name = escaped(name);
        let (right, above) = (left - 6.0, top - 5.0);
        svg += &format!(
            "<text x=\"{right:.1}\" y=\"{y:.1}\" text-anchor=\"end\">{name}</text>\n\
             <text transform=\"translate({x:.1} {above:.1}) rotate(-45)\">{name}</text>\n"
        );
    }
    for (row, agents) in names.iter().enumerate() {
        for (column, enemies) in names.iter().enumerate() {
            if let Some(score) = score(result, agents, enemies) {
                let corner = [left + column as f64 * CELL[0], top + row as f64 * CELL[1]];
                let title =
                    format!("{agents} against {enemies}: {}-{}-{}", score.wins, score.draws, score.losses);
                svg += &cell(corner, score.points(), &title);
            }
        }
    }
    svg + "</svg>\n"
}

/// A cell, with a title that viewers show beside the pointer.
fn cell([x, y]: [f64; 2], points: f64, title: &str) -> String {
    let colour = colour(points);
    // Relative luminance, without the correction of gamma: enough to choose between two colours.
    let [red, green, blue] = colour.map(f64::from);
    let is_light = 0.3 * red + 0.59 * green + 0.11 * blue > 140.0;
    let class = if is_light { "dark" } else { "light" };
    let hex = colour.iter().fold(String::new(), |mut hex, part| {
        let _ = write!(hex, "{part:02x}"); // a string takes everything
        hex
    });
    let [width, height] = CELL.map(|side| side - 1.0);
    let (text_x, text_y) = (x + CELL[0] / 2.0, y + CELL[1] / 2.0 + 3.0);
    format!(
        "<g><title>{}</title><rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width}\" height=\"{height}\" \
         fill=\"#{hex}\"/><text class=\"{class}\" x=\"{text_x:.1}\" y=\"{text_y:.1}\" \
         text-anchor=\"middle\">{:.1}</text></g>\n",
        escaped(title),
        100.0 * points
    )
}

/// The colour of a share: between those of its neighbours among 0, 0.5 and 1.
fn colour(share: f64) -> [u8; 3] {
    let (from, to) = if share < 0.5 { (COLOURS[0], COLOURS[1]) } else { (COLOURS[1], COLOURS[2]) };
    let part = if share < 0.5 { 2.0 * share } else { 2.0 * share - 1.0 };
    std::array::from_fn(|i| (f64::from(from[i]) * (1.0 - part) + f64::from(to[i]) * part).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_go_from_lost_over_even_to_won() {
        assert_eq!([0.0, 0.5, 1.0].map(colour), COLOURS);
        assert_eq!(colour(0.75), [0x6f, 0x9f, 0xc3]);
    }
}

//! Charts in SVG in the style of the documentation's: transparent, with the colours of light or of dark
//! pages. All values are shares, 0 to 1.

use crate::svg::{LETTER, escaped};
use smaclite_learn::Estimate;
use std::fmt::Write;

/// The colours of a kind of pages.
pub(super) struct Theme {
    /// What it adds to the name of a file.
    pub suffix: &'static str,
    text: &'static str,
    grid: &'static str,
    series: [&'static str; 5],
}

/// Those of the documentation's charts.
pub(super) const THEMES: [Theme; 2] = [
    Theme {
        suffix: "",
        text: "#24292f",
        grid: "#dddddd",
        series: ["#0060a8", "#d9730d", "#208040", "#8a3fa0", "#808080"],
    },
    Theme {
        suffix: "-dark",
        text: "#d8dae0",
        grid: "#434853",
        series: ["#58a6f0", "#f0984c", "#58b878", "#c490e4", "#9a9da6"],
    },
];

/// A curve with its interval as a band.
pub(super) struct Line {
    pub name: String,
    /// The number of the algorithm, which decides the colour.
    pub place: usize,
    pub points: Vec<(f64, Estimate)>,
}

/// Curves over a common axis.
pub(super) struct Panel {
    pub title: String,
    pub x_label: String,
    pub lines: Vec<Line>,
}

/// A value with its interval.
pub(super) struct Bar {
    pub name: String,
    pub place: usize,
    pub estimate: Estimate,
}

/// The size of what is drawn in a panel, and the space around it for titles and numbers.
const PLOT: [f64; 2] = [220.0, 120.0];
const MARGIN: [f64; 2] = [40.0, 24.0];
const BELOW: f64 = 34.0;

/// The height of a row of text or of a bar.
const ROW: f64 = 18.0;

/// Panels in rows of at most `columns`, below a title and the names of the curves.
pub(super) fn lines(title: &str, panels: &[Panel], columns: usize, theme: &Theme) -> String {
    let columns = columns.min(panels.len()).max(1);
    let cell = [MARGIN[0] + PLOT[0] + 12.0, MARGIN[1] + PLOT[1] + BELOW];
    let mut names: Vec<(usize, &str)> = Vec::new();
    for line in panels.iter().flat_map(|panel| &panel.lines) {
        if !names.contains(&(line.place, &line.name)) {
            names.push((line.place, &line.name));
        }
    }
    let (legend, legend_width) = legend(&names, theme);
    let width = (columns as f64 * cell[0]).max(legend_width).max(text_width(title) + 16.0);
    let height = 2.0 * ROW + 6.0 + panels.len().div_ceil(columns) as f64 * cell[1];
    let mut svg = begin(title, [width, height], theme) + &legend;
    for (i, panel) in panels.iter().enumerate() {
        let (column, row) = (i % columns, i / columns);
        let x = column as f64 * cell[0] + MARGIN[0];
        let y = row as f64 * cell[1] + MARGIN[1] + 2.0 * ROW + 6.0;
        let _ = writeln!(svg, "<g transform=\"translate({x:.1} {y:.1})\">"); // a string takes everything
        svg += &(drawn(panel, theme) + "</g>\n");
    }
    svg + "</svg>\n"
}

/// Bars below each other; `mark` is a dashed line at a value.
pub(super) fn bars(title: &str, bars: &[Bar], mark: Option<f64>, theme: &Theme) -> String {
    let left = bars.iter().map(|bar| text_width(&bar.name)).fold(0.0, f64::max) + 16.0;
    let below = 2.0 * ROW + bars.len() as f64 * ROW;
    let width = (left + PLOT[0] + 60.0).max(text_width(title) + 16.0);
    let mut svg = begin(title, [width, below + ROW], theme);
    let x = |value: f64| left + value * PLOT[0];
    for tick in [0.0, 0.5, 1.0] {
        let (at, top, low) = (x(tick), 1.5 * ROW, below - 8.0);
        svg += &rule([at, top], [at, low], theme.grid, "");
        svg += &text([at, below + 4.0], "middle", &format!("{:.0} %", 100.0 * tick));
    }
    for (i, bar) in bars.iter().enumerate() {
        let (y, colour) = ((2.0 + i as f64) * ROW + 2.0, theme.series[bar.place % theme.series.len()]);
        let Estimate { value, low, high } = bar.estimate;
        svg += &text([left - 8.0, y + 3.0], "end", &bar.name);
        let _ = writeln!(
            svg,
            "<g><title>{}: {:.1} % ({:.1} to {:.1})</title><rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" \
             height=\"10\" fill=\"{colour}\" fill-opacity=\"0.35\"/><rect x=\"{:.1}\" y=\"{:.1}\" \
             width=\"2\" height=\"10\" fill=\"{colour}\"/></g>",
            escaped(&bar.name),
            100.0 * value,
            100.0 * low,
            100.0 * high,
            x(low),
            y - 5.0,
            (x(high) - x(low)).max(1.0),
            x(value) - 1.0,
            y - 5.0
        );
        svg += &text([x(1.0) + 8.0, y + 3.0], "start", &format!("{:.1} %", 100.0 * value));
    }
    if let Some(mark) = mark {
        svg += &rule([x(mark), 1.5 * ROW], [x(mark), below - 8.0], theme.text, " stroke-dasharray=\"4 3\"");
    }
    svg + "</svg>\n"
}

fn begin(title: &str, [width, height]: [f64; 2], theme: &Theme) -> String {
    let style = format!("text {{ font: 9px 'DejaVu Sans', sans-serif; fill: {} }}", theme.text);
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.1} {height:.1}\" \
         width=\"{width:.1}\" height=\"{height:.1}\">\n<style>{style}</style>\n{}",
        text([4.0, 12.0], "start", title)
    )
}

fn text_width(text: &str) -> f64 {
    text.chars().count() as f64 * LETTER
}

fn text([x, y]: [f64; 2], anchor: &str, content: &str) -> String {
    format!("<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{}</text>\n", escaped(content))
}

fn rule(from: [f64; 2], to: [f64; 2], colour: &str, more: &str) -> String {
    let ([x1, y1], [x2, y2]) = (from, to);
    format!("<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke=\"{colour}\"{more}/>\n")
}

/// Beyond five algorithms, colours repeat with other dashes.
fn stroke(place: usize, theme: &Theme) -> (&'static str, &'static str) {
    let dashes = ["", " stroke-dasharray=\"6 3\"", " stroke-dasharray=\"2 2\""];
    let n = theme.series.len();
    (theme.series[place % n], dashes[(place / n) % dashes.len()])
}

/// The names of curves in one row, and its width.
fn legend(names: &[(usize, &str)], theme: &Theme) -> (String, f64) {
    let (mut svg, mut x) = (String::new(), 4.0);
    for (place, name) in names {
        let ((colour, dashes), y) = (stroke(*place, theme), ROW + 8.0);
        let more = format!(" stroke-width=\"2\"{dashes}");
        svg += &rule([x, y], [x + 18.0, y], colour, &more);
        svg += &text([x + 22.0, y + 3.0], "start", name);
        x += 22.0 + text_width(name) + 14.0;
    }
    (svg, x)
}

/// A panel, whose plot begins at the origin.
fn drawn(panel: &Panel, theme: &Theme) -> String {
    let [width, height] = PLOT;
    let xs = panel.lines.iter().flat_map(|line| line.points.iter().map(|(x, _)| *x));
    let widest = xs.fold(0.0, f64::max);
    let to_x = |x: f64| if widest > 0.0 { x / widest * width } else { 0.0 };
    let to_y = |y: f64| height * (1.0 - y);
    let mut svg = text([0.0, -8.0], "start", &panel.title);
    for tick in [0.0, 0.5, 1.0] {
        svg += &rule([0.0, to_y(tick)], [width, to_y(tick)], theme.grid, "");
        svg += &text([-5.0, to_y(tick) + 3.0], "end", &format!("{:.0} %", 100.0 * tick));
    }
    for tick in ticks(widest) {
        svg += &rule([to_x(tick), height], [to_x(tick), height + 3.0], theme.text, "");
        svg += &text([to_x(tick), height + 13.0], "middle", &short(tick));
    }
    svg += &text([width / 2.0, height + 26.0], "middle", &panel.x_label);
    for line in &panel.lines {
        let (colour, dashes) = stroke(line.place, theme);
        let path = |side: fn(&Estimate) -> f64| -> Vec<String> {
            let point = |(x, of): &(f64, Estimate)| format!("{:.1},{:.1}", to_x(*x), to_y(side(of)));
            line.points.iter().map(point).collect()
        };
        let (above, below) = (path(|of| of.high), path(|of| of.low));
        let band = above.into_iter().chain(below.into_iter().rev()).collect::<Vec<_>>().join(" ");
        let middle = path(|of| of.value).join(" ");
        let _ = writeln!(
            svg,
            "<g><title>{}</title><polygon points=\"{band}\" fill=\"{colour}\" \
             fill-opacity=\"0.2\"/><polyline points=\"{middle}\" fill=\"none\" \
             stroke=\"{colour}\" stroke-width=\"1.6\"{dashes}/></g>",
            escaped(&line.name)
        );
    }
    svg
}

/// Round numbers from 0 to the largest, at most five.
fn ticks(largest: f64) -> Vec<f64> {
    if largest <= 0.0 {
        return vec![0.0];
    }
    let power = 10f64.powf((largest / 4.0).log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * power).into_iter().find(|s| *s * 4.0 >= largest);
    let step = step.unwrap_or(largest);
    (0..=4).map(|i| f64::from(i) * step).filter(|tick| *tick <= largest * (1.0 + 1e-9)).collect()
}

/// A number as `200k` or `1.5M`.
fn short(number: f64) -> String {
    let (scaled, unit) = match number {
        x if x >= 1e6 => (x / 1e6, "M"),
        x if x >= 1e3 => (x / 1e3, "k"),
        x => (x, ""),
    };
    format!("{}{unit}", (scaled * 1000.0).round() / 1000.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_few() {
        let check = |largest: f64, expected: &[f64]| {
            let found = ticks(largest);
            let is_near = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9 * largest.max(1.0));
            assert!(found.len() == expected.len() && is_near, "{found:?} {expected:?}");
        };
        check(0.0, &[0.0]);
        check(1.0, &[0.0, 0.5, 1.0]);
        check(2_000_000.0, &[0.0, 5e5, 1e6, 1.5e6, 2e6]);
        check(930.0, &[0.0, 500.0]);
        check(350_000.0, &[0.0, 1e5, 2e5, 3e5]);
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!([0.0, 0.5, 930.0, 1500.0, 2e6].map(short), ["0", "0.5", "930", "1.5k", "2M"]);
    }

    #[test]
    fn charts_have_every_line_and_escape_names() {
        let estimate = Estimate { value: 0.5, low: 0.25, high: 1.0 };
        let line = |name: &str, place| Line {
            name: name.to_owned(),
            place,
            points: vec![(0.0, estimate), (100.0, estimate)],
        };
        let panel = |title: &str| Panel {
            title: title.to_owned(),
            x_label: "steps".to_owned(),
            lines: vec![line("a<b", 0), line("c", 6)],
        };
        let svg = lines("wins", &[panel("3m"), panel("2s3z")], 3, &THEMES[0]);
        assert_eq!((svg.matches("<polyline ").count(), svg.matches(">a&lt;b</text>").count()), (4, 1));
        assert!(svg.contains("points=\"0.0,60.0 220.0,60.0\"") && svg.contains("stroke-dasharray=\"6 3\""));
        let bar = Bar { name: "a<b".to_owned(), place: 0, estimate };
        let svg = bars("means", &[bar], Some(0.5), &THEMES[1]);
        assert!(svg.contains("<title>a&lt;b: 50.0 % (25.0 to 100.0)</title>"), "{svg}");
    }
}

//! Charts in SVG in the style of the documentation's: transparent, with the colours of light or of dark
//! pages. All values are shares, 0 to 1.

use crate::svg::{LETTER, escaped};
use crate::table::percent;
use smaclite_lab::Estimate;
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
    /// The names of both axes, with their units.
    pub axes: [&'static str; 2],
    pub lines: Vec<Line>,
}

/// A value with its interval.
pub(super) struct Bar {
    pub name: String,
    pub place: usize,
    pub estimate: Estimate,
}

/// The size of what is drawn in a panel, and the space around it for its title, numbers and names of axes. A
/// figure of one panel is 600 pixels wide, whatever it shows, so that several look alike in a paper.
const PLOT: [f64; 2] = [520.0, 260.0];
const MARGIN: [f64; 2] = [64.0, 26.0];
const RIGHT: f64 = 16.0;
const BELOW: f64 = 44.0;
const WIDTH: f64 = MARGIN[0] + PLOT[0] + RIGHT;

/// The height of letters, and their width, about.
const FONT: f64 = 11.0;
const LETTER_WIDTH: f64 = LETTER * FONT / 9.0;

/// The height of a row of text or of a bar.
const ROW: f64 = 20.0;

/// Panels in rows of at most `columns`, below a title and the names of the curves. All have the same vertical
/// axis, so that they can be compared.
pub(super) fn lines(title: &str, panels: &[Panel], columns: usize, theme: &Theme) -> String {
    let columns = columns.min(panels.len()).max(1);
    let mut names: Vec<(usize, &str)> = Vec::new();
    for line in panels.iter().flat_map(|panel| &panel.lines) {
        if !names.contains(&(line.place, &line.name)) {
            names.push((line.place, &line.name));
        }
    }
    let width = columns as f64 * WIDTH;
    let (legend, begin_y) = legend(&names, width, theme);
    let cell = MARGIN[1] + PLOT[1] + BELOW;
    let height = begin_y + panels.len().div_ceil(columns) as f64 * cell;
    let mut svg = begin(title, [width, height], theme) + &legend;
    let top = top(panels);
    for (i, panel) in panels.iter().enumerate() {
        let (column, row) = (i % columns, i / columns);
        let (x, y) = (column as f64 * WIDTH + MARGIN[0], row as f64 * cell + MARGIN[1] + begin_y);
        let _ = writeln!(svg, "<g transform=\"translate({x:.1} {y:.1})\">"); // a string takes everything
        svg += &(drawn(panel, top, theme) + "</g>\n");
    }
    svg + "</svg>\n"
}

/// Bars below each other, and the name of their axis; `mark` is a dashed line at a value.
pub(super) fn bars(title: &str, axis: &str, bars: &[Bar], mark: Option<f64>, theme: &Theme) -> String {
    let left = bars.iter().map(|bar| text_width(&bar.name)).fold(0.0, f64::max) + 16.0;
    let (plot, right) = ((WIDTH - left - 70.0).max(200.0), 70.0);
    let below = 2.0 * ROW + bars.len() as f64 * ROW;
    let mut svg = begin(title, [left + plot + right, below + 2.0 * ROW], theme);
    let x = |value: f64| left + value * plot;
    for tick in [0.0, 0.25, 0.5, 0.75, 1.0] {
        let (at, top, low) = (x(tick), 1.5 * ROW, below - 8.0);
        svg += &rule([at, top], [at, low], theme.grid, "");
        svg += &text([at, below + 6.0], "middle", &short(100.0 * tick));
    }
    svg += &text([x(0.5), below + 6.0 + ROW], "middle", axis);
    for (i, bar) in bars.iter().enumerate() {
        let y = (2.0 + i as f64) * ROW + 2.0;
        svg += &text([left - 8.0, y + 4.0], "end", &bar.name);
        svg += &interval(bar, y, x, theme);
        svg += &text([x(1.0) + 8.0, y + 4.0], "start", &percent(bar.estimate.value));
    }
    if let Some(mark) = mark {
        svg += &rule([x(mark), 1.5 * ROW], [x(mark), below - 8.0], theme.text, " stroke-dasharray=\"4 3\"");
    }
    svg + "</svg>\n"
}

/// The bar of an interval, with its value as a line, at the height `y`.
fn interval(bar: &Bar, y: f64, to_x: impl Fn(f64) -> f64, theme: &Theme) -> String {
    let colour = theme.series[bar.place % theme.series.len()];
    let Estimate { value, low, high } = bar.estimate;
    format!(
        "<g><title>{}: {:.1} % ({:.1} to {:.1})</title><rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" \
         height=\"10\" fill=\"{colour}\" fill-opacity=\"0.35\"/><rect x=\"{:.1}\" y=\"{:.1}\" \
         width=\"2\" height=\"10\" fill=\"{colour}\"/></g>\n",
        escaped(&bar.name),
        100.0 * value,
        100.0 * low,
        100.0 * high,
        to_x(low),
        y - 5.0,
        (to_x(high) - to_x(low)).max(1.0),
        to_x(value) - 1.0,
        y - 5.0
    )
}

fn begin(title: &str, [width, height]: [f64; 2], theme: &Theme) -> String {
    let style = format!("text {{ font: {FONT}px 'DejaVu Sans', sans-serif; fill: {} }}", theme.text);
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.1} {height:.1}\" \
         width=\"{width:.1}\" height=\"{height:.1}\">\n<style>{style}</style>\n{}",
        text([4.0, 14.0], "start", title)
    )
}

fn text_width(text: &str) -> f64 {
    text.chars().count() as f64 * LETTER_WIDTH
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

/// The names of curves below the title, in rows of this width, and where the next row would be.
fn legend(names: &[(usize, &str)], width: f64, theme: &Theme) -> (String, f64) {
    let (mut svg, mut x, mut y) = (String::new(), 4.0, 1.5 * ROW);
    for (place, name) in names {
        let needed = 22.0 + text_width(name) + 14.0;
        if x > 4.0 && x + needed > width {
            (x, y) = (4.0, y + ROW);
        }
        let (colour, dashes) = stroke(*place, theme);
        svg += &rule([x, y], [x + 18.0, y], colour, &format!(" stroke-width=\"2\"{dashes}"));
        svg += &text([x + 22.0, y + 4.0], "start", name);
        x += needed;
    }
    (svg, y + ROW / 2.0)
}

/// Where the vertical axis ends: low curves would be flat below 100 %.
fn top(panels: &[Panel]) -> f64 {
    let estimates = panels.iter().flat_map(|panel| &panel.lines).flat_map(|line| &line.points);
    let highest = estimates.map(|(_, estimate)| estimate.high).fold(0.0, f64::max);
    [0.01, 0.02, 0.04, 0.1, 0.2, 0.4].into_iter().find(|top| *top >= highest).unwrap_or(1.0)
}

/// A panel, whose plot begins at the origin, with a vertical axis from 0 to `top`.
fn drawn(panel: &Panel, top: f64, theme: &Theme) -> String {
    let [width, height] = PLOT;
    let xs = panel.lines.iter().flat_map(|line| line.points.iter().map(|(x, _)| *x));
    let widest = xs.fold(0.0, f64::max);
    let to_x = |x: f64| if widest > 0.0 { x / widest * width } else { 0.0 };
    let to_y = |y: f64| height * (1.0 - y / top);
    let mut svg = text([0.0, -8.0], "start", &panel.title);
    for tick in [0.0, 0.25, 0.5, 0.75, 1.0].map(|share| share * top) {
        svg += &rule([0.0, to_y(tick)], [width, to_y(tick)], theme.grid, "");
        svg += &text([-6.0, to_y(tick) + 4.0], "end", &short(100.0 * tick));
    }
    for tick in ticks(widest) {
        svg += &rule([to_x(tick), height], [to_x(tick), height + 3.0], theme.text, "");
        svg += &text([to_x(tick), height + 16.0], "middle", &short(tick));
    }
    let [x_name, y_name] = panel.axes;
    svg += &text([width / 2.0, height + 34.0], "middle", x_name);
    let _ = write!(svg, "<g transform=\"translate(-48 {:.1}) rotate(-90)\">", height / 2.0);
    svg += &(text([0.0, 0.0], "middle", y_name) + "</g>\n");
    panel.lines.iter().fold(svg, |svg, line| svg + &curve(line, to_x, to_y, theme))
}

/// A curve with its band.
fn curve(line: &Line, to_x: impl Fn(f64) -> f64, to_y: impl Fn(f64) -> f64, theme: &Theme) -> String {
    let (colour, dashes) = stroke(line.place, theme);
    let path = |side: fn(&Estimate) -> f64| -> Vec<String> {
        let point = |(x, of): &(f64, Estimate)| format!("{:.1},{:.1}", to_x(*x), to_y(side(of)));
        line.points.iter().map(point).collect()
    };
    let (above, below) = (path(|of| of.high), path(|of| of.low));
    let band = above.into_iter().chain(below.into_iter().rev()).collect::<Vec<_>>().join(" ");
    let middle = path(|of| of.value).join(" ");
    format!(
        "<g><title>{}</title><polygon points=\"{band}\" fill=\"{colour}\" \
         fill-opacity=\"0.2\"/><polyline points=\"{middle}\" fill=\"none\" \
         stroke=\"{colour}\" stroke-width=\"1.6\"{dashes}/></g>\n",
        escaped(&line.name)
    )
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

    /// A panel of lines with these names, up to this height.
    fn panel(names: &[&str], high: f64) -> Panel {
        let estimate = Estimate { value: high / 2.0, low: high / 4.0, high };
        let points = vec![(0.0, estimate), (100.0, estimate)];
        let line = |(i, name): (usize, &&str)| Line {
            name: (*name).to_owned(),
            place: 6 * i,
            points: points.clone(),
        };
        let lines = names.iter().enumerate().map(line).collect();
        Panel { title: "3m".to_owned(), axes: ["environment steps", "won episodes (%)"], lines }
    }

    #[test]
    fn charts_have_every_line_and_escape_names() {
        let svg = lines("wins", &[panel(&["a<b", "c"], 1.0), panel(&["a<b", "c"], 1.0)], 3, &THEMES[0]);
        assert_eq!((svg.matches("<polyline ").count(), svg.matches(">a&lt;b</text>").count()), (4, 1));
        assert!(svg.contains("points=\"0.0,130.0 520.0,130.0\"") && svg.contains("stroke-dasharray=\"6 3\""));
        let estimate = Estimate { value: 0.5, low: 0.25, high: 1.0 };
        let bar = Bar { name: "a<b".to_owned(), place: 0, estimate };
        let svg = bars("means", "won episodes (%)", &[bar], Some(0.5), &THEMES[1]);
        assert!(svg.contains("<title>a&lt;b: 50.0 % (25.0 to 100.0)</title>"), "{svg}");
        assert!(svg.contains(">won episodes (%)</text>") && svg.contains(" width=\"600.0\""), "{svg}");
    }

    /// Curves below 10 % were flat lines, axes had no names, and the names of curves made a picture wider.
    #[test]
    fn a_figure_has_a_fixed_size_and_axes_for_its_curves() {
        let size = |svg: &str| {
            let height = svg.split(" height=\"").nth(1).and_then(|rest| rest.split('"').next());
            (svg.contains(" width=\"600.0\""), height.map(str::to_owned))
        };
        let low = lines("wins", &[panel(&["a"], 0.07)], 3, &THEMES[0]);
        let high = lines("wins", &[panel(&["a", "b"], 0.9)], 3, &THEMES[0]);
        assert_eq!(size(&low), size(&high));
        assert!(size(&low).0);
        for (svg, marks) in [(&low, ["2.5", "10"]), (&high, ["25", "100"])] {
            for expected in ["environment steps", "won episodes (%)", marks[0], marks[1]] {
                assert!(svg.contains(&format!(">{expected}</text>")), "{expected}: {svg}");
            }
        }
        let long = ["a"; 12].map(|letter| letter.repeat(30));
        let many = lines("wins", &[panel(&long.each_ref().map(|name| &**name), 0.9)], 3, &THEMES[0]);
        assert!(size(&many).0 && size(&many).1 > size(&high).1, "names take more rows, not more width");
    }
}

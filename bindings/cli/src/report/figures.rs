//! The pictures of a report: for every metric, curves, interquartile means, profiles and probabilities of
//! improvement, each for light and for dark pages.

use super::Results;
use super::chart::{Bar, Line, Panel, THEMES, Theme, bars, lines};
use smaclite_lab::{Estimate, Metric};

/// Panels beside each other.
const COLUMNS: usize = 2;

/// What the pictures of a metric show, as their names say.
const KINDS: [&str; 4] = ["curves", "means", "profiles", "improvement"];

/// A picture: its name without the ending, what it shows, and how it is drawn.
struct Figure {
    name: String,
    title: String,
    content: Content,
}

enum Content {
    Lines(Vec<Panel>),
    /// With the name of the axis, and the place of the dashed line, if there is one.
    Bars(Vec<Bar>, &'static str, Option<f64>),
}

/// Names of files, and contents.
pub(super) fn all(results: &Results) -> Vec<(String, String)> {
    let mut files = Vec::new();
    for Figure { name, title, content } in figures(results) {
        for theme in &THEMES {
            let svg = match &content {
                Content::Lines(panels) => lines(&title, panels, COLUMNS, theme),
                Content::Bars(all, axis, mark) => bars(&title, axis, all, *mark, theme),
            };
            files.push((file_name(&name, theme), svg));
        }
    }
    files
}

/// The names of all files that a report of any runs may have.
pub(super) fn file_names() -> impl Iterator<Item = String> {
    let figures = KINDS.iter().flat_map(|kind| Metric::ALL.map(|metric| figure_name(kind, metric)));
    figures.flat_map(|figure| THEMES.iter().map(move |theme| file_name(&figure, theme)))
}

fn figure_name(kind: &str, metric: Metric) -> String {
    format!("{kind}-{}", metric.name())
}

fn file_name(figure: &str, theme: &Theme) -> String {
    format!("{figure}{}.svg", theme.suffix)
}

/// Names without endings, and titles.
pub(super) fn titles(results: &Results) -> Vec<(String, String)> {
    figures(results).into_iter().map(|figure| (figure.name, figure.title)).collect()
}

fn figures(results: &Results) -> Vec<Figure> {
    let mut figures = Vec::new();
    let actions = results.actions;
    for metric in Metric::ALL {
        let axis = axis(metric);
        let what = format!("{}, {actions}", axis.trim_end_matches(" (%)"));
        let [of_curves, of_means, of_profiles, of_improvement] = KINDS.map(|kind| figure_name(kind, metric));
        let mut add = |name, title, content| figures.push(Figure { name, title, content });
        let title = format!("{what}: interquartile mean of the seeds, 95 % interval");
        add(of_curves, title, Content::Lines(curves(results, metric)));
        if !results.report.profiles.is_empty() {
            let title = format!("{what}: interquartile mean of the final episodes, 95 % interval");
            add(of_means, title, Content::Bars(means(results, metric), axis, None));
            let title = format!("{what}: share of runs above a score");
            add(of_profiles, title, Content::Lines(profiles(results, metric)));
        }
        if !results.report.improvements.is_empty() {
            let title = format!("{what}: probability of improvement, 95 % interval");
            let bars = Content::Bars(improvements(results, metric), "probability (%)", Some(0.5));
            add(of_improvement, title, bars);
        }
    }
    figures
}

/// The name of a metric's axis.
fn axis(metric: Metric) -> &'static str {
    match metric {
        Metric::WinRate => "won episodes (%)",
        Metric::Return => "normalised return (%)",
    }
}

/// The place of an algorithm among all, which decides its colour.
fn place(results: &Results, name: &str) -> usize {
    results.benchmark.algorithms.iter().position(|of| of.name == name).unwrap_or_default()
}

/// A panel for all tasks together, if there are several, and one per task.
fn curves(results: &Results, metric: Metric) -> Vec<Panel> {
    let tasks = results.benchmark.tasks();
    let common = results.benchmark.common_tasks().len();
    let all = (common > 1).then_some(None);
    let panel = |task: Option<&str>| {
        let of_task = results.report.curves.iter();
        let of_task = of_task.filter(|curve| curve.metric == metric && curve.task.as_deref() == task);
        let line = |curve: &smaclite_lab::Curve| Line {
            name: curve.algorithm.clone(),
            place: place(results, &curve.algorithm),
            points: curve.points.iter().map(|(steps, estimate)| (*steps as f64, *estimate)).collect(),
        };
        let title = task.map_or(format!("{common} tasks"), str::to_owned);
        let axes = ["environment steps", axis(metric)];
        Panel { title, axes, lines: of_task.map(line).collect() }
    };
    let panels = all.into_iter().chain(tasks.into_iter().map(Some)).map(panel);
    panels.filter(|panel| !panel.lines.is_empty()).collect()
}

fn profiles(results: &Results, metric: Metric) -> Vec<Panel> {
    let of_metric = results.report.profiles.iter().filter(|profile| profile.metric == metric);
    let line = |profile: &smaclite_lab::Profile| Line {
        name: profile.algorithm.clone(),
        place: place(results, &profile.algorithm),
        points: profile.points.clone(),
    };
    let title = "share of runs above the score".to_owned();
    let score = match metric {
        Metric::WinRate => "score: share of won episodes",
        Metric::Return => "score: normalised return",
    };
    vec![Panel { title, axes: [score, "runs above the score (%)"], lines: of_metric.map(line).collect() }]
}

fn means(results: &Results, metric: Metric) -> Vec<Bar> {
    let overall = results.report.aggregates.iter();
    let overall = overall.filter(|aggregate| aggregate.metric == metric && aggregate.task.is_none());
    overall.map(|of| bar(of.algorithm.clone(), place(results, &of.algorithm), of.mean)).collect()
}

fn improvements(results: &Results, metric: Metric) -> Vec<Bar> {
    let of_metric = results.report.improvements.iter().filter(|of| of.metric == metric);
    let name = |of: &smaclite_lab::Improvement| format!("{} better than {}", of.better, of.than);
    of_metric.map(|of| bar(name(of), place(results, &of.better), of.probability)).collect()
}

fn bar(name: String, place: usize, estimate: Estimate) -> Bar {
    Bar { name, place, estimate }
}

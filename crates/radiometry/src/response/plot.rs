//! A response as a picture: log exposure against code, as SVG.

use std::fmt::Write;

use super::ResponseCurve;

const SIZE: (f64, f64) = (720.0, 520.0);
/// Left, right, top, bottom edges of the plotted area.
const AREA: (f64, f64, f64, f64) = (78.0, 700.0, 46.0, 462.0);
const COLOURS: [(&str, &str); 3] = [("red", "#c8372d"), ("green", "#2e8b3d"), ("blue", "#2f62c4")];
/// Points of a curve.
const STEPS: usize = 512;
/// Stops below clipping that are shown at most.
const DEEPEST: f64 = 14.0;

/// Draws a response as SVG: exposure in stops below clipping against the fraction of the code range, a line a channel.
///
/// `seen` are the fractions of each channel between which the curve was measured: outside of them its line is dashed. `beside`
/// is another curve, such as the true one, drawn thin and grey. `title` stands above.
pub fn response_plot(
    curve: &ResponseCurve,
    seen: Option<[(f64, f64); 3]>,
    beside: Option<(&str, &ResponseCurve)>,
    title: &str,
) -> String {
    let stops = |curve: &ResponseCurve, channel: usize, fraction: f64| {
        let exposure = curve.exposure(channel, fraction);
        if exposure > 0.0 { exposure.log2() } else { f64::NEG_INFINITY }
    };
    let mut deepest = 1.0f64;
    for channel in 0..3 {
        for step in 1..=STEPS {
            let value = stops(curve, channel, step as f64 / STEPS as f64);
            deepest = if value.is_finite() { deepest.max(-value) } else { deepest };
        }
    }
    let deepest = deepest.min(DEEPEST).ceil();
    let (left, right, top, bottom) = AREA;
    let x = |fraction: f64| left + fraction * (right - left);
    let y = |stops: f64| top + (-stops / deepest) * (bottom - top);
    let mut svg = Svg::new(title);
    svg.axes(deepest, &x, &y);
    let line = |curve: &ResponseCurve, channel: usize, from: f64, to: f64| {
        let steps = ((to - from) * STEPS as f64).ceil().max(1.0) as usize;
        let points = (0..=steps).map(|step| from + (to - from) * step as f64 / steps as f64);
        let shown = points.map(|fraction| (fraction, stops(curve, channel, fraction)));
        let shown = shown.filter(|(_, stops)| (-deepest..=0.5).contains(stops));
        shown.map(|(fraction, stops)| format!("{:.1},{:.1}", x(fraction), y(stops))).collect::<Vec<_>>().join(" ")
    };
    if let Some((_, beside)) = beside {
        for channel in 0..3 {
            svg.line(&line(beside, channel, 0.0, 1.0), "#888888", 3.5, false);
        }
    }
    for (channel, (_, colour)) in COLOURS.iter().enumerate() {
        let (low, high) = seen.map_or((0.0, 1.0), |seen| seen[channel]);
        let (low, high) = (low.clamp(0.0, 1.0), high.clamp(0.0, 1.0));
        svg.line(&line(curve, channel, low, high.max(low)), colour, 1.8, false);
        if seen.is_some() {
            svg.line(&line(curve, channel, 0.0, low), colour, 1.8, true);
            svg.line(&line(curve, channel, high, 1.0), colour, 1.8, true);
        }
    }
    svg.legend(seen.is_some(), beside.map(|(name, _)| name));
    svg.finish()
}

struct Svg {
    text: String,
}

impl Svg {
    fn new(title: &str) -> Self {
        let (width, height) = SIZE;
        let mut svg = Self {
            text: format!(
                "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
                 height=\"{height}\" font-family=\"sans-serif\" font-size=\"13\">\n\
                 <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
            ),
        };
        svg.label((AREA.0 + AREA.1) / 2.0, 28.0, "middle", 15, title);
        svg
    }

    fn axes(&mut self, deepest: f64, x: &dyn Fn(f64) -> f64, y: &dyn Fn(f64) -> f64) {
        let (left, right, top, bottom) = AREA;
        for percent in (0..=100).step_by(10) {
            let at = x(f64::from(percent) / 100.0);
            self.rule(at, top, at, bottom);
            if percent % 20 == 0 {
                self.label(at, bottom + 18.0, "middle", 12, &format!("{percent} %"));
            }
        }
        let every = if deepest > 8.0 { 2 } else { 1 };
        for stop in 0..=deepest as i32 {
            let at = y(-f64::from(stop));
            self.rule(left, at, right, at);
            if stop % every == 0 {
                let name = if stop == 0 { "clipping".to_owned() } else { format!("−{stop}") };
                self.label(left - 8.0, at + 4.0, "end", 12, &name);
            }
        }
        let _ = writeln!(
            self.text,
            "<rect x=\"{left}\" y=\"{top}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#333333\"/>",
            right - left,
            bottom - top
        );
        self.label(
            (left + right) / 2.0,
            bottom + 42.0,
            "middle",
            13,
            "code, share of the range from black to white level",
        );
        let _ = writeln!(
            self.text,
            "<text x=\"18\" y=\"{middle}\" text-anchor=\"middle\" transform=\"rotate(-90 18 {middle})\">exposure, stops</text>",
            middle = (top + bottom) / 2.0
        );
    }

    fn legend(&mut self, seen: bool, beside: Option<&str>) {
        let (_, right, _, bottom) = AREA;
        let mut entries: Vec<(String, &str, f64, bool)> =
            COLOURS.iter().map(|(name, colour)| ((*name).to_owned(), *colour, 1.8, false)).collect();
        if seen {
            entries.push(("extrapolated".to_owned(), "#333333", 1.8, true));
        }
        if let Some(name) = beside {
            entries.push((name.to_owned(), "#888888", 3.5, false));
        }
        let top = bottom - 14.0 - 20.0 * entries.len() as f64;
        for (index, (name, colour, width, dashed)) in entries.iter().enumerate() {
            let y = top + 20.0 * (index + 1) as f64;
            let (from, to) = (right - 150.0, right - 118.0);
            self.line(&format!("{from},{y} {to},{y}"), colour, *width, *dashed);
            self.label(right - 110.0, y + 4.0, "start", 12, name);
        }
    }

    fn rule(&mut self, x1: f64, y1: f64, x2: f64, y2: f64) {
        let _ = writeln!(
            self.text,
            "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke=\"#e2e2e2\"/>"
        );
    }

    fn line(&mut self, points: &str, colour: &str, width: f64, dashed: bool) {
        let dashes = if dashed { " stroke-dasharray=\"4 4\"" } else { "" };
        let _ = writeln!(
            self.text,
            "<polyline points=\"{points}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\"{dashes}/>"
        );
    }

    fn label(&mut self, x: f64, y: f64, anchor: &str, size: u32, text: &str) {
        let text = text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
        // What XML does not allow, not even escaped.
        let text: String = text.chars().filter(|c| !c.is_control() && !matches!(c, '\u{fffe}' | '\u{ffff}')).collect();
        let _ = writeln!(
            self.text,
            "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" font-size=\"{size}\">{text}</text>"
        );
    }

    fn finish(mut self) -> String {
        self.text.push_str("</svg>\n");
        self.text
    }
}

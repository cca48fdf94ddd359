//! The surroundings of the stage on the sheet: the title, the axes, and a legend. They are outside the viewport, so
//! that nothing of the stage is covered.

use svg::node::element::{Definitions, Group, LinearGradient, Path, Rectangle, Stop, Text};

use super::camera::{Camera, Viewport};
use super::marks::Happened;
use super::palette::Palette;
use super::scale::ColourScale;
use super::{FACE, WIDTH, rounded, text};

const LEFT: f64 = 62.0;
const RIGHT: f64 = 18.0;
const TOP: f64 = 84.0;
/// Sheet units for the numbers and the name of the lower axis.
const AXIS: f64 = 40.0;
/// The height of a row of the legend.
const ROW: f64 = 28.0;
const BOTTOM: f64 = 14.0;

/// The content that the legend explains.
pub struct Contents<'a> {
    /// The colour scale, metres per second, if it colours any board.
    pub scale: Option<ColourScale>,
    /// True if the head's signs are in the viewport.
    pub head: bool,
    /// True if the tail's signs are in the viewport.
    pub tail: bool,
    /// The state of the outlined boards, if any.
    pub outlined: Option<&'static str>,
    /// The words on the ground that boards cover, if it is drawn.
    pub ground: Option<String>,
    /// The events whose marks are in the viewport, with their words.
    pub events: &'a [(Happened, String)],
}

/// Returns the sheet units above and below the viewport, with `rows` rows in the legend.
pub fn margins(rows: usize) -> (f64, f64) {
    (TOP, AXIS + ROW * rows as f64 + BOTTOM)
}

/// Returns the viewport of a sheet of this height, with `rows` rows in the legend.
pub fn viewport(height: f64, rows: usize) -> Viewport {
    let (above, below) = margins(rows);
    Viewport { left: LEFT, top: above, width: viewport_width(), height: height - above - below }
}

/// Returns the width of the viewport.
pub fn viewport_width() -> f64 {
    WIDTH - LEFT - RIGHT
}

/// Returns text on the sheet.
pub fn words(content: &str, (x, y): (f64, f64), size: u32, colour: &str) -> Text {
    let words = Text::new(text(content)).set("x", rounded(x, 2)).set("y", rounded(y, 2));
    words.set("font-family", FACE).set("font-size", size).set("fill", colour)
}

/// Returns the approximate width of a line of text, sheet units.
pub fn width_of(content: &str, size: f64) -> f64 {
    content.chars().map(|letter| if letter > '\u{2e7f}' { size } else { 0.55 * size }).sum()
}

/// Returns text cut to a width in sheet units.
fn fitted(content: &str, size: f64, most: f64) -> String {
    if width_of(content, size) <= most {
        return content.to_owned();
    }
    let mut fitted = String::new();
    for letter in content.chars() {
        if width_of(&fitted, size) + 2.0 * size > most {
            break;
        }
        fitted.push(letter);
    }
    fitted + "\u{2026}"
}

/// Returns the title and the line below it.
pub fn title(title: &str, below: &str, colour: &str, palette: &Palette) -> Group {
    let title = words(&fitted(title, 27.0, viewport_width()), (LEFT, 38.0), 26, palette.ink).set("font-weight", 700);
    let below = words(&fitted(below, 16.0, viewport_width()), (LEFT, 64.0), 16, colour);
    Group::new().set("id", "title").add(title).add(below)
}

/// Returns the viewport's outline with numbers in metres.
pub fn axes(camera: &Camera, palette: &Palette) -> Group {
    let (viewport, view) = (camera.viewport, camera.view());
    let step = round_step(130.0 / camera.scale);
    let decimals = (-step.log10().floor()).clamp(0.0, 12.0) as usize;
    let mut ticks = String::new();
    let mut group = Group::new().set("id", "axes");
    for x in multiples(step, view.least.x, view.greatest.x) {
        let (at, _) = camera.sheet(nalgebra::Point2::new(x, 0.0));
        let at = rounded(at, 3);
        ticks += &format!("M{at} {bottom}v6", bottom = viewport.bottom());
        let number = words(&rounded(x, decimals), (0.0, viewport.bottom() + 22.0), 14, palette.quiet);
        group = group.add(number.set("x", at).set("text-anchor", "middle"));
    }
    for y in multiples(step, view.least.y, view.greatest.y) {
        let (_, at) = camera.sheet(nalgebra::Point2::new(0.0, y));
        ticks += &format!("M{left} {at}h-6", left = viewport.left, at = rounded(at, 3));
        let number = words(&rounded(y, decimals), (viewport.left - 11.0, at + 5.0), 14, palette.quiet);
        group = group.add(number.set("text-anchor", "end"));
    }
    let unit =
        words("metres", (viewport.right(), viewport.bottom() + 38.0), 14, palette.quiet).set("text-anchor", "end");
    let ticks = Path::new().set("d", ticks).set("fill", "none").set("stroke", palette.quiet);
    group.add(ticks).add(outline(viewport).set("stroke", palette.quiet).set("fill", "none")).add(unit)
}

/// Returns a viewport as an element.
pub fn outline(viewport: Viewport) -> Rectangle {
    let corner = Rectangle::new().set("x", rounded(viewport.left, 3)).set("y", rounded(viewport.top, 3));
    corner.set("width", rounded(viewport.width, 3)).set("height", rounded(viewport.height, 3))
}

/// Returns the greatest of 1, 2, 5 times a power of ten that is at most `most`.
fn round_step(most: f64) -> f64 {
    let power = 10f64.powf(most.log10().floor());
    [5.0, 2.0, 1.0].into_iter().map(|one| one * power).find(|step| *step <= most).unwrap_or(power)
}

/// Returns the multiples of a step from one number to another.
fn multiples(step: f64, from: f64, to: f64) -> impl Iterator<Item = f64> {
    let (first, last) = ((from / step).ceil(), (to / step).floor());
    // A picture has some ten of them. Far from the origin a step may be lost in rounding, so their number is limited.
    (0..1000).map(move |k| first + f64::from(k)).take_while(move |k| *k <= last).map(move |k| k * step)
}

/// Returns the legend, row by row below the viewport, for the content of the picture only.
pub fn legend(contents: &Contents, camera: &Camera, palette: &Palette) -> Group {
    let mut group = Group::new().set("id", "legend");
    let mut row = Row { x: LEFT, y: camera.viewport.bottom() + AXIS + 0.5 * ROW };
    let Row { x, y } = row;
    if let Some(scale) = &contents.scale {
        let bar = Rectangle::new().set("x", x).set("y", rounded(y - 7.0, 2)).set("width", 110).set("height", 14);
        let bar = bar.set("rx", 3).set("fill", "url(#speeds)");
        group = group.add(gradient(palette)).add(bar).add(row.after(110.0, &speed_words(scale), palette));
    }
    if contents.head {
        let chevrons =
            [0.0, 7.0, 14.0].map(|at| format!("M{} {}l7 7l-7 7", rounded(row.x + at, 2), rounded(y - 7.0, 2)));
        let chevrons = Path::new().set("d", chevrons.concat()).set("fill", "none").set("stroke-linejoin", "round");
        group = group.add(chevrons.set("stroke", palette.ink).set("stroke-width", 2.2));
        group = group.add(row.after(22.0, "head", palette));
    }
    if contents.tail {
        let bars = [0.0, 6.0, 12.0].map(|at| format!("M{} {}v14", rounded(row.x + 2.0 + at, 2), rounded(y - 7.0, 2)));
        let bars = Path::new().set("d", bars.concat()).set("stroke", palette.ink).set("stroke-width", 2.5);
        group = group.add(bars).add(row.after(17.0, "tail", palette));
    }
    if let Some(outlined) = contents.outlined {
        let board = Rectangle::new().set("x", rounded(row.x + 2.0, 2)).set("y", rounded(y - 5.0, 2));
        let board = board.set("width", 32).set("height", 10).set("fill", "none").set("stroke-linejoin", "round");
        group = group.add(board.set("stroke", palette.danger).set("stroke-width", 3));
        group = group.add(row.after(36.0, outlined, palette));
    }
    if let Some(ground) = &contents.ground {
        let patch = Rectangle::new().set("x", rounded(row.x, 2)).set("y", rounded(y - 7.0, 2));
        let patch =
            patch.set("width", 24).set("height", 14).set("fill", palette.warning).set("fill-opacity", super::SWEPT);
        group = group.add(patch).add(row.after(24.0, ground, palette));
    }
    for (event, sentence) in contents.events {
        row = Row { x: LEFT, y: row.y + ROW };
        let (x, y) = (row.x + 11.0, row.y);
        let small = Group::new().set("transform", format!("translate({x} {}) scale(0.55)", rounded(y, 2)));
        group = group.add(small.add(event.sign((0.0, 0.0), palette)));
        group = group.add(row.after(22.0, &fitted(sentence, 15.0, viewport_width() - 40.0), palette));
    }
    group
}

/// The position of the next entry of the legend.
struct Row {
    x: f64,
    y: f64,
}

impl Row {
    /// Returns the text to the right of a sample `sample` units wide, and moves on behind it.
    fn after(&mut self, sample: f64, content: &str, palette: &Palette) -> Text {
        let x = self.x + sample + 8.0;
        self.x = x + width_of(content, 15.0) + 24.0;
        words(content, (x, self.y + 5.0), 15, palette.ink)
    }
}

fn speed_words(scale: &ColourScale) -> String {
    let (least, greatest) = scale.ends();
    let [least, head, greatest] = [least, scale.head_speed, greatest].map(|speed| rounded(speed, 3));
    format!("mean speed {least} to {greatest} m/s, finest at {head} m/s")
}

fn gradient(palette: &Palette) -> Definitions {
    let stops = [(0.0, palette.slow), (0.5, palette.middle), (1.0, palette.fast)];
    let gradient = stops.into_iter().fold(LinearGradient::new().set("id", "speeds"), |gradient, (at, colour)| {
        gradient.add(Stop::new().set("offset", at).set("stop-color", colour))
    });
    Definitions::new().add(gradient)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_one_two_five_and_multiples_include_both_ends() {
        assert_eq!([1.3, 2.0, 7.9, 0.06].map(round_step), [1.0, 2.0, 5.0, 0.05]);
        assert_eq!(multiples(2.0, -4.0, 5.0).collect::<Vec<_>>(), [-4.0, -2.0, 0.0, 2.0, 4.0]);
    }

    #[test]
    fn long_words_are_cut() {
        assert_eq!(fitted("short", 20.0, 300.0), "short");
        let cut = fitted(&"long ".repeat(50), 20.0, 300.0);
        assert!(cut.ends_with('\u{2026}') && width_of(&cut, 20.0) <= 300.0, "{cut}");
    }
}

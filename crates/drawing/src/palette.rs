//! The colours of all pictures of this program: those of the stage page's style sheet, light and dark.
//!
//! `tests/commands/draw` compares them with the page's `style.css`. Drawings use one palette. Plots are made in the
//! light palette, and [`with_dark_rules`] adds the dark one, which a viewer that prefers dark applies.

use std::fmt::Write;

/// The steps of the colour scale, as on the page.
pub const SHADES: usize = 32;

/// The colours of one theme, as `#rrggbb`. Each has the name of its variable in the style sheet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Palette {
    /// The background.
    pub ground: &'static str,
    /// Text, and the outline of the head.
    pub ink: &'static str,
    /// Less important text.
    pub quiet: &'static str,
    /// The path.
    pub faint: &'static str,
    /// Keep-outs, and the grid of plots.
    pub line: &'static str,
    /// Boards that touch or overlap.
    pub danger: &'static str,
    /// Events ahead, and the ground that boards cover.
    pub warning: &'static str,
    /// A board without a known speed, and obstacles.
    pub still: &'static str,
    /// The slowest board.
    pub slow: &'static str,
    /// The middle of the colour scale.
    pub middle: &'static str,
    /// The fastest board.
    pub fast: &'static str,
}

/// For paper and bright rooms.
pub const LIGHT: Palette = Palette {
    ground: "#fbfaf7",
    ink: "#16181d",
    quiet: "#5a5d66",
    faint: "#cfcbc0",
    line: "#d9d5cb",
    danger: "#c2001f",
    warning: "#8a4b00",
    still: "#9a9ca3",
    slow: "#3b3fb6",
    middle: "#0c9a8d",
    fast: "#e08e00",
};

/// For screens and dark rooms.
pub const DARK: Palette = Palette {
    ground: "#0b0d11",
    ink: "#f2f0ea",
    quiet: "#a4a8b3",
    faint: "#363b46",
    line: "#2a2f39",
    danger: "#ff4a5f",
    warning: "#ffb347",
    still: "#6c707a",
    slow: "#5c6cff",
    middle: "#1fb8a6",
    fast: "#ffd24a",
};

/// Colours of the lines of a plot, in order, on a light and on a dark ground. People who do not see red and green can
/// distinguish them (after Okabe and Ito).
pub const SERIES: [(&str, &str); 7] = [
    ("#0072b2", "#56b4e9"),
    ("#b86e00", "#e69f00"),
    ("#d55e00", "#ff8a3d"),
    ("#008060", "#00c08b"),
    ("#a8477c", "#e08fbd"),
    ("#3a7fae", "#9bd3f5"),
    ("#505050", "#b0b0b0"),
];

/// The colours of several dragons, in the order of the page's identities: each is visible on a light and on a dark
/// ground. The page has 16 identities, of which the last six repeat colours with other dashes.
const DRAGONS: [&str; 16] = [
    "#1f6fb5", "#c4560a", "#0b8560", "#a8478c", "#8a6a00", "#6c58d0", "#1b8296", "#c9525c", "#5f7a1e", "#757980",
    "#1f6fb5", "#c4560a", "#0b8560", "#a8478c", "#8a6a00", "#6c58d0",
];

/// The names of dragons that are colours, with their places in [`DRAGONS`].
const NAMED: [(&str, usize); 14] = [
    ("blue", 0),
    ("orange", 1),
    ("jade", 2),
    ("green", 2),
    ("pink", 3),
    ("gold", 4),
    ("yellow", 4),
    ("violet", 5),
    ("purple", 5),
    ("teal", 6),
    ("red", 7),
    ("lime", 8),
    ("silver", 9),
    ("white", 9),
];

/// The light of their lanterns by night, in the same order, as on the page: red, green and blue.
const LIGHTS: [[u8; 3]; 16] = [
    [84, 150, 255],
    [255, 120, 40],
    [50, 225, 140],
    [255, 90, 190],
    [255, 178, 50],
    [150, 110, 255],
    [50, 215, 240],
    [255, 56, 36],
    [175, 230, 60],
    [225, 232, 255],
    [40, 100, 255],
    [255, 150, 90],
    [130, 255, 190],
    [255, 150, 215],
    [255, 214, 120],
    [190, 160, 255],
];

/// Returns the colours of dragons with these names, as on the page.
pub fn colours_of(names: &[&str]) -> Vec<&'static str> {
    identities_of(names).into_iter().map(|place| DRAGONS[place]).collect()
}

/// Returns the light of the lanterns of dragons with these names, as on the page: red, green and blue.
pub fn lights_of(names: &[&str]) -> Vec<[u8; 3]> {
    identities_of(names).into_iter().map(|place| LIGHTS[place]).collect()
}

/// Returns the identities of dragons with these names: a name that is a colour has that colour, the others have the
/// first that are free.
fn identities_of(names: &[&str]) -> Vec<usize> {
    let mut places: Vec<Option<usize>> = Vec::with_capacity(names.len());
    for name in names {
        let own = NAMED.iter().find(|(named, _)| named == name).map(|(_, place)| *place);
        places.push(own.filter(|own| !places.contains(&Some(*own))));
    }
    let mut free = (0..DRAGONS.len()).cycle().filter(|place| !places.contains(&Some(*place)));
    // At most ten colours have names, so that some are always free.
    places.iter().map(|place| place.or_else(|| free.next()).unwrap_or(0)).collect()
}

impl Palette {
    /// Returns the colours with the names of their variables in the style sheet.
    pub fn named(&self) -> [(&'static str, &'static str); 11] {
        [
            ("ground", self.ground),
            ("ink", self.ink),
            ("quiet", self.quiet),
            ("faint", self.faint),
            ("line", self.line),
            ("danger", self.danger),
            ("warning", self.warning),
            ("still", self.still),
            ("slow", self.slow),
            ("middle", self.middle),
            ("fast", self.fast),
        ]
    }

    /// Returns a colour of the scale from slow (0) to fast (1).
    pub fn shade(&self, part: f64) -> String {
        let step = ((part.clamp(0.0, 1.0) * SHADES as f64) as usize).min(SHADES - 1);
        let part = step as f64 / (SHADES - 1) as f64;
        if part < 0.5 {
            mixed(self.slow, self.middle, 2.0 * part)
        } else {
            mixed(self.middle, self.fast, 2.0 * part - 1.0)
        }
    }
}

/// Returns red, green and blue of `#rrggbb`; black for any other text.
pub fn channels(hex: &str) -> [u8; 3] {
    let number = u32::from_str_radix(hex.trim_start_matches('#'), 16).unwrap_or(0);
    let [_, red, green, blue] = number.to_be_bytes();
    [red, green, blue]
}

fn mixed(from: &str, to: &str, part: f64) -> String {
    let (from, to) = (channels(from), channels(to));
    let [red, green, blue] = [0, 1, 2].map(|k| {
        let (one, other) = (f64::from(from[k]), f64::from(to[k]));
        (one + (other - one) * part).round() as u8
    });
    format!("#{red:02x}{green:02x}{blue:02x}")
}

/// Returns each light colour with its dark counterpart.
fn pairs() -> impl Iterator<Item = (String, String)> {
    let named = LIGHT.named().into_iter().zip(DARK.named()).map(|((_, light), (_, dark))| (light, dark));
    let series = SERIES.into_iter();
    let owned = named.chain(series).map(|(light, dark)| (light.to_owned(), dark.to_owned()));
    let parts = (0..SHADES).map(|step| step as f64 / (SHADES - 1) as f64);
    owned.chain(parts.map(|part| (LIGHT.shade(part), DARK.shade(part))))
}

/// Returns style rules that replace the light colours of `svg` by the dark ones if the viewer prefers dark. A rule
/// overrides an attribute; a program without style rules draws the light colours.
pub fn dark_rules(svg: &str) -> String {
    let mut rules = String::new();
    let mut seen = Vec::new();
    for (light, dark) in pairs() {
        for written in [light.clone(), light.to_uppercase()] {
            for attribute in ["fill", "stroke", "stop-color"] {
                let selector = format!("{attribute}=\"{written}\"");
                if svg.contains(&selector) && !seen.contains(&selector) {
                    // Writing to a String cannot fail.
                    let _ = write!(rules, "[{selector}]{{{attribute}:{dark}}}");
                    seen.push(selector);
                }
            }
        }
    }
    format!("@media(prefers-color-scheme:dark){{{rules}}}")
}

/// Returns an SVG in light colours with the rules that make it dark if the viewer prefers dark.
pub fn with_dark_rules(svg: &str) -> String {
    let rules = dark_rules(svg);
    match svg.find('>') {
        Some(end) => format!("{}<style>{rules}</style>{}", &svg[..=end], &svg[end + 1..]),
        None => svg.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_goes_from_slow_over_middle_to_fast() {
        for palette in [LIGHT, DARK] {
            assert_eq!((palette.shade(-1.0).as_str(), palette.shade(2.0).as_str()), (palette.slow, palette.fast));
            let [middle, near] = [palette.middle, &palette.shade(0.5)].map(channels);
            assert!((0..3).all(|k| middle[k].abs_diff(near[k]) < 8), "{middle:?} {near:?}");
        }
    }

    #[test]
    fn rules_name_the_colours_that_occur_and_no_others() {
        let svg = with_dark_rules("<svg a=\"b\"><rect fill=\"#FBFAF7\" stroke=\"#c2001f\"/></svg>");
        assert_eq!(
            svg,
            "<svg a=\"b\"><style>@media(prefers-color-scheme:dark){[fill=\"#FBFAF7\"]{fill:#0b0d11}\
             [stroke=\"#c2001f\"]{stroke:#ff4a5f}}</style><rect fill=\"#FBFAF7\" stroke=\"#c2001f\"/></svg>"
        );
    }
}

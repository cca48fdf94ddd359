//! The light of a dragon's lanterns: red for a single dragon, of its own colour for each of several, as on the page
//! (`crates/outputs/src/view/lantern_light.js`). The middle lantern of a board is gold in every picture.

/// The colours of the things that a dragon's lanterns light, as attributes of SVG.
pub struct Light {
    /// The end of the names of shapes in this light: empty for a single dragon.
    pub suffix: String,
    /// The middle and the rim of a halo from above, and of one from the side.
    pub halo: [String; 2],
    pub halo_aside: [String; 2],
    /// The paper of a lantern from above: around the flame, then outwards.
    pub barrel: [String; 4],
    /// The paper of a lantern from the side.
    pub paper: [String; 4],
    /// The edge of a board from above; its top and its side from a seat.
    pub edge: String,
    pub top: String,
    pub side: String,
    /// The light on the ground: near the board, then outwards.
    pub pool: [String; 4],
    /// The light on the paving as red, green and blue of white; `None` for the light of the paving itself.
    pub tint: Option<[u8; 3]>,
}

/// Returns a colour as SVG writes it.
pub fn css([red, green, blue]: [u8; 3]) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

/// Returns a colour with a share of another.
fn mixed(from: [u8; 3], to: [u8; 3], share: f64) -> [u8; 3] {
    let part = |k: usize| (f64::from(from[k]) + (f64::from(to[k]) - f64::from(from[k])) * share).round() as u8;
    [part(0), part(1), part(2)]
}

impl Light {
    /// Returns the light of red paper lanterns over a flame.
    pub fn fire() -> Self {
        let all = |colours: [&str; 4]| colours.map(str::to_owned);
        Self {
            suffix: String::new(),
            halo: ["#ffb060", "#ff541e"].map(str::to_owned),
            halo_aside: ["#ff9646", "#ff4618"].map(str::to_owned),
            barrel: all(["#fff0b0", "#ff6a2e", "#d81f14", "#5e0a08"]),
            paper: all(["#fffbe4", "#ffdc8c", "#ff6a2a", "#b8140c"]),
            edge: "#7a3518".to_owned(),
            top: "#8a3014".to_owned(),
            side: "#c2501c".to_owned(),
            pool: all(["#ff8a3c", "#e06a28", "#a03c14", "#601c08"]),
            tint: None,
        }
    }

    /// Returns the light of dragon `number` of several.
    pub fn of(number: usize, light: [u8; 3]) -> Self {
        let white = |share: f64| css(mixed(light, [255, 250, 232], share));
        let dark = |share: f64| css(mixed(light, [0, 0, 0], share));
        let barrel = [white(0.7), css(light), dark(0.3), dark(0.65)];
        Self {
            suffix: format!("-{number}"),
            halo: [white(0.45), css(light)],
            halo_aside: [white(0.35), css(light)],
            paper: [white(0.9), white(0.55), css(light), dark(0.4)],
            barrel,
            edge: dark(0.5),
            top: dark(0.55),
            side: dark(0.35),
            pool: [white(0.1), dark(0.12), dark(0.4), dark(0.65)],
            tint: Some(light),
        }
    }
}

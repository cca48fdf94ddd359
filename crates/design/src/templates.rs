//! The scenes with which a design begins.

/// A scene to begin with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Template {
    /// The name in requests.
    pub key: &'static str,
    /// The name for people.
    pub title: &'static str,
    /// The text.
    pub text: &'static str,
}

/// The templates, the first of which stands where no other text is given.
pub const TEMPLATES: [Template; 5] = [
    Template { key: "coil", title: "Coil", text: include_str!("../../../config/paper.toml") },
    Template { key: "turn", title: "Coil, turn, come out", text: include_str!("../../../config/turnaround.toml") },
    Template { key: "procession", title: "Procession", text: include_str!("../../../config/procession.toml") },
    Template { key: "square", title: "Square with obstacles", text: include_str!("../../../config/square.toml") },
    Template { key: "two", title: "Two dragons", text: include_str!("../../../config/crossing.toml") },
];

/// Returns a template by its name in requests.
pub fn template(key: &str) -> Option<&'static Template> {
    TEMPLATES.iter().find(|template| template.key == key)
}

//! The texts of a page that readers copy into a shell: lines of blocks marked `sh`, and commands within the text.

use std::path::Path;

/// A command as it is printed.
#[derive(Debug)]
pub struct Printed {
    /// `page:line`.
    pub place: String,
    /// The line without its comment, spaces made single, continued lines joined.
    pub text: String,
    /// True for a command within the text, false for a line of a block.
    pub inline: bool,
}

/// The commands below one heading, in the page's order.
#[derive(Debug, Default)]
pub struct Section {
    pub commands: Vec<Printed>,
}

/// Words that begin a command among the backticked texts, with at least one more word.
const PROGRAMS: [&str; 29] = [
    ".venv/bin/python",
    "apt",
    "apt-get",
    "bench-dragon",
    "cargo",
    "chromium",
    "colcon",
    "curl",
    "du",
    "ffmpeg",
    "for",
    "git",
    "iox2",
    "iox2-link-tunnel-zenoh",
    "java",
    "mkdir",
    "nohup",
    "pip",
    "python3",
    "ros2",
    "rsvg-convert",
    "rustup",
    "rviz2",
    "source",
    "ssh",
    "stress-ng",
    "sudo",
    "tar",
    "time",
];

/// Marks of blocks that are not commands.
const OTHER_LANGUAGES: [&str; 6] = ["js", "json", "python", "text", "toml", "yaml"];

/// Returns a command without its leading `NAME=VALUE` words.
pub fn without_variables(command: &str) -> &str {
    match command.split_once(' ') {
        Some((first, rest)) if first.contains('=') && first.starts_with(|c: char| c.is_ascii_uppercase()) => {
            without_variables(rest)
        }
        _ => command,
    }
}

/// Returns the sections of a page that have commands.
///
/// # Panics
/// If a block does not name its language: it is then unknown if the block is to be run.
pub fn sections(root: &Path, page: &str) -> Vec<Section> {
    let text = std::fs::read_to_string(root.join(page)).unwrap();
    let mut reader = Reader { page, sections: vec![Section::default()], paragraph: String::new(), paragraph_line: 0 };
    let mut block: Option<Block> = None;
    for (line, number) in text.lines().zip(1..) {
        let marker = line.trim_start().strip_prefix("```");
        match (&mut block, marker) {
            (None, Some(language)) => {
                reader.end_paragraph();
                block = Some(Block { is_shell: is_shell(language, page, number), continued: String::new() });
            }
            (Some(_), Some(_)) => block = None,
            (Some(block), None) => reader.block_line(block, line, number),
            (None, None) => reader.prose_line(line, number),
        }
    }
    assert!(block.is_none(), "{page}: a block has no end");
    reader.end_paragraph();
    reader.sections.retain(|section| !section.commands.is_empty());
    reader.sections
}

struct Block {
    is_shell: bool,
    continued: String,
}

fn is_shell(language: &str, page: &str, line: u32) -> bool {
    let known = language == "sh" || OTHER_LANGUAGES.contains(&language);
    assert!(known, "{page}:{line}: a block is marked sh, or with its language: \"{language}\"");
    language == "sh"
}

struct Reader<'a> {
    page: &'a str,
    sections: Vec<Section>,
    paragraph: String,
    paragraph_line: u32,
}

impl Reader<'_> {
    fn prose_line(&mut self, line: &str, number: u32) {
        let begins = self.paragraph.trim().is_empty();
        let indented = begins && line.strip_prefix("    ").is_some_and(|line| is_command(line.trim_start()));
        assert!(!indented, "{}:{number}: commands stand in blocks marked sh: {line}", self.page);
        let is_heading = line.starts_with('#');
        if is_heading || line.is_empty() || line.starts_with('|') || line.starts_with("- ") {
            self.end_paragraph();
        }
        if is_heading {
            self.sections.push(Section::default());
        }
        if begins || self.paragraph.is_empty() {
            self.paragraph_line = number;
        }
        self.paragraph.push_str(line.trim());
        self.paragraph.push(' ');
    }

    fn end_paragraph(&mut self) {
        let paragraph = std::mem::take(&mut self.paragraph);
        // Every second part is in backticks.
        for span in paragraph.split('`').skip(1).step_by(2).filter(|span| is_command(span)) {
            self.push(span, self.paragraph_line, true);
        }
    }

    fn block_line(&mut self, block: &mut Block, line: &str, number: u32) {
        if !block.is_shell {
            return;
        }
        let line = without_comment(line.trim());
        if let Some(begun) = line.strip_suffix('\\') {
            block.continued.push_str(begun);
        } else {
            let whole = std::mem::take(&mut block.continued) + line;
            if !whole.is_empty() {
                self.push(&whole, number, false);
            }
        }
    }

    fn push(&mut self, command: &str, line: u32, inline: bool) {
        let text = Vec::from_iter(command.split_whitespace()).join(" ");
        let printed = Printed { place: format!("{}:{line}", self.page), text, inline };
        self.sections.last_mut().unwrap().commands.push(printed);
    }
}

fn is_command(span: &str) -> bool {
    let command = without_variables(span);
    let first = command.split_whitespace().next().unwrap_or_default();
    command == "tests/run" || command.contains(' ') && (PROGRAMS.contains(&first) || first.ends_with(".py"))
}

/// Returns a line without its comment, which begins with `# `: `'http://127.0.0.1:8080/#show'` has none.
fn without_comment(line: &str) -> &str {
    if line.starts_with("# ") { "" } else { line.split(" # ").next().unwrap_or_default().trim_end() }
}
